"""Whether measurements are of one thing that flies: the sequential test that confirms a track, and what a gate asks.

Each measurement of a tentative track is weighed under two hypotheses: that it is of the thing which the track follows, and
that it has nothing to do with it, and lies anywhere that something could have flown to since. The logarithms of their
ratio are summed (Wald's sequential test), and begin at nothing again where the sum falls below it (Page's): what does not
fit only delays. The test is the same for reports and plots, for one a second and ten, with velocity and without: what says
more, confirms sooner.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gateway.align import SECOND, Fix
from gateway.estimators.kalman import Estimate, Innovation, predict
from gateway.fuse.events import Event, Measure
from gateway.fuse.weighting import Model, update_in_part, update_with_fixes, update_with_plots
from gateway.track import GREATEST_SPEED_MPS

CONFIRMED = math.inf  # the score of a track that is confirmed: it stays so

NOISE_SIGMAS = 8.0  # to either side: how far off the noise alone may put an unrelated measurement
LEAST_DISTANCE_M = 100.0  # nearer to the radar, an angle's metres would be too few


def score_after(base: Event, measure: Measure, model: Model) -> float:
    """The score of a track after one more measurement; `CONFIRMED` once the odds are those that the options ask for."""
    if base.score == CONFIRMED:
        return CONFIRMED
    state = Estimate(base.mean[None], base.covariance[None])
    elapsed_s = (measure.at - base.at) / SECOND
    _, told = expected(state, elapsed_s, measure, model)
    score = max(base.score + evidence(told, elapsed_s, measure), 0.0)
    return CONFIRMED if score >= model.confirm_score else score


def expected(state: Estimate, elapsed_s: float, measure: Measure, model: Model) -> tuple[Estimate, Innovation]:
    """One state (1, 9) carried on to a measurement and corrected by it, and what the measurement told it.

    By the one motion, also where the model has modes.
    """
    model = replace(model, modes=None)
    state = predict(state, np.array([elapsed_s]), model.motion)
    if not isinstance(measure, Fix):
        polar, sigma = np.array([measure.polar]), np.array([measure.sigma])
        return update_with_plots(state, polar, sigma, model.radars[measure.radar])
    position, sigma, speed_sigma = measure.enu_m[None], measure.sigma_m[None], np.array([measure.velocity_sigma_mps])
    memory = np.full((1, model.memory, 3), math.nan)
    if measure.local is not None:
        after, told, _ = update_in_part(state, position, sigma, [measure.local], speed_sigma, memory, model)
    else:
        velocity = measure.velocity_mps[None]
        after, told, _ = update_with_fixes(state, position, sigma, velocity, speed_sigma, memory, model)
    return after, told


def evidence(told: Innovation, elapsed_s: float, measure: Measure) -> float:
    """Logarithm of how much likelier a measurement is as the track's own than as one of something unrelated."""
    widths = _widths(elapsed_s, measure)
    space = sum(math.log(width) for width, known in zip(widths, told.measured[0].tolist(), strict=True) if known)
    return float(told.log_likelihood[0]) + space


def _widths(elapsed_s: float, measure: Measure) -> tuple[float, ...]:
    """How wide the range is that an unrelated measurement may lie in, component by component."""
    reach_m = GREATEST_SPEED_MPS * elapsed_s
    if isinstance(measure, Fix):
        places = (2.0 * (reach_m + NOISE_SIGMAS * sigma) for sigma in measure.sigma_m.tolist())
        return (*places, *(2.0 * GREATEST_SPEED_MPS,) * 3)
    distance = measure.polar[0]
    angle = math.pi if math.isnan(distance) else reach_m / max(distance, LEAST_DISTANCE_M)
    wide = (reach_m, angle, angle)
    return tuple(
        2.0 * min(reach + NOISE_SIGMAS * sigma, limit)
        for reach, sigma, limit in zip(wide, measure.sigma, (math.inf, math.pi, 0.5 * math.pi), strict=True)
    )
