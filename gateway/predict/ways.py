"""Ways: the predictions of some tracks as paths on one grid of times, with their sigmas, for who compares paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.two_segment import Ahead
from gateway.frames import RunwayFrame, turn
from gateway.predict.spread import Spread
from gateway.predict.states import State
from gateway.predict.thinking import STALE_S, TURNS_RAD, Motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

STEP_S = 5.0  # of the grid
FREE_TURN_RAD = math.radians(60.0)  # a turn of which nobody knows where it ends is followed no further
FINAL_M = (2_000.0, 40_000.0)  # before the aiming point a final is joined
ABOVE_GLIDE_PATH_M = 150.0  # from no higher than this
CROSSES = math.tan(math.radians(20.0))  # at more than this angle it is crossed, and not flown along
MOST_TURNED_RAD = 5.0  # between two points of a path; who turns further is drawn through the middle of its circle
LEVELS_OFF, CLIMBS_MPS = 0.2, 0.3  # a climb may change by this share of it, and who is level may begin to climb
# Straight flight goes on for so long in the mean, however long it has lasted; meanwhile it is so far beside its line, and
# the square of how late it is grows so with the cube of the time. Measured on arrivals to Paris: docs/papers/000-intent.md.
STRAIGHT_S, KEEPS_RAD, SLOWS = 300.0, 0.02, 3e-5


@dataclass(frozen=True, slots=True, eq=False)
class Ways:
    """n tracks, and g times at a distance of `STEP_S`, the first when they were made."""

    track: Ints  # (n,)
    made: Ints  # (n,) ns
    place: Floats  # (n, g, 3) ENU; NaN from where on nobody can know
    course: Floats  # (n, g) from east to north
    along: Floats  # (n, g) sigmas of the place, along and across the course, and upright
    across: Floats
    upright: Floats
    has_height: Bools  # (n,)
    reported: Bools  # (n,) whether an aircraft says where it is; others only a radar sees
    straight_mps: Floats  # (n,) ground speed of who flies straight, and nobody knows for how long; NaN of others

    def taken(self, rows: Ints | Bools) -> Ways:
        """Some of the rows."""
        return Ways(*(getattr(self, one.name)[rows] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Ways]) -> Ways:
        """The newest way of each track in any of the parts, in the order of the tracks' numbers; at least one part.

        The grids must be as long as each other.
        """
        whole = cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))
        order = np.lexsort((whole.made, whole.track))
        newest = np.append(whole.track[order][1:] != whole.track[order][:-1], True)
        return whole.taken(order[newest[: len(order)]])


def ways_of(
    tracks: Sequence[int],
    made: int,
    state: State,
    now: Motions,
    whole: Ahead,
    known_s: Floats,
    up: Floats,
    spread: Spread,
    horizons_s: Sequence[float],
    by_points: Bools,
    settled: Bools,
    reported: Bools,
    frame: RunwayFrame,
) -> Ways:
    """The ways of n tracks that were foretold at an instant.

    `whole` are their paths at times `known_s` (n, k) after it, one of them not later than it; `up` (n, h) and `spread` what is
    foretold at the horizons; `by_points` (n,) who flies to a point and not on as now, `settled` (n,) whose way is
    worth to be compared, `reported` (n,) who says where it is.
    """
    times = grid_s(horizons_s)
    level, course = path_on(times, known_s, whole.position, whole.course)
    known = np.concatenate([[0.0], horizons_s])
    up_now = state.up + state.climb * state.since_s
    told = (up_now, up), (state.place_sigma, spread.along), (state.place_sigma, spread.across)
    values = np.stack([np.concatenate([now[:, None], later], axis=1) for now, later in told])
    height, along, across = between(times, known, values)
    wanders = state.climb_sigma**2 + (LEVELS_OFF * state.climb) ** 2 + CLIMBS_MPS**2
    upright = np.sqrt(state.up_sigma[:, None] ** 2 + wanders[:, None] * times * times)
    place = np.concatenate([level, height[..., None]], axis=2)
    beyond = (np.abs(course - course[:, :1]) > FREE_TURN_RAD) & ~by_points[:, None]
    place[beyond | _joins_final(place, frame) & ~by_points[:, None]] = np.nan
    place[~settled] = np.nan
    at, numbers = np.full(len(tracks), made, dtype=np.int64), np.array(tracks, dtype=np.int64)
    straight = ~by_points & (now.side == 0) & (now.unsettled < TURNS_RAD) & (state.since_s <= STALE_S)
    straight_mps = np.where(straight, now.speed, math.nan)
    return Ways(numbers, at, place, course, along, across, upright, state.has_height, reported, straight_mps)


def _joins_final(place: Floats, frame: RunwayFrame) -> Bools:
    """From where on (n, g) aircraft have crossed the final at a height from which they may join it: who does so turns there."""
    runway = frame.runway
    x, y, up = np.ascontiguousarray(np.moveaxis(turn(frame.runway_from_enu, place), -1, 0))
    before_m = runway.aiming_point_x_m - x
    crosses = (y[:, 1:] * y[:, :-1] <= 0.0) & (np.abs(np.diff(y, axis=1)) > np.abs(np.diff(x, axis=1)) * CROSSES)
    low = up < before_m * math.tan(runway.glide_path_rad) + ABOVE_GLIDE_PATH_M
    joins = crosses & low[:, 1:] & (before_m[:, 1:] > FINAL_M[0]) & (before_m[:, 1:] < FINAL_M[1])
    after = np.maximum.accumulate(joins, axis=1)
    return np.concatenate([np.zeros((len(place), 1), dtype=np.bool_), after], axis=1)


def grid_s(horizons_s: Sequence[float]) -> Floats:
    """The times of the grid (g,) of predictions at these horizons, s after they were made."""
    return np.arange(0.0, max(horizons_s) + 1e-9, STEP_S)


def path_on(times_s: Floats, known_s: Floats, place: Floats, course: Floats) -> tuple[Floats, Floats]:
    """Places (n, g, 2) and courses (n, g) of n paths at times (g,), of places (n, k, 2) and courses (n, k) at `known_s` (n, k).

    A cubic through two places with their courses, as long as an arc from one to the other; the courses are not wrapped.
    """
    n, k = known_s.shape
    begins = k * np.arange(n)[:, None]
    order = np.argsort(known_s, axis=1, kind="stable") + begins
    known = known_s.take(order)
    passed = (
        (np.ascontiguousarray(known.T)[:, None] <= times_s[:, None]).sum(axis=0).T
    )  # in this order of axes: swiftly
    first = np.clip(passed - 1, 0, k - 2) + begins
    before, after = order.take(first), order.take(first + 1)

    def ends(values: Floats) -> tuple[Floats, Floats]:
        return values.take(before), values.take(after)

    (before_s, after_s), (east, next_east), (north, next_north), (heading, next_heading) = map(
        ends, (known_s, place[..., 0], place[..., 1], course)
    )
    share = np.clip((times_s - before_s) / np.maximum(after_s - before_s, 1e-9), 0.0, 1.0)
    half = 0.5 * np.clip(np.abs(next_heading - heading), 1e-6, MOST_TURNED_RAD)
    d_east, d_north = next_east - east, next_north - north
    length = np.sqrt(d_east * d_east + d_north * d_north) * half / np.sin(np.minimum(half, 2.5))
    rest = 1.0 - share
    leaves, arrives = length * share * rest * rest, -length * share * share * rest
    middle = share * share * (3.0 - 2.0 * share)
    east = east + middle * d_east + leaves * np.cos(heading) + arrives * np.cos(next_heading)
    north = north + middle * d_north + leaves * np.sin(heading) + arrives * np.sin(next_heading)
    return np.stack([east, north], axis=-1), heading + share * (next_heading - heading)


def between(times_s: Floats, known_s: Floats, values: Floats) -> Floats:
    """Values (..., g) at times (g,), straight between those (..., k) at `known_s` (k,), which ascend."""
    first = np.clip(np.searchsorted(known_s, times_s, side="right") - 1, 0, len(known_s) - 2)
    share = np.clip((times_s - known_s[first]) / (known_s[first + 1] - known_s[first]), 0.0, 1.0)
    return np.asarray(values[..., first] * (1.0 - share) + values[..., first + 1] * share)


def at_instant(ways: Ways, at: int, times_s: Floats) -> Floats:
    """Places (n, m, 3) at times (m,) after an instant, straight between those of the grid; NaN beyond it."""
    last = ways.place.shape[1] - 1
    grid = (((at - ways.made) / SECOND)[:, None] + times_s) / STEP_S
    first = np.clip(np.floor(grid), 0, last - 1).astype(np.int64)
    share = (grid - first)[..., None]
    flat = first + np.arange(len(first))[:, None] * (last + 1)
    one, two = (ways.place.reshape(-1, 3).take(place, axis=0) for place in (flat, flat + 1))
    beyond = (grid > last + 1e-9) | (grid < -1e-9)
    return np.where(beyond[..., None], np.nan, one * (1.0 - share) + two * share)


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """One of the things that k aircraft may do: with what probability (k,), and the covariance of the place then (k, 2, 2)."""

    probability: Floats
    covariance: Floats


def cases_at(ways: Ways, rows: Ints, at: Ints) -> tuple[tuple[Case, ...], Floats]:
    """What some rows (k,) may do until instants (k,) ns, by the nearest of the grid, and upright variances (k,) then.

    Who flies straight goes on so, or turns some time. Both together have the sigmas that are foretold, but who goes on is
    hardly off his way, and who turns is farther off than those say.
    """
    last = ways.place.shape[1] - 1
    since_s = (at - ways.made[rows]) / SECOND
    near = np.clip(np.rint(since_s / STEP_S), 0, last).astype(np.int64)
    along, across, course = (column[rows, near] for column in (ways.along, ways.across, ways.course))
    upright, squares, speed = ways.upright[rows, near] ** 2, (along * along, across * across), ways.straight_mps[rows]
    if np.isnan(speed).all():
        return (Case(np.ones(len(rows)), _turned(squares[0], squares[1], course)),), upright
    goes_on = np.where(np.isnan(speed), 0.0, np.exp(-np.maximum(since_s, 0.0) / STRAIGHT_S))
    here = ways.along[rows, 0] ** 2
    late, aside = SLOWS * speed * speed * since_s**3, (KEEPS_RAD * speed * since_s) ** 2
    straight = [np.fmin(here + wanders, square) for wanders, square in zip((late, aside), squares, strict=True)]
    others = [(square - goes_on * small) / (1.0 - goes_on) for square, small in zip(squares, straight, strict=True)]
    return (
        Case(goes_on, _turned(straight[0], straight[1], course)),
        Case(1.0 - goes_on, _turned(others[0], others[1], course)),
    ), upright


def _turned(along: Floats, across: Floats, course: Floats) -> Floats:
    """Covariances (k, 2, 2) east and north of variances (k,) along and across courses (k,)."""
    cosine, sine = np.cos(course), np.sin(course)
    mixed = (along - across) * sine * cosine
    level = [along * cosine * cosine + across * sine * sine, mixed]
    level += [mixed, along * sine * sine + across * cosine * cosine]
    return np.stack(level, axis=-1).reshape(-1, 2, 2)
