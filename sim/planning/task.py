"""What is planned: from where to where, among which threats and areas, and how tightly may be turned."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim.planning.areas import Area
from sim.planning.field import LAMBDA_M4, Measures, Threats

Floats = NDArray[np.float64]

TOLERANCE_M = 15.0  # that the polyline of a route's waypoints is off its curve at most
TURN_RADIUS_M = 300.0  # 40 m/s at a bank of 28 degrees


class PlanError(ValueError):
    """No such route; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class Task:
    """A leg to plan on the level: ends (2,) m, threats, areas, and the box (2, 2), low and high corner, that it stays in.

    `aside_m`: how far it keeps from the areas' borders at least.

    `start_course`, `goal_course`: unit vectors (2,) along which it leaves and arrives, None where that is free.
    """

    start_m: Floats
    goal_m: Floats
    threats: Threats
    box_m: Floats
    areas: tuple[Area, ...] = ()
    lambda_m4: float = LAMBDA_M4
    turn_radius_m: float = TURN_RADIUS_M
    start_course: Floats | None = None
    goal_course: Floats | None = None
    aside_m: float = 0.0

    def price(self, place_m: Floats) -> Floats:
        """What a metre of the way costs at places (..., 2): 1 far from threats."""
        return 1.0 + self.lambda_m4 * self.threats.density(place_m)


@dataclass(frozen=True, slots=True)
class Route:
    """A way that was found: its points (n, 2) m, some 25 m apart, its ends the task's to the bit, and what it is worth."""

    name: str
    curve_m: Floats
    measures: Measures
    candidates: tuple[Route, ...] = field(default=(), repr=False)


def box_about(*places_m: Floats, share: float = 0.15, least_m: float = 1_000.0) -> Floats:
    """Low and high corner (2, 2) of a box about places (n, 2), wider by a share of its longer side."""
    place = np.concatenate([np.atleast_2d(one) for one in places_m])
    low, high = place.min(axis=0), place.max(axis=0)
    margin = max(share * float((high - low).max()), least_m)
    return np.stack([low - margin, high + margin])
