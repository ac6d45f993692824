"""A track that dead reckoning leads: its state is where that has the aircraft, and how sure that is."""

from __future__ import annotations

import numpy as np

from gateway.align import ReckonedFix
from gateway.estimators import modes
from gateway.estimators.kalman import ERROR, POSITION, SIZE, VELOCITY, Estimate
from gateway.estimators.modes import Mixture
from gateway.fuse.estimating import Estimator
from gateway.fuse.events import NEVER, Event
from gateway.fuse.weighting import Model

REASON = "dead reckoning leads it"


def resumed(base: Event | None, measure: ReckonedFix, estimator: Estimator, model: Model) -> Event:
    """The track's state by dead reckoning. It goes on in the position source's coordinates: what is known of that one's
    error is kept, where the estimator keeps Gaussians.
    """
    first, belief = estimator.begin(measure)
    if base is not None and (belief is None or isinstance(belief, Mixture)):
        first = _with_error(base, measure)
        if model.modes is not None:
            belief = modes.begin(first, model.modes)
    known = base.memory if base is not None else np.full((model.memory, 3), np.nan)
    return Event(
        measure,
        first.mean[0],
        first.covariance[0],
        np.full_like(known, np.nan),
        base.gps_at if base is not None else NEVER,
        base.radar_at if base is not None else NEVER,
        base.interval if base is not None else 0,
        False,
        measure.at,
        base.barometric if base is not None else None,
        base.callsign if base is not None else None,
        belief,
        restarted=REASON,
        restarted_at=base.restarted_at if base is not None else NEVER,
        doubts=base.doubts if base is not None else 0,
        score=base.score if base is not None else 0.0,
    )


def _with_error(base: Event, measure: ReckonedFix) -> Estimate:
    """Position and velocity (1, 9) of dead reckoning, less the source's error as the track has it."""
    error, spread = base.mean[ERROR], base.covariance[ERROR, ERROR]
    mean, covariance = np.zeros((1, SIZE)), np.zeros((1, SIZE, SIZE))
    mean[0, POSITION], mean[0, VELOCITY], mean[0, ERROR] = measure.enu_m - error, measure.velocity_mps, error
    covariance[0, POSITION, POSITION] = np.diag(measure.sigma_m**2) + spread
    covariance[0, VELOCITY, VELOCITY] = np.eye(3) * measure.velocity_sigma_mps**2
    covariance[0, ERROR, ERROR] = spread
    covariance[0, POSITION, ERROR] = covariance[0, ERROR, POSITION] = -spread
    return Estimate(mean, covariance)
