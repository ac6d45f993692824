"""The covariance of position, velocity and acceleration of single axes, kept as six terms: ss, sv, sa, vv, va, aa.

Component by component over arrays of any shape, since stacked 3 x 3 products cost several times as much.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
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


def reduced(prior: Terms, cross: Floats, s: Floats, gain: Floats) -> Floats:
    """The terms (6, ...) after any gains (3, ...): those after the best gains, and what these cost for being others.

    `cross` (3, ...) is the state's covariance with the residual, `s` (...) the residual's variance. Equal to Joseph's form,
    symmetric by construction.
    """
    root = np.sqrt(s)
    told = cross / root
    off = gain * root - told
    terms = np.empty((len(_TERMS), *s.shape))
    for place, (i, j) in enumerate(_TERMS):  # one small array after the other: they stay in the cache
        np.subtract(prior[place], told[i] * told[j], out=terms[place])
        terms[place] += off[i] * off[j]
    return terms


def settled(lost: Floats, interval_s: Floats, noise: Floats) -> Floats:
    """The terms (6, ...) just after an update in the steady state of `lost` = 1 - r; `noise`: the position's variance, m2."""
    alpha, beta = lost * (2.0 - lost), 2.0 * lost * lost
    gamma = beta * beta / alpha
    remaining, surplus = 1.0 - alpha, 2.0 * beta - gamma
    by_t = 1.0 / interval_s
    speed = noise * by_t
    turning = speed * by_t
    terms = np.empty((len(_TERMS), *lost.shape))
    terms[0] = noise * alpha
    terms[1] = speed * beta
    terms[2] = (0.5 * gamma) * turning
    terms[3] = turning * (8.0 * alpha * beta + gamma * (beta - 2.0 * alpha - 4.0)) / (8.0 * remaining)
    terms[4] = (turning * by_t) * (0.25 * beta) * surplus / remaining
    terms[5] = (turning * by_t * by_t) * (0.25 * gamma) * surplus / remaining
    return terms


def with_velocity(terms: Floats, noise: Floats) -> tuple[Floats, Floats, Floats]:
    """Best gains (3, ...), the residual's variance, and the terms (6, ...) after a measured velocity with noise variances."""
    ss, sv, sa, vv, va, aa = terms
    s = vv + noise
    gain = np.stack([sv, vv, va]) / s
    kept = noise / s
    by_s, _, by_a = gain
    return gain, s, np.stack([ss - by_s * sv, sv * kept, sa - by_s * va, vv * kept, va * kept, aa - by_a * va])
