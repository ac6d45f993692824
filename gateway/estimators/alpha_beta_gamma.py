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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import fading, source_error
from gateway.estimators.axis_covariance import (
    Terms,
    Three,
    carried,
    matrices,
    reduced,
    settled,
    with_velocity,
)
from gateway.estimators.axis_innovation import Innovation, bounded
from gateway.estimators.steady_gains import LEAST_RATIO, gains_of, gamma_for, lost_memory, memory

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WINDOW = 10  # residuals that p is the mean of
LEAST_GAMMA, GREATEST_GAMMA = 1e-6, 3.5
GREATEST_DENSITY = 1e6  # m2/s5
GREATEST_LESSON = 9.0  # squared residual, normalised: what an outlier teaches of the calm target is bounded
ELSEWHERE = 2.0  # times `robust`: a residual further out is no manoeuvre, but another place, and teaches nothing
SHORTEST_S = 1e-3  # that a fixed q is taken over
SPED_S = 10.0  # how long a measured velocity makes steady gains, which know of none, too high
UNKNOWN_SPEED_MPS, UNKNOWN_ACCELERATION_MPS2 = 100.0, 5.0  # sigmas of what is not measured at the start


@dataclass(frozen=True, slots=True)
class Tuning:
    """What the filter assumes; the defaults serve drones and jets, since density and p follow the target."""

    q: float | None = None  # of a calm target, fixed, for equal intervals; None = from the table
    density: float = 0.1  # m2/s5 at the start: growth of the acceleration's variance a second
    learning: float = 0.02  # of the logarithm of the density, for each unit of surprise; 0 = never
    least_density: float = 1e-6  # m2/s5 that it can be taught
    least_p: float = 0.3  # without a floor a target without noise would freeze the filter
    greatest_p: float = 30.0
    follows_covariance: bool = True  # False: as printed, gains and covariance of the steady state throughout
    robust: float | None = None  # sigmas beyond which a residual pulls no more


@dataclass(frozen=True, slots=True)
class Estimate:
    """n tracks: position m, velocity m/s, acceleration m/s2 (n, axes) now; the rest as it was at each axis's last update.

    `terms` (6, n, axes): the covariance in the order ss, sv, sa, vv, va, aa.
    """

    position: Floats
    velocity: Floats
    acceleration: Floats
    terms: Floats
    since_s: Floats  # (n, axes) since the last update
    density: Floats  # (n, axes) m2/s5, of the calm target
    surprises: Floats  # (WINDOW, n, axes) squared residuals over what was expected, latest last
    p: Floats  # (n, axes) their mean within its bounds
    sped_s: Floats  # (n, axes) since a velocity was measured, inf = never
    error: Floats | None = None  # (5, n, axes) of the position source, as `source_error` keeps it; None = it has none


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
    """A look ahead by times (n,): means, and ss, sv, vv without the source error's part, while accelerations fade."""
    t = elapsed_s[:, None]
    mean = fading.moved((state.position, state.velocity, state.acceleration), t, fades_in_s)
    return mean, fading.spread(own_terms(state), t, _shaken(state, state.density), fades_in_s)


def covariance(state: Estimate) -> Floats:
    """The covariance now as matrices (n, axes, 3, 3) over position, velocity, acceleration of each axis."""
    terms = own_terms(state)
    return matrices(terms if state.error is None else source_error.spread(terms, state.error))


def own_terms(state: Estimate) -> Terms:
    """ss, sv, sa, vv, va, aa now, each (n, axes), without the source error's part."""
    return _now(state, state.density)


def _now(state: Estimate, density: Floats) -> Terms:
    """The filter's own terms now: those of the last update, over the interval since."""
    if not state.since_s.any():  # just after an update
        ss, sv, sa, vv, va, aa = state.terms
        return ss, sv, sa, vv, va, aa
    return carried(state.terms, state.since_s, _shaken(state, density) * state.since_s)


def _shaken(state: Estimate, density: Floats) -> Floats:
    """Growth of the acceleration's variance a second, (n, axes) m2/s5, in the manoeuvre that p shows."""
    # The step grows as p does where gamma is small. A p below 1, of ten residuals, is luck as often as not, and makes
    # nothing surer.
    return np.asarray(np.square(np.maximum(state.p, 1.0)) * density)


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
    density, interval, q = _calm(state, noise, tuning)
    gamma = np.minimum(np.maximum(state.p * q, LEAST_GAMMA), GREATEST_GAMMA)
    lost = lost_memory(gamma)
    gain = gains_of(lost, gamma, interval)
    if share is not None:
        gain = (share * gain[0], share * gain[1], share * gain[2])
    squared = y * y
    if tuning.follows_covariance:
        prior = _now(state, density)
        cross = prior[:3] if share is None else (share * prior[0], share * prior[1], share * prior[2])
        s = noise + (prior[0] if share is None else share * cross[0])
        sped = state.sped_s < SPED_S if velocity is None else (state.sped_s < SPED_S) | ~np.isnan(velocity)
        gain = _followed(gain, prior, s if share is None else prior[0] + noise, sped)
        whole_s = s if off is None else s + off.variance
        gain, growth, outlying = bounded(gain, whole_s, squared, tuning.robust)
        terms, expected = reduced(prior, cross, growth * s, gain), whole_s
    else:
        calm = lost_memory(q)
        most = np.maximum(lost, calm)  # a p below 1 makes nothing surer
        whole_s, expected = noise / np.square(1.0 - most), noise / np.square(1.0 - calm)
        if off is not None:
            whole_s, expected = whole_s + off.variance, expected + off.variance
        gain, growth, outlying = bounded(gain, whole_s, squared, tuning.robust)
        terms = settled(most, np.maximum(gamma, q), interval, noise)
    learnt = measured if share is None else measured & (share == 1.0)
    surprise = squared / expected
    if error is not None and off is not None:
        error, gain = off.told(error, y, growth * whole_s, gain)
    told = Innovation(y, whole_s if whole else np.where(measured, whole_s, 1.0), measured, outlying, gamma)
    before = (state.position, state.velocity, state.acceleration)
    after = (before[0] + gain[0] * y, before[1] + gain[1] * y, before[2] + gain[2] * y)
    touched, sped_s, axes = measured, state.sped_s, y.shape[1]
    if velocity is not None:
        if not whole:
            terms = np.where(measured, terms, _now(state, density))
        after, terms, error, told = _sped(after, terms, error, velocity, velocity_sigma, told, tuning)
        sped, faster = told.measured[:, axes:], told.innovation[:, axes:]
        surprise = np.where(sped, faster * faster / told.variance[:, axes:], surprise)  # it shows a manoeuvre sooner
        touched, learnt, sped_s = measured | sped, learnt | sped, np.where(sped, 0.0, sped_s)
    if tuning.robust is not None:
        learnt = learnt & (surprise <= (ELSEWHERE * tuning.robust) ** 2)
    surprises, p, density = _lessons(state, density, surprise, learnt, tuning)
    since = np.zeros_like(y)
    if not touched.all():
        terms, since = np.where(touched, terms, state.terms), np.where(touched, since, state.since_s)
    return Estimate(*after, terms, since, density, surprises, p, sped_s, error), told


def _followed(steady: Three, prior: Terms, s: Floats, sped: Bools) -> Three:
    """The gains: steady ones, or the covariance's own where it knows the position worse, or the velocity was measured lately.

    `s` of an axis measured in part is as if it were measured whole: its best gain would exceed 1 on what the other axes are
    told too, and together they would swing.
    """
    by_s = 1.0 / s
    own = prior[0] * by_s
    follows = sped | (own > steady[0])
    return (
        np.where(follows, own, steady[0]),
        np.where(follows, prior[1] * by_s, steady[1]),
        np.where(follows, prior[2] * by_s, steady[2]),
    )


def _calm(state: Estimate, noise: Floats, tuning: Tuning) -> tuple[Floats, Floats, Floats]:
    """The density that holds for the interval, the interval that its gains are taken for (s), and q, all (n, axes)."""
    t = state.since_s
    if tuning.q is not None:
        q = np.array(tuning.q)
        interval = np.maximum(t, SHORTEST_S)
        squares = interval * interval
        return np.square(q / (2.0 * memory(q))) * noise / (squares * squares * interval), interval, q
    squares = t * t
    ratio = state.density * (squares * squares * t) / noise
    if (ratio < LEAST_RATIO**2).any():
        # At almost the same instant gains would not fall with the interval any more, but 1 / T would grow.
        t = np.where(ratio < LEAST_RATIO**2, (LEAST_RATIO**2 * noise / state.density) ** 0.2, t)
        ratio = np.maximum(ratio, LEAST_RATIO**2)
    return state.density, t, gamma_for(ratio)


def _lessons(
    state: Estimate, density: Floats, surprise: Floats, measured: Bools, tuning: Tuning
) -> tuple[Floats, Floats, Floats]:
    """The last surprises, p, and the density after squared residuals over what was expected of them (n, axes)."""
    surprise = np.minimum(surprise, tuning.greatest_p)
    surprises = np.concatenate([state.surprises[1:], surprise[None]])
    if tuning.q is None and tuning.learning:
        lesson = np.exp(tuning.learning * (np.minimum(surprise, GREATEST_LESSON) - 1.0))
        density = np.minimum(np.maximum(density * lesson, tuning.least_density), GREATEST_DENSITY)
    if not measured.all():
        surprises = np.where(measured, surprises, state.surprises)
        density = np.where(measured, density, state.density)
    p = surprises.sum(axis=0) / WINDOW
    return surprises, np.minimum(np.maximum(p, tuning.least_p), tuning.greatest_p), density


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
    after = (mean[0] + gain[0] * y, mean[1] + gain[1] * y, mean[2] + gain[2] * y)
    return after, np.where(measured, less, terms), error, both
