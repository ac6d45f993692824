"""How sure a prediction is: sigmas along and across the course that is foretold.

What is not known adds up: where it is and how fast now, what speed and course it will take, when it will turn, whether it
keeps to its way at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.two_segment import Ahead
from gateway.predict.thinking import Motions

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations (n, h) of a prediction, metres."""

    along: Floats
    across: Floats


def spread(
    now: Motions, ahead: Ahead, horizons_s: Floats, place_sigma: Floats, speed_sigma: Floats, by_points: Bools
) -> Spread:
    """Of n aircraft's predictions at horizons (n, h), by points where `by_points` (n,), else by the model of motion."""
    t = horizons_s
    speed = now.speed[:, None]
    along = place_sigma[:, None] ** 2 + (speed_sigma[:, None] ** 2 + 0.5**2) * t * t
    across = place_sigma[:, None] ** 2 + (speed_sigma[:, None] * t) ** 2
    followed = by_points[:, None]
    turned = np.abs(ahead.turned)
    along = along + np.where(followed, (3.0 * speed * np.minimum(turned, 1.0)) ** 2, 0.02 * speed * speed * t**3 / 6.0)
    across = across + np.where(
        followed, 15.0**2 + (1.0 * speed * np.minimum(turned, 1.0)) ** 2, 0.02 * speed * speed * t**3 / 3.0
    )
    return Spread(np.sqrt(along), np.sqrt(across))
