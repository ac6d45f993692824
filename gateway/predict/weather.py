"""Areas of weather: a candidate whose way leads through one counts less, and points around it are candidates themselves.

Source: 000 2.2, candidates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.geodesy import wrap_rad
from gateway.predict.goals import AROUND, LEGS, Goals
from gateway.predict.states import State
from gateway.predict.told import Tellings
from gateway.settings import Site, Weather
from gateway.settings.instants import instant_ns

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LOWERED = 0.1  # of its weight keeps a candidate behind an area
WIDER = 1.1  # points around an area are so much farther from its middle than its corners
CLEAR_S = 10.0  # and so far beyond that, at the ground speed
CORNERS = 24  # of a circle


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """An area as the convex polygon about it, east and north (k, 2), counter-clockwise; heights above the runway's plane."""

    name: str
    hull: Floats
    base_m: float
    top_m: float


def areas(tellings: Tellings, site: Site, frame: RunwayFrame, at: int, separation_m: float) -> tuple[Area, ...]:
    """The areas that hold at an instant: the site's, and those told since, which take the place of one of their name."""
    known = {area.name: area for area in site.weather}
    for name, told in tellings.weather.items():
        if told.area is None:
            known.pop(name, None)
        else:
            known[name] = told.area
    return tuple(_area(one, frame, separation_m) for one in known.values() if _holds(one, at))


def _holds(area: Weather, at: int) -> bool:
    begins = None if area.valid_from is None else instant_ns(area.valid_from)
    ends = None if area.valid_until is None else instant_ns(area.valid_until)
    return (begins is None or begins <= at) and (ends is None or at < ends)


@lru_cache(maxsize=256)
def _area(area: Weather, frame: RunwayFrame, separation_m: float) -> Area:
    """An area seldom changes, and is asked for in every round."""
    ground = frame.runway.height_m

    def height(above_sea_m: float | None, otherwise: float) -> float:
        return otherwise if above_sea_m is None else above_sea_m + separation_m - ground

    if area.latitude_rad is not None and area.longitude_rad is not None:
        centre = frame.enu_from_geodetic(area.latitude_rad, area.longitude_rad, ground)[:2]
        angle = np.arange(CORNERS) * (2.0 * math.pi / CORNERS)
        radius = (area.radius_m or 0.0) / math.cos(math.pi / CORNERS)
        corners = centre + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    else:
        latitude, longitude = np.array(area.polygon_rad).T
        corners = frame.enu_from_geodetic(latitude, longitude, np.full(len(latitude), ground))[:, :2]
    return Area(area.name, hull(corners), height(area.base_msl_m, -math.inf), height(area.top_msl_m, math.inf))


def hull(points: Floats) -> Floats:
    """The convex hull (k, 2), counter-clockwise, of points (n, 2) that enclose an area. Andrew's monotone chain: SciPy, whose
    hull it could be, is not loaded while a session runs.
    """
    ordered = sorted({(float(x), float(y)) for x, y in points.tolist()})
    sides: list[list[tuple[float, float]]] = []
    for run in (ordered, ordered[::-1]):
        side: list[tuple[float, float]] = []
        for x, y in run:
            while len(side) > 1 and _left(side[-2], side[-1], (x, y)) <= 0.0:
                side.pop()
            side.append((x, y))
        sides.append(side[:-1])
    return np.array(sides[0] + sides[1])


def _left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """How far c is to the left of the line from a to b, times its length."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def crosses(start: Floats, end: Floats, corners: Floats) -> Bools:
    """Whether the ways (n,) from points (n, 2) to others (n, 2) lead into a convex polygon (k, 2); NaN, or begun inside: no.

    Cyrus and Beck: the way's part inside all edges.
    """
    edge = np.roll(corners, -1, axis=0) - corners
    inward = np.stack([-edge[:, 1], edge[:, 0]], axis=-1)
    way = end - start
    rate = way[:, None, 0] * inward[:, 0] + way[:, None, 1] * inward[:, 1]
    depth = (start[:, None, 0] - corners[:, 0]) * inward[:, 0] + (start[:, None, 1] - corners[:, 1]) * inward[:, 1]
    share = -depth / np.where(rate == 0.0, 1.0, rate)
    enters = np.where(rate > 0.0, share, -math.inf).max(axis=1)
    leaves = np.where(rate < 0.0, share, math.inf).min(axis=1)
    apart = ((rate == 0.0) & (depth < 0.0)).any(axis=1)
    return np.asarray(~apart & (enters > 0.0) & (enters < np.minimum(leaves, 1.0)))


def around(goals: Sequence[Goals], state: State, found: Sequence[Area]) -> list[Goals]:
    """The goals of n aircraft with what the areas make of them."""
    if not found:
        return list(goals)
    first = np.stack([one.route[:, 0] for one in goals])
    n, count = first.shape[:2]
    start = np.repeat(state.position, count, axis=0)
    through = np.stack([crosses(start, first.reshape(-1, 2), area.hull).reshape(n, count) for area in found])
    known = state.has_height
    for place, area in enumerate(found):
        inside = (state.up >= area.base_m) & (state.up <= area.top_m)
        through[place] &= (inside | ~known)[:, None]
    made = []
    for row, one in enumerate(goals):
        blocked = np.asarray(through[:, row].any(axis=0))
        if blocked.any():
            one = _around(one, row, state, found, through[:, row], blocked)
        made.append(one)
    return made


def _around(goals: Goals, row: int, state: State, found: Sequence[Area], through: Bools, blocked: Bools) -> Goals:
    """One aircraft's goals, with two ways around the area that lies nearest before the point that it most likely goes to."""
    position, velocity = state.position[row], state.velocity[row]
    to_goal = _towards(goals.route[:, 0] - position) - math.atan2(velocity[1], velocity[0])
    off = np.where(blocked, np.abs(wrap_rad(np.nan_to_num(to_goal))), math.inf)
    slot = goals.declared if goals.declared >= 0 and blocked[goals.declared] else int(off.argmin())
    behind = [area for area, crossed in zip(found, through[:, slot].tolist(), strict=True) if crossed]
    area = min(behind, key=lambda one: float(np.linalg.norm(one.hull.mean(axis=0) - position)))
    route, up = goals.route.copy(), goals.up.copy()
    names = list(goals.names)
    planned = goals.planned.copy()
    clear_m = CLEAR_S * float(state.speed[row])
    for place, side, word in zip(AROUND, (1.0, -1.0), ("left", "right"), strict=True):
        corners = _corners(position, goals.route[slot, 0], area, side, clear_m)
        then = goals.route[slot, : LEGS - len(corners)]
        route[place] = np.concatenate([corners, then])
        up[place] = np.concatenate([np.full(len(corners), math.nan), goals.up[slot, : len(then)]])
        names[place], planned[place] = f"round {area.name}, {word}", goals.planned[slot]
    return replace(
        goals,
        route=route,
        up=up,
        names=tuple(names),
        planned=planned,
        lowered=np.where(blocked, LOWERED, 1.0),
    )


def _corners(start: Floats, end: Floats, area: Area, side: float, clear_m: float) -> Floats:
    """The one or two corners (c, 2) of a way from one point to another that leaves an area to one side, 1 = flies to its left."""
    centre = area.hull.mean(axis=0)
    out = area.hull - centre
    away = np.sqrt((out * out).sum(axis=1))
    wide = centre + out * ((WIDER * away + clear_m) / np.maximum(away, 1.0))[:, None]
    middle = math.atan2(centre[1] - start[1], centre[0] - start[0])
    leaves = int((side * wrap_rad(_towards(wide - start) - middle)).argmax())
    back = math.atan2(centre[1] - end[1], centre[0] - end[0])
    arrives = int((-side * wrap_rad(_towards(wide - end) - back)).argmax())
    return np.asarray(wide[[leaves]] if leaves == arrives else wide[[leaves, arrives]])


def _towards(way: Floats) -> Floats:
    return np.arctan2(way[..., 1], way[..., 0])
