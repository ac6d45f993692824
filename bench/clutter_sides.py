"""The trackers that `bench.clutter` compares on the same plots: ours and Stone Soup's, all from nothing, at the same tuning."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.track_splitting import Plots

Floats = NDArray[np.float64]
Known = tuple[Floats, int]  # states (4, n) of targets at an instant, ns: x, y and their rates
Tracker = Callable[[Plots, int], tuple[Floats, float]]  # a scan and its instant, ns: positions (2, e), and CPU seconds

DENSITY, SIGMA_M, DETECTION, SPEED_SIGMA_MPS = 1.0, 50.0, 0.9, 30.0
KNOWN_SPEED_SIGMA_MPS = 5.0  # of a track that has been followed for a while
MISSED_DISTANCE = 3.72  # the gate of 0.999 in two components
GREATEST_DISTANCE_M, NEIGHBOURS = 1000.0, 5  # of the kd-tree; 180 m in a scan, and what 30 m/s more would be
# What gives Stone Soup's trackers their least GOSPA in these scenes:
BEGINS_AFTER, HELD_FOR, ENDS_AFTER = 4, 2, 4  # plots; scans without one, before and after that


def ours(clutter: float, known: Known | None = None) -> Tracker:
    """Track splitting; `clutter` plots a scan and square metre come with the plots.

    Where targets are told beforehand they are confirmed tracks, and it goes on finding others, as it always does.
    """
    from gateway.estimators.track_splitting import Bank
    from gateway.estimators.track_splitting_bank import begun
    from sim.studies.clutter_sides import shipped

    bank = None
    if known is not None:
        state, since = known
        count = state.shape[1]
        scatter = np.repeat(np.diag([SIGMA_M**2] * 2 + [KNOWN_SPEED_SIGMA_MPS**2] * 2)[:, :, None], count, axis=2)
        bank = begun(Bank.empty(since, 2), state, scatter, -np.arange(1, count + 1), np.ones(count))
        bank = replace(bank, confirmed=np.ones(count, np.bool_))
    tracker = shipped(bank=bank)

    def scan(plots: Plots, at: int) -> tuple[Floats, float]:
        began = time.process_time()
        seen = tracker(plots, at)
        return seen.position, time.process_time() - began

    return scan


def joint(clutter: float, known: Known | None = None) -> Tracker:
    """Stone Soup's JPDA (with loopy belief propagation: the one that does not count joint hypotheses one by one)."""
    from stonesoup.dataassociator.probability import JPDAwithLBP
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.tracker.simple import MultiTargetMixtureTracker

    parts = _Parts()
    hypothesiser = PDAHypothesiser(
        parts.predictor, parts.updater, clutter, prob_detect=DETECTION, prob_gate=0.999, include_all=False
    )
    return parts.tracker(MultiTargetMixtureTracker, JPDAwithLBP(hypothesiser), known)


def nearest(clutter: float, known: Known | None = None) -> Tracker:
    """Stone Soup's global nearest neighbour behind a kd-tree."""
    from stonesoup.tracker.simple import MultiTargetTracker

    parts = _Parts()
    return parts.tracker(MultiTargetTracker, parts.nearest(), known)


class _Parts:
    """What Stone Soup's trackers have in common: motion, measurement, initiation by nearest neighbours, ends."""

    def __init__(self) -> None:
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import KalmanPredictor
        from stonesoup.updater.kalman import KalmanUpdater

        self.model = LinearGaussian(4, (0, 2), np.diag([SIGMA_M**2, SIGMA_M**2]))
        motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(DENSITY), ConstantVelocity(DENSITY)])
        self.predictor, self.updater = KalmanPredictor(motion), KalmanUpdater(self.model)

    def nearest(self) -> Any:
        """An associator."""
        from stonesoup.dataassociator.tree import DetectionKDTreeGNN2D
        from stonesoup.hypothesiser.distance import DistanceHypothesiser
        from stonesoup.measures import Mahalanobis

        hypothesiser = DistanceHypothesiser(
            self.predictor, self.updater, measure=Mahalanobis(), missed_distance=MISSED_DISTANCE
        )
        return DetectionKDTreeGNN2D(
            hypothesiser,
            self.predictor,
            self.updater,
            number_of_neighbours=NEIGHBOURS,
            max_distance=GREATEST_DISTANCE_M,
        )

    def tracker(self, kind: Any, associator: Any, known: Known | None = None) -> Tracker:
        """A whole tracker, fed scan by scan; with what is known at an instant it finds nothing and ends nothing."""
        from datetime import UTC, datetime, timedelta

        from stonesoup.deleter.time import UpdateTimeStepsDeleter
        from stonesoup.initiator.simple import MultiMeasurementInitiator
        from stonesoup.types.detection import Detection
        from stonesoup.types.state import GaussianState
        from stonesoup.types.track import Track

        begin, waiting = datetime(2026, 1, 1, tzinfo=UTC), []
        prior = GaussianState(np.zeros((4, 1)), np.diag([SIGMA_M**2, SPEED_SIGMA_MPS**2] * 2), timestamp=begin)
        initiator = MultiMeasurementInitiator(
            prior,
            deleter=UpdateTimeStepsDeleter(HELD_FOR),
            data_associator=self.nearest(),
            updater=self.updater,
            measurement_model=self.model,
            min_points=BEGINS_AFTER,
        )

        def detections() -> Iterator[Any]:
            while True:
                yield waiting.pop()

        if known is None:
            made = kind(initiator, UpdateTimeStepsDeleter(ENDS_AFTER), detections(), associator, self.updater)
        else:
            made = kind(_Nobody(), UpdateTimeStepsDeleter(10**9), detections(), associator, self.updater)
            since = begin + timedelta(seconds=known[1] / 1e9)
            sure = np.diag([SIGMA_M**2, KNOWN_SPEED_SIGMA_MPS**2] * 2)
            made._tracks = {
                Track([GaussianState(one, sure, timestamp=since)]) for one in known[0].T[:, [0, 2, 1, 3], None]
            }
        each = iter(made)

        def scan(plots: Plots, at: int) -> tuple[Floats, float]:
            now = begin + timedelta(seconds=at / 1e9)
            waiting.append((now, {Detection(one[:, None], timestamp=now) for one in plots.value.T}))
            began = time.process_time()
            _, tracks = next(each)
            spent_s = time.process_time() - began
            told = [np.asarray(track.state_vector, float)[[0, 2], 0] for track in tracks]
            return np.array(told).reshape(-1, 2).T, spent_s

        return scan


class _Nobody:
    """An initiator that begins nothing."""

    def initiate(self, detections: Any, timestamp: Any) -> set[Any]:
        """No track."""
        return set()


SIDES: dict[str, Callable[[float, Known | None], Tracker]] = {
    "ours": ours,
    "JPDA": joint,
    "nearest neighbour, kd-tree": nearest,
}
