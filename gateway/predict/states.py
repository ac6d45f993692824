"""Where tracks are when they are predicted: their last states, brought to the instant."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.fuse import Lane, knows_height
from gateway.fuse.weighting import Model

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Some tracks' states: where they were last, and at the instant."""

    since_s: Floats  # (n,) since the last state
    at_position: Floats  # (n, 2) then
    position: Floats  # (n, 2) now
    velocity: Floats
    speed: Floats
    up: Floats  # (n,) then
    climb: Floats
    up_sigma: Floats  # of where it is as its position source will say it, like `place_sigma`
    climb_sigma: Floats
    place_sigma: Floats  # (n,)
    velocity_sigma: Floats
    sides: Floats  # (n, 3)
    has_height: Bools

    @classmethod
    def of(cls, lanes: Sequence[Lane], at: int, model: Model) -> State:
        """The tracks' last states, brought to an instant straight on."""
        events = [lane.last for lane in lanes]
        mean = np.array([event.mean for event in events])
        covariance = np.array([event.covariance for event in events])
        since_s = np.maximum(at - np.array([event.at for event in events], dtype=np.int64), 0) / SECOND
        velocity = mean[:, 3:5]
        variance = np.maximum(covariance[:, range(9), range(9)], 0.0)
        sides = np.full((len(lanes), 3), math.nan)
        if model.modes is not None:
            weight = np.array([event.mixture.weight[0] for event in events if event.mixture is not None])
            sides = model.modes.directions(weight)
        return cls(
            since_s,
            mean[:, :2],
            mean[:, :2] + since_s[:, None] * velocity,
            velocity,
            np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1]),
            mean[:, 2],
            mean[:, 5],
            _reported_sigma(covariance, (2,)),
            np.sqrt(variance[:, 5]),
            _reported_sigma(covariance, (0, 1)),
            np.sqrt(0.5 * (variance[:, 3] + variance[:, 4])),
            sides,
            knows_height(events, [at] * len(events), covariance),
        )


def _reported_sigma(covariance: Floats, of_axes: Sequence[int]) -> Floats:
    """Sigma (n,) an axis of where a track is as its position source will say it: the source's own error stays the same."""
    axes = np.array(of_axes)
    error = 2.0 * covariance[:, axes, axes + 6] + covariance[:, axes + 6, axes + 6]
    return np.asarray(np.sqrt(np.maximum((covariance[:, axes, axes] + error).mean(axis=1), 0.0)))
