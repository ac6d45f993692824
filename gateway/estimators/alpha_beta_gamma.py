"""The adaptive alpha-beta-gamma filter: constant acceleration between updates, every axis by itself, one gain parameter.

The gains are those of `steady_gains` at gamma = p q: q comes from a table over the ratio of signal to noise, p is how far
the last residuals exceed what was expected of them. What is known of a target over intervals and noises that change is the
density of its acceleration's random walk, m2/s5, learnt slowly from the residuals: sigma_w^2 = density T.

Beside the state runs its covariance, right for whatever gains were used: for gates and outputs, and to see where steady
gains do not fit. After the start, after a gap, between sources of unlike quality and where velocity is measured, the gain
follows the covariance.

Arrays are (n, axes): n tracks, their axes (east, north, up at the runway centre). Nothing mixes tracks or axes.
Source: 002-1, sections 1 and 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import fading, source_error
from gateway.estimators.alpha_beta_gamma_gains import Steady, as_printed, by_covariance, lessons
from gateway.estimators.alpha_beta_gamma_state import (
    WINDOW,
    Estimate,
    Tuning,
    covariance,
    own_terms,
    shaken,
    terms_now,
)
from gateway.estimators.axis_covariance import Three, with_velocity
from gateway.estimators.axis_innovation import Innovation

__all__ = ["WINDOW", "Estimate", "Tuning", "ahead", "covariance", "own_terms", "predict", "start", "update"]

Floats = NDArray[np.float64]

ELSEWHERE = 2.0  # times `robust`: a residual further out is no manoeuvre, but another place, and teaches nothing
SPED_S = 10.0  # how long a measured velocity makes steady gains, which know of none, too high
UNKNOWN_SPEED_MPS, UNKNOWN_ACCELERATION_MPS2 = 100.0, 5.0  # sigmas of what is not measured at the start


def start(
    position: Floats,
    sigma: Floats,
    tuning: Tuning,
    velocity: Floats | None = None,
    velocity_sigma: Floats | float = UNKNOWN_SPEED_MPS,
) -> Estimate:
    """First states of n tracks at positions with sigmas, and velocities with sigmas where known (NaN = not), (n, axes)."""
    zero = np.zeros_like(position)
    known = np.zeros(position.shape, dtype=np.bool_) if velocity is None else ~np.isnan(velocity)
    spread = np.where(known, velocity_sigma, UNKNOWN_SPEED_MPS)
    sure = np.full_like(zero, UNKNOWN_ACCELERATION_MPS2**2)
    terms = np.stack([sigma * sigma, zero, zero, spread * spread, zero, sure])
    speed = zero if velocity is None else np.where(known, velocity, 0.0)
    density = np.full_like(zero, tuning.density)
    sped = np.where(known, 0.0, np.inf)
    return Estimate(
        position, speed, zero, terms, zero, density, np.ones((WINDOW, *zero.shape)), np.ones_like(zero), sped
    )


def predict(state: Estimate, elapsed_s: Floats) -> Estimate:
    """The states `elapsed_s` (n,), not negative, later; two short steps equal one long one. Source: 002-1, eq 2."""
    t = elapsed_s[:, None]
    velocity = state.velocity + t * state.acceleration
    position = state.position + (0.5 * t) * (state.velocity + velocity)
    kept = (state.acceleration, state.terms, state.since_s + t, state.density, state.surprises, state.p)
    error = None if state.error is None else source_error.carried(state.error, t)
    return Estimate(position, velocity, *kept, state.sped_s + t, error)


def ahead(state: Estimate, elapsed_s: Floats, fades_in_s: float) -> tuple[Three, Three]:
    """After silences of (n,) seconds, in which accelerations fade: means, and ss, sv, vv without the source error's part."""
    t = elapsed_s[:, None]
    mean = fading.moved((state.position, state.velocity, state.acceleration), t, fades_in_s)
    return mean, fading.spread(own_terms(state), t, shaken(state, state.density), fades_in_s)


def update(
    state: Estimate,
    position: Floats,
    sigma: Floats,
    tuning: Tuning,
    velocity: Floats | None = None,
    velocity_sigma: Floats | float = UNKNOWN_SPEED_MPS,
    share: Floats | None = None,
    by_source: Floats | float = 0.0,
) -> tuple[Estimate, Innovation]:
    """States after positions with sigmas (n, axes), and velocities where there are any; NaN components are left out.

    `share` (n, axes), in [0, 1]: how much of an axis was measured, where a component of a plot was missing and the
    prediction's own value stands in for it; None = all. What stands in does not make a state surer of itself.
    `by_source`: 1 where the position has the source's error in it (and in `position` its estimate is taken off), else 0.
    Source: 002-1, sections 1 and 2.2. Deviation: the gain may follow the covariance; `Tuning.follows_covariance`.
    """
    measured = ~np.isnan(position) if share is None else ~np.isnan(position) & (share > 0.0)
    whole = bool(measured.all())
    y, noise = position - state.position, sigma * sigma
    if not whole:
        y, noise = np.where(measured, y, 0.0), np.where(measured, noise, 1.0)
    error, off = state.error, None
    if error is not None:
        seen = measured.astype(np.float64) if share is None else measured * share
        off = source_error.Share.of(error, 0, by_source, seen)
    steady, squared = Steady.of(state, noise, tuning, share), y * y
    if tuning.follows_covariance:
        sped = state.sped_s < SPED_S if velocity is None else (state.sped_s < SPED_S) | ~np.isnan(velocity)
        found = by_covariance(state, steady, noise, squared, tuning, share, off, sped)
    else:
        found = as_printed(state, steady, noise, squared, tuning, off)
    gain, terms = found.gain, found.terms
    learnt = measured if share is None else measured & (share == 1.0)
    surprise = squared / found.expected
    if error is not None and off is not None:
        error, gain = off.told(error, y, found.growth * found.variance, gain)
    scatter = found.variance if whole else np.where(measured, found.variance, 1.0)
    told = Innovation(y, scatter, measured, found.outlying, steady.gamma)
    after = _corrected((state.position, state.velocity, state.acceleration), gain, y)
    touched, sped_s, axes = measured, state.sped_s, y.shape[1]
    if velocity is not None:
        if not whole:
            terms = np.where(measured, terms, terms_now(state, steady.density))
        after, terms, error, told = _sped(after, terms, error, velocity, velocity_sigma, told, tuning)
        new, faster = told.measured[:, axes:], told.innovation[:, axes:]
        surprise = np.where(new, faster * faster / told.variance[:, axes:], surprise)  # it shows a manoeuvre sooner
        touched, learnt, sped_s = measured | new, learnt | new, np.where(new, 0.0, sped_s)
    if tuning.robust is not None:
        learnt = learnt & (surprise <= (ELSEWHERE * tuning.robust) ** 2)
    surprises, p, density = lessons(state, steady.density, surprise, learnt, tuning)
    since = np.zeros_like(y)
    if not touched.all():
        terms, since = np.where(touched, terms, state.terms), np.where(touched, since, state.since_s)
    return Estimate(*after, terms, since, density, surprises, p, sped_s, error), told


def _corrected(mean: Three, gain: Three, y: Floats) -> Three:
    return mean[0] + gain[0] * y, mean[1] + gain[1] * y, mean[2] + gain[2] * y


def _sped(
    mean: Three,
    terms: Floats,
    error: Floats | None,
    velocity: Floats,
    sigma: Floats | float,
    told: Innovation,
    tuning: Tuning,
) -> tuple[Three, Floats, Floats | None, Innovation]:
    """Means, terms (6, n, axes) and source errors after velocities too, with the covariance's own gains."""
    measured = ~np.isnan(velocity)
    y = np.where(measured, velocity - mean[1], 0.0)
    noise = np.where(measured, np.square(sigma), 1.0)
    off = None if error is None else source_error.Share.of(error, 1, 0.0, measured.astype(np.float64))
    s = terms[3] + noise if off is None else terms[3] + noise + off.variance
    outlying = told.outlying
    growth: Floats = np.ones_like(s)
    if tuning.robust is not None:
        growth = np.maximum(y * y / (s * tuning.robust**2), 1.0)
        outlying = outlying | np.asarray((growth > 1.0).any(axis=-1))
        noise = noise + (growth - 1.0) * (terms[3] + noise)
    gain, _, less = with_velocity(terms, noise)
    if error is not None and off is not None:
        error, gain = off.told(error, y, growth * s, gain)
    both = Innovation(
        np.concatenate([told.innovation, y], axis=-1),
        np.concatenate([told.variance, np.where(measured, s, 1.0)], axis=-1),
        np.concatenate([told.measured, measured], axis=-1),
        outlying,
        told.gamma,
    )
    return _corrected(mean, gain, y), np.where(measured, less, terms), error, both
