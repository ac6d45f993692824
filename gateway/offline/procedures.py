"""Arrivals beside published procedures: who flew which, who was let go direct, and how high they were at the entry.

Source: 002-7, the use of its flows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.geodesy import wrap_rad
from gateway.offline.flows import CORRIDOR_M, Track, distance_to_go

Floats = NDArray[np.float64]

STEP_M = 250.0  # a track is looked at in steps of this length
PASSED_M = 3704.0  # 2 nautical miles: who turns before a point passes it inside the turn
ON_LEG = 0.9  # so much of a leg is flown within the corridor
STRAIGHT = 1.03  # a way that is no longer than so many times the distance is straight
MOSTLY = 0.5  # of a procedure's length has to be flown, on its legs or direct, by who flies it
FINAL_M = 5000.0  # before its end a track shows its landing direction
ALIGNED_RAD = math.radians(20.0)  # a runway's number is its magnetic direction, rounded


@dataclass(frozen=True, slots=True, eq=False)
class Procedure:
    """A published way: its points (k, 2) east and north of the airport, m, and heights above it (k,), NaN = not said."""

    name: str
    points: tuple[str, ...]
    place_m: Floats
    least_m: Floats
    most_m: Floats

    @property
    def lengths_m(self) -> Floats:
        """Of its legs (k - 1,)."""
        return np.asarray(np.linalg.norm(np.diff(self.place_m, axis=0), axis=1))


@dataclass(frozen=True, slots=True)
class Direct:
    """From after one point straight to a later one, by how much shorter than published, m."""

    after: int
    to: int
    saved_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """One arrival on a procedure: which, the points that it passed, and the heights there (k,) m above the airport, NaN = not."""

    procedure: int
    passed: tuple[int, ...]
    share: float  # of the procedure's length, on its legs or direct
    directs: tuple[Direct, ...]
    heights_m: Floats
    aside_m: float  # RMS over the legs that it flew

    @property
    def entry(self) -> int:
        """The first point that it passed."""
        return self.passed[0]

    def as_published(self, procedure: Procedure) -> bool:
        """Whether it flew every leg."""
        return not self.directs and self.share > 1.0 - 1e-9 and len(self.passed) == len(procedure.points)

    def too_low(self, procedure: Procedure) -> list[int]:
        """The points that it passed below what is published."""
        return [int(place) for place in np.flatnonzero(self.heights_m < procedure.least_m)]

    def too_high(self, procedure: Procedure) -> list[int]:
        """And those above."""
        return [int(place) for place in np.flatnonzero(self.heights_m > procedure.most_m)]


@dataclass(frozen=True, slots=True)
class Compared:
    """Of each track (n,) the procedure that it flew, or None."""

    procedures: tuple[Procedure, ...]
    flights: tuple[Flight | None, ...]


def compared(tracks: Sequence[Track], procedures: Sequence[Procedure]) -> Compared:
    """Each arrival beside all procedures: it flew the one of which it flew most, if that is enough."""
    flights: list[Flight | None] = []
    for track in tracks:
        way = _in_steps(track)
        tried = [
            one for place, procedure in enumerate(procedures) if (one := _flown(way, procedure, place)) is not None
        ]
        flights.append(max(tried, key=lambda one: (one.share, -one.aside_m), default=None))
    return Compared(tuple(procedures), tuple(flights))


def landing_course(track: Track) -> float:
    """The compass course (rad) of a track's last kilometres."""
    begins = int(np.argmin(np.abs(distance_to_go(track) - FINAL_M)))
    east, north = track.place_m[-1, :2] - track.place_m[begins, :2]
    return math.atan2(east, north) % (2.0 * math.pi)


def lands_on(track: Track, number: int) -> bool:
    """Whether a track lands in the direction of a runway's number, 1 to 36."""
    return abs(float(wrap_rad(landing_course(track) - math.radians(10.0 * number)))) <= ALIGNED_RAD


def runway_of(track: Track, thresholds_m: Floats, directions: Floats) -> int | None:
    """Which of some runways, thresholds (r, 2) m and true directions (r,) rad, a track lands on: the nearest centreline of
    those that lead its way.
    """
    off = np.abs(wrap_rad(landing_course(track) - directions))
    way = track.place_m[-1, :2] - thresholds_m
    beside = np.abs(way[:, 0] * np.cos(directions) - way[:, 1] * np.sin(directions))
    beside = np.where(off <= ALIGNED_RAD, beside, math.inf)
    nearest = int(np.argmin(beside))
    return nearest if math.isfinite(beside[nearest]) else None


def comes_from(track: Track, bearing: float, half_width: float) -> bool:
    """Whether a track begins in a sector about a bearing (rad) seen from the airport."""
    east, north = track.place_m[0, :2]
    return abs(float(wrap_rad(math.atan2(east, north) - bearing))) <= half_width


def _in_steps(track: Track) -> Floats:
    """Places (m, 3) at equal steps of its way over the ground."""
    flown = distance_to_go(track)[0] - distance_to_go(track)
    steps = np.linspace(0.0, flown[-1], max(int(flown[-1] / STEP_M), 1) + 1)
    return np.stack([np.interp(steps, flown, column) for column in track.place_m.T], axis=-1)


def _flown(way: Floats, procedure: Procedure, place: int) -> Flight | None:
    """How a way (m, 3) flew a procedure; None where it did not fly enough of it."""
    at = _passed(way[:, :2], procedure.place_m)
    passed = tuple(np.flatnonzero(at >= 0).tolist())
    if len(passed) < 2:
        return None
    published, flown_m, directs, off = procedure.lengths_m, 0.0, [], [np.zeros(0)]
    for first, last in pairwise(passed):
        part = way[at[first] : at[last] + 1, :2]
        if last == first + 1:
            aside = _aside(part, procedure.place_m[first], procedure.place_m[last])
            if np.count_nonzero(aside <= CORRIDOR_M) >= ON_LEG * len(aside):
                flown_m += published[first]
                off.append(aside)
        elif (saved_m := _saved(part, procedure, first, last)) is not None:
            directs.append(Direct(first, last, saved_m))
            flown_m += published[first:last].sum()
    share = flown_m / published.sum()
    if share < MOSTLY:
        return None
    heights = np.where(at >= 0, way[np.maximum(at, 0), 2], math.nan)
    aside = np.concatenate(off)
    rms = math.sqrt(float(np.mean(aside**2))) if len(aside) else math.nan
    return Flight(place, passed, float(share), tuple(directs), heights, rms)


def _passed(way: Floats, points: Floats) -> NDArray[np.int64]:
    """Where on a way (m, 2) each point (k, 2) is passed, one after the other; -1 = it is not."""
    at, after = np.full(len(points), -1), 0
    for place, point in enumerate(points):
        distance = np.linalg.norm(way[after:] - point, axis=1)
        if len(distance) and distance.min() <= PASSED_M:
            at[place] = after = after + int(distance.argmin())
    return at


def _saved(part: Floats, procedure: Procedure, first: int, last: int) -> float | None:
    """What a part of a way between two passed points that skips others is shorter than published; None where it is not direct.

    It may have left the leg after the first point anywhere.
    """
    aside = _aside(part, procedure.place_m[first], procedure.place_m[first + 1])
    left = np.flatnonzero(aside > CORRIDOR_M)
    leaves = max(int(left[0]) - 1, 0) if len(left) else len(part) - 1
    rest = part[leaves:]
    length_m = float(np.linalg.norm(np.diff(rest, axis=0), axis=1).sum())
    if length_m > STRAIGHT * max(float(np.linalg.norm(rest[-1] - rest[0])), STEP_M):
        return None
    whole_m = float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum())
    return float(procedure.lengths_m[first:last].sum()) - whole_m


def _aside(part: Floats, begin: Floats, end: Floats) -> Floats:
    """Distances (m,) of places (m, 2) from a leg."""
    step = end - begin
    to = part - begin
    share = np.clip((to * step).sum(axis=1) / max(float(step @ step), 1e-9), 0.0, 1.0)
    return np.asarray(np.linalg.norm(to - share[:, None] * step, axis=1))
