"""Points of a route that are flown round, as missions' loiters are: where their circles are entered, and for how long flown.

Deviation: 000 2.3 knows only points that are flown to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.turns_and_straights import FULL_TURN, Path, angle_to_go, or_zero
from gateway.geodesy import wrap_rad

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ON_CIRCLE = 1.3  # radii: who is this near to a circle's middle is on it
ALONG_RAD = 0.35  # who is on a circle and flies so much elsewhere than along it is just coming to it
FOR_GOOD_RAD = 1000.0
QUARTERS, QUARTER_RAD = 8, 0.5 * math.pi  # of a circle: two turns, and all that is left at once


@dataclass(frozen=True, slots=True)
class Circles:
    """Which of n routes' p points are flown round: radius (n, p), positive to the left, NaN = it is flown by; how far (n, p).

    `least` is the angle after which it is left, as soon as the course points at the next point; infinite = never.
    """

    radius: Floats
    least: Floats


def entered(path: Path, point: Floats, circles: Circles | None, leg: int, bend_m: Floats) -> tuple[Floats, Bools]:
    """What a leg is flown at (n, 2): its point, or where its circle is entered; and who (n,) is on that circle already."""
    if circles is None:
        return point, np.zeros(len(point), dtype=np.bool_)
    radius = np.abs(circles.radius[:, leg])
    way = point - path.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    round_it = ~np.isnan(radius)
    arrived = round_it & (distance <= ON_CIRCLE * radius)
    # flown at the middle, as autopilots do, until a turn to the other side leads onto the circle
    begins = np.sqrt(radius * radius + 2.0 * radius * bend_m)
    share = np.maximum(1.0 - begins / np.maximum(distance, 1e-9), 0.0)
    return np.where((round_it & ~arrived)[:, None], path.position + share[:, None] * way, point), arrived


def go_round(
    path: Path,
    circles: Circles,
    leg: int,
    following: Floats,
    arrived: Bools,
    turning_rps: Floats,
    speed_on: Callable[[Floats], Floats],
) -> None:
    """Onto a leg's circle, where it has one, and round it until the next point is ahead and the least angle is flown.

    In quarters, each at the ground speed of its middle.
    """
    radius = circles.radius[:, leg]
    round_it = ~np.isnan(radius)
    if not round_it.any():
        return
    _bend(path, following[:, leg], radius, leg, arrived, turning_rps, speed_on(path.course))
    way = following[:, leg] - path.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    near = (distance > 0.5 * np.abs(radius)) & (distance <= ON_CIRCLE * np.abs(radius))
    size = np.where(near, distance, np.abs(radius))  # who is on it stays at the distance that he has
    size, side = np.where(round_it, size, 1.0), np.sign(np.where(round_it, radius, 1.0))
    go = or_zero(angle_to_go(path.position, path.course, size, side, following[:, leg + 1]))
    least = np.minimum(np.where(round_it, circles.least[:, leg], 0.0), FOR_GOOD_RAD)
    go = go + FULL_TURN * np.ceil(np.maximum(least - go, 0.0) / FULL_TURN)
    last = (following[:, leg + 1] == following[:, leg]).all(axis=1)
    go = np.where(round_it, np.where(last, FOR_GOOD_RAD, go), 0.0)
    for quarter in range(QUARTERS):
        arc = np.minimum(go, QUARTER_RAD) if quarter + 1 < QUARTERS else go
        ground = speed_on(path.course + 0.5 * side * np.minimum(arc, QUARTER_RAD))
        path.extend(ground, np.where(round_it, side * ground / size, 0.0), arc * size / ground, leg)
        go = go - arc


def _bend(
    path: Path, centre: Floats, radius: Floats, leg: int, arrived: Bools, turning_rps: Floats, ground: Floats
) -> None:
    """Who flew at the middle (n, 2) of a circle of a radius (n,), NaN = nobody does, turns aside until it flies along the circle.

    Who has arrived at it but does not fly along it yet turns until it does.
    """
    round_it = ~np.isnan(radius)
    own = ground / turning_rps
    size, side = np.where(round_it, np.abs(radius), 0.0), np.sign(np.where(round_it, radius, 1.0))
    aside = -side * np.arctan2(np.sqrt(size * size + 2.0 * size * own), own)
    way = centre - path.position
    along = np.arctan2(way[:, 1], way[:, 0]) - 0.5 * math.pi * side
    off = or_zero(wrap_rad(along - path.course))
    angle = np.where(arrived, np.where(np.abs(off) > ALONG_RAD, off, 0.0), aside)
    angle = np.where(round_it, angle, 0.0)
    path.extend(ground, np.sign(angle) * turning_rps, np.abs(angle) / turning_rps, leg)
