"""Many aircraft about one runway. Straight-in arrivals, circuits from both sides, crossings,
holdings and
go-arounds, in turn; landings follow one another in time slots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gateway.settings import Runway, Site
from sim.routes import RoutePath, RoutePoint
from sim.sensors import stream

FINAL_M = 13_000.0  # from where the glide path meets the runway to where the final begins
JOIN_M = 22_000.0
BASE_M = 20_000.0
ABEAM_M = 8_000.0  # downwind legs run so far beside the centreline
APPROACH_MPS, PLATFORM_MPS, FAST_MPS = 70.0, 85.0, 110.0
FIRST_SLOT_S = 150.0
AFTER_END_S = 400.0  # slots reach this far beyond the scene, so that it also ends with aircraft inbound
ROLL_OUT_M, TAXI_MPS = 1_500.0, 15.0
CLIMB_MPS = 90.0
ALONE_S = 300.0  # between slots, for one that has no others about it
LEVEL_M = 300.0  # between holding levels, and between crossings


def traffic(site: Site, count: int, duration_s: float, seed: int) -> list[tuple[str, RoutePath]]:
    """Words for so many aircraft about one runway, and their ways, spread over a scene's duration; each has a random
    stream of its own."""
    kinds = [_KINDS[index % len(_KINDS)] for index in range(count)]
    slots = sum(kind.slot_point is not None for kind in kinds)
    spacing_s = (duration_s + AFTER_END_S - FIRST_SLOT_S) / max(slots, 1)
    found, slot_s = [], FIRST_SLOT_S
    for index, kind in enumerate(kinds):
        path = kind.make(_Wish(site.runway, index // len(_KINDS), stream(seed, "traffic", index), spacing_s))
        if kind.slot_point is None:
            start_s = (index * 0.37 % 1.0 - 0.5) * path.flown_s  # some before, some after the scene begins
        else:
            start_s = slot_s - float(path.passes_s[kind.slot_point])
            slot_s += spacing_s
        found.append((kind.name, path.starting_at(start_s)))
    return found


def one_of_the_traffic(word: str, site: Site, seed: int, system: int) -> RoutePath:
    """The way of one aircraft that does what a word says, such as "holding"; it sets out at second 0."""
    return _WORDS[word].make(_Wish(site.runway, system - 1, stream(seed, "vehicle", system), ALONE_S))


@dataclass(frozen=True, slots=True)
class _Wish:
    """What a route is made for: the runway, the how-many-th of its kind, its chance, and the time between slots."""

    runway: Runway
    turn: int
    chance: np.random.Generator
    spacing_s: float

    @property
    def side(self) -> float:
        """+1 left of the landing direction, -1 right, by turns."""
        return -1.0 if self.turn % 2 else 1.0

    @property
    def aim_m(self) -> float:
        """Where the glide path meets the runway."""
        return self.runway.aiming_point_x_m

    @property
    def slope(self) -> float:
        """Of the glide path."""
        return math.tan(self.runway.glide_path_rad)


def _inbound(wish: _Wish) -> list[RoutePoint]:
    """Onto the centreline, and the beginning of the final."""
    height = FINAL_M * wish.slope
    join = RoutePoint(wish.aim_m - JOIN_M, 0.0, height, 95.0)
    return [join, RoutePoint(wish.aim_m - FINAL_M, 0.0, height, PLATFORM_MPS)]


def _landing(wish: _Wish) -> list[RoutePoint]:
    """From within the final down the glide path, and off the runway; the last but one point is on the runway."""
    aim = wish.aim_m
    return [
        RoutePoint(aim - 4_000.0, 0.0, 4_000.0 * wish.slope, APPROACH_MPS),
        RoutePoint(aim, 0.0, 0.0, APPROACH_MPS),
        RoutePoint(aim + ROLL_OUT_M, 0.0, 0.0, TAXI_MPS),
    ]


def _circuit(wish: _Wish) -> list[RoutePoint]:
    """From downwind over base onto the final and down."""
    base_x, height = wish.aim_m - BASE_M, FINAL_M * wish.slope
    return [
        RoutePoint(base_x, wish.side * ABEAM_M, height, PLATFORM_MPS),
        RoutePoint(base_x, 0.0, height, PLATFORM_MPS),
        RoutePoint(wish.aim_m - FINAL_M, 0.0, height, PLATFORM_MPS),
        *_landing(wish),
    ]


def _outer(distance_m: float, bearing_rad: float, height_m: float) -> RoutePoint:
    """A point before the runway, the bearing counted from the extended centreline, positive to its left."""
    x_m, y_m = -distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad)
    return RoutePoint(x_m, y_m, height_m, FAST_MPS)


def _straight_in(wish: _Wish) -> RoutePath:
    """From 55 to 60 km out, up to 11 degrees off the centreline, onto it at 22 km."""
    start = _outer(wish.chance.uniform(55e3, 60e3), wish.chance.uniform(-0.2, 0.2), 2_400.0)
    return RoutePath([start, *_inbound(wish), *_landing(wish)])


def _past_the_runway(wish: _Wish) -> RoutePath:
    """From beyond the runway, past it on one side, and around onto the final."""
    start_y = wish.side * wish.chance.uniform(9e3, 14e3)
    start = RoutePoint(wish.chance.uniform(25e3, 32e3), start_y, 1_800.0, FAST_MPS)
    abeam = RoutePoint(0.0, wish.side * ABEAM_M, 1_200.0, 95.0)
    return RoutePath([start, abeam, *_circuit(wish)])


def _crossing(wish: _Wish) -> RoutePath:
    """From one side to the other over the field, well above the others, with one bend."""
    bearing, bend_m = wish.chance.uniform(0.0, 2.0 * math.pi), wish.chance.uniform(-8e3, 8e3)
    height = 2_700.0 + LEVEL_M * (wish.turn % 12)
    across = np.array([math.cos(bearing), math.sin(bearing)])
    beside = np.array([-across[1], across[0]])
    ends = [-58e3 * across, -12e3 * across + bend_m * beside, 58e3 * across]
    return RoutePath([RoutePoint(float(end[0]), float(end[1]), height, 125.0) for end in ends])


def _holding(wish: _Wish) -> RoutePath:
    """Two race-tracks over a fix beside the approach, on a level of its own, then an approach."""
    side, height = wish.side, 1_200.0 + LEVEL_M * (wish.turn // 2 % 4)
    fix_x = wish.aim_m - 30e3 - wish.chance.uniform(0.0, 2e3)
    corners = [(0.0, 9e3), (-9e3, 9e3), (-9e3, 15e3), (0.0, 15e3)]
    laps = [RoutePoint(fix_x + x, side * y, height, 95.0) for x, y in corners * 2]
    start = RoutePoint(fix_x + 12e3, side * 12e3, height, FAST_MPS)
    leave = RoutePoint(fix_x - 6e3, side * 7e3, height, 95.0)
    return RoutePath([start, *laps, leave, *_inbound(wish), *_landing(wish)])


def _go_around(wish: _Wish) -> RoutePath:
    """An approach broken off at 80 m, a climb straight ahead, a circuit, and a landing between two slots."""
    start = _outer(wish.chance.uniform(45e3, 50e3), wish.chance.uniform(-0.2, 0.2), 2_000.0)
    low = RoutePoint(wish.aim_m - 80.0 / wish.slope, 0.0, 80.0, APPROACH_MPS)

    def route(further_m: float) -> RoutePath:
        away_m = wish.aim_m + 7e3 + further_m
        climb = RoutePoint(away_m, 0.0, 800.0, CLIMB_MPS)
        crosswind = RoutePoint(away_m, wish.side * ABEAM_M, 1_000.0, CLIMB_MPS)
        return RoutePath([start, *_inbound(wish), low, climb, crosswind, *_circuit(wish)])

    shortest = route(0.0)
    again_s = float(shortest.passes_s[-2] - shortest.passes_s[_LOW_POINT])
    wait_s = (0.5 * wish.spacing_s - again_s) % wish.spacing_s
    return route(0.5 * wait_s * CLIMB_MPS)  # out and back


@dataclass(frozen=True, slots=True)
class _Kind:
    """What aircraft do in turn: a word for it, its route, and the point of the route that a slot is kept for."""

    name: str
    make: Callable[[_Wish], RoutePath]
    slot_point: int | None


_ON_RUNWAY, _LOW_POINT = -2, 3
_KINDS = (
    _Kind("straight-in", _straight_in, _ON_RUNWAY),
    _Kind("circuit", _past_the_runway, _ON_RUNWAY),
    _Kind("crossing", _crossing, None),
    _Kind("go-around", _go_around, _LOW_POINT),
    _Kind("holding", _holding, _ON_RUNWAY),
)
_WORDS = {kind.name: kind for kind in _KINDS}
TRAFFIC_WORDS = tuple(_WORDS)
