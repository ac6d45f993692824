"""Encounters: of many ways, the pairs that come near each other, when, where, how near, and how probably.

Neighbours are found by a grid in space at each time, so that a crowd costs what its neighbours cost and not its square.

Source: the probability is that of Paielli and Erzberger, Conflict probability estimation for free flight (1997): both errors
as one of the relative place, and the chance that a straight relative way leads through the protected circle. Deviation: the
chance is that of a strip as wide as the circle, bounded along the way by the time that is looked at.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.predict.ways import STEP_S, Case, Ways, at_instant, cases_at
from gateway.settings import Separation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WIDER = 1.25  # than the separation: pairs this near are told too, so that who watches them need not waver
SAME_M, SAME_MPS = 800.0, 50.0  # what a radar sees beside an aircraft, as fast as it, may be that aircraft
FASTEST_MPS = 350.0
EARTH_M = 6.37e6
_BUCKETS = 1 << 16
_AROUND = ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))  # each pair of neighbouring cells once
_WITHIN = np.linspace(-0.5, 0.5, 5) * STEP_S  # about a time of the grid


@dataclass(frozen=True, slots=True, eq=False)
class Encounters:
    """k pairs of tracks, by their numbers; the first of each pair is the smaller."""

    pair: Ints  # (k, 2)
    closest_at: Ints  # (k,) ns, when they are nearest, each distance measured by its separation
    loses_at: Ints  # (k,) when the separation is lost first; as `closest_at` where it is not
    ratio: Floats  # (k,) the greater of both distances over their separations, then; below 1 = a conflict
    horizontal_m: Floats
    vertical_m: Floats  # NaN where a height is not known: such a pair is taken to be on one level
    probability: Floats
    places: Floats  # (k, 2, 3) ENU, of both then

    def where(self, wanted: Bools | Ints) -> Encounters:
        """Some of the pairs."""
        return Encounters(*(getattr(self, one.name)[wanted] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Encounters]) -> Encounters:
        """Some encounters behind others."""
        time, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        none = cls(np.zeros((0, 2), dtype=np.int64), time, time, real, real, real, real, np.zeros((0, 2, 3)))
        return cls(*(np.concatenate([getattr(part, one.name) for part in (none, *parts)]) for one in fields(cls)))


@dataclass(frozen=True, slots=True, eq=False)
class Near:
    """Who of n tracks is near whom at some times of a grid, m of them, after an instant."""

    ways: Ways
    at: int  # ns
    times_s: Floats  # (m,)
    place: Floats  # (n, m, 3)
    velocity: Floats  # (n, m, 3)
    hits: tuple[Ints, Ints, Ints]  # as `neighbours` has them


def near_each_other(ways: Ways, at: int, separation: Separation) -> Near:
    """Who may come near whom within the time that is looked ahead from an instant: the first half of looking for encounters."""
    times_s = np.arange(0.0, separation.look_ahead_s + 1e-9, STEP_S)
    place = _level(at_instant(ways, at, times_s), ways.has_height, separation.least_height_m)
    velocity = _velocity(place)
    fastest = math.sqrt((velocity[..., 0] ** 2 + velocity[..., 1] ** 2).max(initial=0.0))
    reach_m = WIDER * separation.horizontal_m + STEP_S * min(fastest, FASTEST_MPS)
    return Near(ways, at, times_s, place, velocity, neighbours(place[..., :2], reach_m))


def encounters(near: Near, separation: Separation) -> Encounters:
    """The pairs that come nearer than 1.25 separations within the time that is looked ahead: the other half."""
    met = _met(near.ways, near.place, near.velocity, near.times_s, near.hits, separation)
    return _told(near.ways, near.at, met, near.place, near.velocity, near.times_s, separation)


def _level(place: Floats, has_height: Bools, least_height_m: float) -> Floats:
    """Places with heights above the curved ground; NaN where nobody is probed. Who has no height may be at any.

    Who is too low now is not probed later either: whether he takes off, and when, does not show before he has.
    """
    up = place[..., 2] + (place[..., 0] ** 2 + place[..., 1] ** 2) / (2.0 * EARTH_M)
    flies = (up >= least_height_m) & (up[:, :1] >= least_height_m) | ~has_height[:, None]
    return np.where(flies[..., None], np.stack([place[..., 0], place[..., 1], up], axis=-1), np.nan)


def _velocity(place: Floats) -> Floats:
    """Of places (n, g, 3) on the grid: to the next, from the last before, or between both; 0 where neither is known."""
    step = np.diff(place, axis=1) / STEP_S
    none = np.full((len(place), 1, 3), math.nan)
    onward, before = np.concatenate([step, none], axis=1), np.concatenate([none, step], axis=1)
    both = 0.5 * (onward + before)
    return np.nan_to_num(np.where(np.isnan(both), np.where(np.isnan(onward), before, onward), both))


def neighbours(place: Floats, reach_m: float) -> tuple[Ints, Ints, Ints]:
    """Rows (k,), rows (k,) and times (k,) of n points at m times (n, m, 2) that are within reach of each other; NaN = nowhere.

    Points are sorted into cells as wide as the reach and compared with those of their own and the neighbouring cells only.
    """
    n = len(place)
    east, north = (np.ascontiguousarray(place[..., axis].T).reshape(-1) for axis in (0, 1))
    there = np.flatnonzero(~np.isnan(east))
    east, north = east[there], north[there]
    time, row = there // max(n, 1), there % max(n, 1)
    cell_x, cell_y = np.floor(east / reach_m).astype(np.int64), np.floor(north / reach_m).astype(np.int64)

    def bucket(x: Ints, y: Ints) -> NDArray[np.uint16]:
        return ((time * 73856093 ^ x * 19349663 ^ y * 83492791) % _BUCKETS).astype(np.uint16)

    own = bucket(cell_x, cell_y)
    order = np.argsort(own, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(own, minlength=_BUCKETS))])
    behind = np.empty(len(order), dtype=np.int64)  # each one's place in the order, and one further
    behind[order] = np.arange(1, len(order) + 1)
    found: list[tuple[Ints, Ints]] = []
    for step_x, step_y in _AROUND:
        there_too = bucket(cell_x + step_x, cell_y + step_y).astype(np.int64)
        first = behind if step_x == step_y == 0 else starts.take(there_too)
        counts = starts.take(there_too + 1) - first
        some = np.flatnonzero(counts)
        first, counts = first.take(some), counts.take(some)
        one = np.repeat(some, counts)
        other = order.take(np.arange(len(one)) + np.repeat(first - np.cumsum(counts) + counts, counts))
        d_east, d_north = east.take(other) - east.take(one), north.take(other) - north.take(one)
        close = np.flatnonzero(d_east * d_east + d_north * d_north < reach_m * reach_m)
        one, other = one[close], other[close]
        near = (time[other] == time[one]) & (
            cell_x[other] - cell_x[one] == step_x
        )  # cells that share a bucket are apart
        near &= cell_y[other] - cell_y[one] == step_y
        found.append((one[near], other[near]))
    one, other = (np.concatenate([part[side] for part in found]) for side in (0, 1))
    return np.minimum(row[one], row[other]), np.maximum(row[one], row[other]), time[one]


@dataclass(frozen=True, slots=True, eq=False)
class _Met:
    """Pairs, k of them: rows, and when they are nearest and lose separation, s from now; distances then."""

    first: Ints
    second: Ints
    grid: Ints  # the nearest time of the grid
    after_s: Floats  # and how long after it
    loses_s: Floats
    ratio: Floats
    rank: Floats  # the least is the nearest instant


def _met(
    ways: Ways,
    place: Floats,
    velocity: Floats,
    times_s: Floats,
    hits: tuple[Ints, Ints, Ints],
    separation: Separation,
) -> _Met:
    """Of each pair that is near at some times its nearest instant, between the grid's times straight on."""
    first, second, grid = hits
    one, other = first * len(times_s) + grid, second * len(times_s) + grid
    flat, rate = place.reshape(-1, 3), velocity.reshape(-1, 3)
    x, y, z = (flat[:, axis].take(other) - flat[:, axis].take(one) for axis in range(3))
    dx, dy, dz = (rate[:, axis].take(other) - rate[:, axis].take(one) for axis in range(3))
    unknown = ~(ways.has_height.take(first) & ways.has_height.take(second))
    z[unknown], dz[unknown] = 0.0, 0.0
    abeam_s = np.clip(-(x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-9), _WITHIN[0], _WITHIN[-1])
    passes = (x + abeam_s * dx) ** 2 + (y + abeam_s * dy) ** 2 < (WIDER * separation.horizontal_m) ** 2
    passes &= np.abs(z) < WIDER * separation.vertical_m + 0.5 * STEP_S * np.abs(dz)
    if not ways.reported.all():
        passes &= ~_same(ways, place, velocity, first, second)
    near = np.flatnonzero(passes)
    first, second, grid, abeam_s = first[near], second[near], grid[near], abeam_s[near]
    way, drift = np.stack([x[near], y[near], z[near]]), np.stack([dx[near], dy[near], dz[near]])
    after_s = np.concatenate([abeam_s[:, None], np.broadcast_to(_WITHIN, (len(near), len(_WITHIN)))], axis=1)
    after_s = np.maximum(after_s, -times_s[grid][:, None])
    then = way[:, :, None] + after_s * drift[:, :, None]
    level_share = np.sqrt(then[0] * then[0] + then[1] * then[1]) / separation.horizontal_m
    ratio = np.maximum(level_share, np.abs(then[2]) / separation.vertical_m)
    rank = np.where(ratio < 1.0, level_share, 1.0 + ratio)  # of those that lose separation, where they pass each other
    best = rank.argmin(axis=1)
    rows = np.arange(len(near))
    lost_s = np.where(ratio < 1.0, times_s[grid][:, None] + after_s, math.inf).min(axis=1, initial=math.inf)
    return _one_each(
        _Met(first, second, grid, after_s[rows, best], lost_s, ratio[rows, best], rank[rows, best]), len(place)
    )


def _one_each(met: _Met, count: int) -> _Met:
    """The nearest instant of each pair of so many tracks, and when it first loses separation; only of pairs that come near."""
    near = np.flatnonzero(met.ratio < WIDER)
    pair = (met.first * count + met.second)[near]
    order = np.lexsort((met.rank[near], pair))  # stable: of equal ones the earliest hit, which is the earliest time
    near, pair = near[order], pair[order]
    begins = np.flatnonzero(np.append(True, pair[1:] != pair[:-1])[: len(order)])
    loses_s = np.minimum.reduceat(met.loses_s[near], begins) if len(begins) else np.zeros(0)
    one = near[begins]
    return _Met(
        met.first[one], met.second[one], met.grid[one], met.after_s[one], loses_s, met.ratio[one], met.rank[one]
    )


def _same(ways: Ways, place: Floats, velocity: Floats, first: Ints, second: Ints) -> Bools:
    """Which pairs may be one thing, which a radar sees and which speaks of itself, not known to be one yet."""
    way, drift = place[second, 0] - place[first, 0], velocity[second, 0] - velocity[first, 0]
    beside = (way[:, 0] ** 2 + way[:, 1] ** 2 < SAME_M**2) & (drift[:, 0] ** 2 + drift[:, 1] ** 2 < SAME_MPS**2)
    return np.asarray(beside & ~(ways.reported[first] & ways.reported[second]))


def _told(
    ways: Ways, at: int, met: _Met, place: Floats, velocity: Floats, times_s: Floats, separation: Separation
) -> Encounters:
    """What is told of each pair."""
    closest_s = times_s[met.grid] + met.after_s
    closest_at = at + np.rint(closest_s * SECOND).astype(np.int64)
    loses_s = np.where(np.isinf(met.loses_s), closest_s, met.loses_s)
    there = [
        place[rows, met.grid] + met.after_s[:, None] * velocity[rows, met.grid] for rows in (met.first, met.second)
    ]
    way, drift = there[1] - there[0], velocity[met.second, met.grid] - velocity[met.first, met.grid]
    level = ways.has_height[met.first] & ways.has_height[met.second]
    one, up_one = cases_at(ways, met.first, closest_at)
    two, up_two = cases_at(ways, met.second, closest_at)
    chance = _chance_of_all(way[:, :2], drift[:, :2], one, two, closest_s, separation)
    above = _normal(way[:, 2], np.sqrt(up_one + up_two), -separation.vertical_m, separation.vertical_m)
    for side in there:  # back into the frame that is flat
        side[:, 2] -= (side[:, 0] ** 2 + side[:, 1] ** 2) / (2.0 * EARTH_M)
    return Encounters(
        np.stack([ways.track[met.first], ways.track[met.second]], axis=-1),
        closest_at,
        at + np.rint(loses_s * SECOND).astype(np.int64),
        met.ratio,
        np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2),
        np.where(level, np.abs(way[:, 2]), np.nan),
        chance * np.where(level, above, 1.0),
        np.stack(there, axis=1),
    )


def _chance_of_all(
    way: Floats, drift: Floats, one: Sequence[Case], two: Sequence[Case], closest_s: Floats, separation: Separation
) -> Floats:
    """As `_chance`, whichever of some things each of both does."""
    chance = np.zeros(len(way))
    for first, second in product(one, two):
        probability = first.probability * second.probability
        some = np.flatnonzero(probability)
        covariance = first.covariance[some] + second.covariance[some]
        chance[some] += probability[some] * _chance(way[some], drift[some], covariance, closest_s[some], separation)
    return chance


def _chance(way: Floats, drift: Floats, covariance: Floats, closest_s: Floats, separation: Separation) -> Floats:
    """How probably (k,) relative ways that lead from (k, 2) on with (k, 2) m/s come within the separation."""
    speed = np.sqrt(drift[:, 0] ** 2 + drift[:, 1] ** 2)
    distance = np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2)
    slow = speed < 1.0  # then the way to each other is as good a direction as any
    ahead = np.where(slow[:, None], way / np.maximum(distance, 1e-9)[:, None], drift / np.maximum(speed, 1e-9)[:, None])
    x, y = ahead[:, 0], ahead[:, 1]
    xx, xy, yy = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    along = np.sqrt(xx * x * x + 2.0 * xy * x * y + yy * y * y)
    across = np.sqrt(xx * y * y - 2.0 * xy * x * y + yy * x * x)
    r = separation.horizontal_m
    passes = _normal(way[:, 1] * x - way[:, 0] * y, across, -r, r)
    left_s = separation.look_ahead_s - closest_s
    return passes * _normal(way[:, 0] * x + way[:, 1] * y, along, -r - speed * left_s, r + speed * closest_s)


def _normal(mean: Floats, sigma: Floats, low: Floats | float, high: Floats | float) -> Floats:
    """The probability (k,) that a normal variable is between two bounds."""
    scale = math.sqrt(2.0) * np.maximum(sigma, 1e-3)
    return 0.5 * (_erf((high - mean) / scale) - _erf((low - mean) / scale))


def _erf(values: Floats) -> Floats:
    """The error function to 1.5e-7. Source: Abramowitz and Stegun, 7.1.26."""
    size = np.abs(values)
    t = 1.0 / (1.0 + 0.3275911 * size)
    series = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
    return np.asarray(np.copysign(1.0 - series * np.exp(-size * size), values))
