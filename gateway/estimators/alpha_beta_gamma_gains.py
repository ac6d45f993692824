"""The gains of the adaptive alpha-beta-gamma filter: steady ones of p q, or the covariance's own; and what residuals teach.

Arrays are (n, axes). Source: 002-1, sections 1 and 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.alpha_beta_gamma_state import WINDOW, Estimate, Tuning, terms_now
from gateway.estimators.axis_covariance import Terms, Three, reduced, settled
from gateway.estimators.axis_innovation import bounded
from gateway.estimators.source_error import Share
from gateway.estimators.steady_gains import LEAST_RATIO, gains_of, gamma_for, lost_memory, memory

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LEAST_GAMMA, GREATEST_GAMMA = 1e-6, 3.5
GREATEST_DENSITY = 1e6  # m2/s5
GREATEST_LESSON = 9.0  # squared residual, normalised: what an outlier teaches of the calm target is bounded
SHORTEST_S = 1e-3  # that a fixed q is taken over


@dataclass(frozen=True, slots=True)
class Steady:
    """What the steady state of p q would do over the time since the last update."""

    density: Floats  # m2/s5 that holds for the interval
    interval: Floats  # s that gains are taken for
    q: Floats
    gamma: Floats
    gain: Three

    @classmethod
    def of(cls, state: Estimate, noise: Floats, tuning: Tuning, share: Floats | None) -> Steady:
        """The steady gains for positions with variances; `share`: of each axis that was measured, None = all."""
        density, interval, q = _calm(state, noise, tuning)
        gamma = np.minimum(np.maximum(state.p * q, LEAST_GAMMA), GREATEST_GAMMA)
        gain = gains_of(lost_memory(gamma), gamma, interval)
        if share is not None:
            gain = (share * gain[0], share * gain[1], share * gain[2])
        return cls(density, interval, q, gamma, gain)


@dataclass(frozen=True, slots=True)
class Weighed:
    """How residuals count: gains, the terms (6, n, axes) after them, and what residuals were expected to scatter by."""

    gain: Three
    terms: Floats
    variance: Floats  # of a residual
    expected: Floats  # the same of a calm target
    growth: Floats  # of the variance, where a residual lay too far out
    outlying: Bools  # (n,)


def by_covariance(
    state: Estimate,
    steady: Steady,
    noise: Floats,
    squared: Floats,
    tuning: Tuning,
    share: Floats | None,
    off: Share | None,
    sped: Bools,
) -> Weighed:
    """Gains that follow the covariance, where it knows the position worse than the steady state would.

    `squared` residuals; `off`: what they hold of the source's error; `sped` (n, axes): the velocity was measured lately.
    """
    prior = terms_now(state, steady.density)
    cross = prior[:3] if share is None else (share * prior[0], share * prior[1], share * prior[2])
    s = noise + (prior[0] if share is None else share * cross[0])
    gain = _followed(steady.gain, prior, s if share is None else prior[0] + noise, sped)
    whole_s = s if off is None else s + off.variance
    gain, growth, outlying = bounded(gain, whole_s, squared, tuning.robust)
    return Weighed(gain, reduced(prior, cross, growth * s, gain), whole_s, whole_s, growth, outlying)


def as_printed(
    state: Estimate, steady: Steady, noise: Floats, squared: Floats, tuning: Tuning, off: Share | None
) -> Weighed:
    """Steady gains and the steady state's covariance throughout; arguments as `by_covariance`."""
    calm = lost_memory(steady.q)
    most = np.maximum(lost_memory(steady.gamma), calm)  # a p below 1 makes nothing surer
    whole_s, expected = noise / np.square(1.0 - most), noise / np.square(1.0 - calm)
    if off is not None:
        whole_s, expected = whole_s + off.variance, expected + off.variance
    gain, growth, outlying = bounded(steady.gain, whole_s, squared, tuning.robust)
    terms = settled(most, np.maximum(steady.gamma, steady.q), steady.interval, noise)
    return Weighed(gain, terms, whole_s, expected, growth, outlying)


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


def lessons(
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
