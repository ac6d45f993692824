"""Pairs of aircraft that lose their separation, one after another, in six ways: head-on, crossing, nearly
abreast, overtaking, climbing through a level, and after a turn that ends 95 s before."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gateway.settings import Site
from sim.routes import RoutePath, RoutePoint
from sim.sensors import stream

BEFORE_S, AFTER_S = 240.0, 90.0  # that the aircraft of a pair fly before and after they meet
FIRST_S = 180.0
GOLDEN_RAD = math.pi * (3.0 - math.sqrt(5.0))
TURNED_S = 95.0


@dataclass(frozen=True, slots=True)
class _Meeting:
    """How two aircraft meet: courses against each other, their speeds, the climb of the second, and whether that one turns."""

    name: str
    angle_rad: float
    first_mps: float
    second_mps: float
    climb_mps: float = 0.0
    turns: bool = False


_MEETINGS = (
    _Meeting("head-on", math.pi, 90.0, 75.0),
    _Meeting("crossing", 0.5 * math.pi, 80.0, 95.0),
    _Meeting("abreast", math.radians(30.0), 85.0, 85.0),
    _Meeting("overtaking", 0.0, 65.0, 110.0),
    _Meeting("climbing", math.radians(110.0), 90.0, 80.0, climb_mps=4.0),
    _Meeting("turning", math.radians(140.0), 80.0, 80.0, turns=True),
)


def conflicts(site: Site, count: int, duration_s: float, seed: int) -> list[tuple[str, RoutePath]]:
    """Words and ways: aircraft 1 and 2, 3 and 4, ... meet one after another, each pair on a level of its own."""
    pairs = count // 2
    spacing_s = (duration_s - FIRST_S - AFTER_S) / max(pairs - 1, 1)
    found = []
    for index in range(pairs):
        how = _MEETINGS[index % len(_MEETINGS)]
        one, other = _pair(site, how, index, FIRST_S + spacing_s * index, stream(seed, "conflicts", index))
        found += [(how.name, one), (how.name, other)]
    return found


def _pair(
    site: Site, how: _Meeting, index: int, meets_s: float, chance: np.random.Generator
) -> tuple[RoutePath, RoutePath]:
    """Two ways whose aircraft pass each other at an instant, well within the separation."""
    miss_m = site.separation.horizontal_m * chance.uniform(0.0, 0.6)
    apart_m = site.separation.vertical_m * chance.uniform(-0.5, 0.5)
    distance, bearing = chance.uniform(15e3, 35e3), GOLDEN_RAD * index
    place = np.array([distance * math.cos(bearing), distance * math.sin(bearing)])
    height, course = 1_200.0 + 450.0 * (index % 9), chance.uniform(0.0, 2.0 * math.pi)
    aside = miss_m * np.array([-math.sin(course), math.cos(course)])
    one = _way(place, height, course, how.first_mps, meets_s)
    side = chance.choice((-1.0, 1.0))
    second = replace(how, turns=False), course + side * how.angle_rad
    other = _way(
        place + aside, height + apart_m, second[1], how.second_mps, meets_s, how.climb_mps, side if how.turns else 0.0
    )
    return one, other


def _way(
    place: np.ndarray[tuple[int], np.dtype[np.float64]],
    height_m: float,
    course: float,
    speed_mps: float,
    meets_s: float,
    climb_mps: float = 0.0,
    turns: float = 0.0,
) -> RoutePath:
    """Straight through a place at an instant; with a turn, to the left or right, some time before it."""
    along = np.array([math.cos(course), math.sin(course)])

    def point(at_s: float, aside: np.ndarray[tuple[int], np.dtype[np.float64]] | float = 0.0) -> RoutePoint:
        x, y = place + along * speed_mps * at_s + aside
        return RoutePoint(float(x), float(y), height_m + climb_mps * max(at_s, -BEFORE_S), speed_mps)

    if not turns:
        path = RoutePath([point(-BEFORE_S), point(0.0), point(AFTER_S)])
        return path.starting_at(meets_s - float(path.passes_s[1]))
    corner = -TURNED_S - 15.0  # a turn by 60 degrees takes half a minute
    back = course + turns * math.radians(60.0)
    before = -(BEFORE_S + corner) * speed_mps * np.array([math.cos(back), math.sin(back)])
    path = RoutePath([point(corner, before), point(corner), point(0.0), point(AFTER_S)])
    return path.starting_at(meets_s - float(path.passes_s[2]))
