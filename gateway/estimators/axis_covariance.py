"""The covariance of position, velocity and acceleration of single axes, kept as six terms: ss, sv, sa, vv, va, aa.

Component by component over arrays of any shape, since stacked 3 x 3 products cost several times as much.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Three = tuple[Floats, Floats, Floats]
Terms = tuple[Floats, Floats, Floats, Floats, Floats, Floats]

PLACES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # of the terms in the matrix
_TERMS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def carried(terms: Floats, elapsed_s: Floats, step_variance: Floats) -> Terms:
    """The six terms a time later: terms (6, ...), times and the variances of the acceleration's step (...).

    The step comes before the interval: process noise is sigma_w^2 G G' with G = [T^2 / 2, T, 1].
    """
    t, half = elapsed_s, 0.5 * elapsed_s
    ss, sv, sa, vv, va, aa = terms
    aa = aa + step_variance
    half_aa = half * aa
    va_between = va + half_aa
    va_now = va_between + half_aa
    sa_now = sa + t * va_between
    with_old_speed = sv + t * (vv + half * va)
    with_old_place = ss + t * (sv + half * sa)
    ss_now = with_old_place + t * (with_old_speed + half * sa_now)
    return ss_now, with_old_speed + t * sa_now, sa_now, vv + t * (va + va_now), va_now, aa


def reduced(prior: Terms, cross: Three, s: Floats, gain: Three) -> Floats:
    """The terms (6, ...) after any gains: those after the best gains, and what these cost for being others.

    `cross` is the state's covariance with the residual, `s` (...) the residual's variance. Equal to Joseph's form, symmetric
    by construction.
    """
    root = np.sqrt(s)
    by_root = 1.0 / root
    told = [each * by_root for each in cross]
    off = [each * root - one for each, one in zip(gain, told, strict=True)]
    terms = np.empty((len(_TERMS), *s.shape))
    for place, (i, j) in enumerate(_TERMS):
        np.subtract(prior[place], told[i] * told[j], out=terms[place])
        terms[place] += off[i] * off[j]
    return terms


def settled(lost: Floats, gamma: Floats, interval_s: Floats, noise: Floats) -> Floats:
    """The terms (6, ...) just after an update in the steady state of gamma, with `lost` = 1 - r and the noise's variance m2.

    The usual closed forms in alpha, beta and gamma, written in 1 - r.
    """
    half, by_r = 0.5 * gamma, 1.0 / (1.0 - lost)
    by_t = 1.0 / interval_s
    speed = noise * by_t
    turning = speed * by_t
    jerking = turning * by_t
    steep = half * by_r
    terms = np.empty((len(_TERMS), *lost.shape))
    terms[0] = noise * (lost * (2.0 - lost))
    terms[1] = speed * (2.0 * lost * lost)
    terms[2] = turning * half
    terms[3] = turning * (steep * (3.0 - 2.0 * lost))
    terms[4] = jerking * (2.0 * lost * steep)
    terms[5] = (jerking * by_t) * (gamma * steep / lost)
    return terms


def with_velocity(terms: Floats, noise: Floats) -> tuple[Three, Floats, Floats]:
    """Best gains, the residual's variance, and the terms (6, ...) after a measured velocity with noise variances."""
    ss, sv, sa, vv, va, aa = terms
    s = vv + noise
    kept = noise / s
    by_s, by_a = sv / s, va / s
    less = np.stack([ss - by_s * sv, sv * kept, sa - by_s * va, vv * kept, va * kept, aa - by_a * va])
    return (by_s, vv / s, by_a), s, less


def matrices(terms: Terms) -> Floats:
    """The terms, each (n, axes), as matrices (n, axes, 3, 3) over position, velocity, acceleration of each axis."""
    return np.moveaxis(np.array(terms)[PLACES], (0, 1), (-2, -1))
