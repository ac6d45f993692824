"""What is thought of each track from one prediction to the next: its turn, what its course said of candidates, its trust."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.intent import Seen
from gateway.predict.goals import COUNT

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

UNKNOWN = -(1 << 62)
GUSTS_AT_FIRST = 0.2  # m2/s2
LEARNT, KEPT = 4, 5  # the first horizons, of each of which so many predictions are kept until they come due
NOT_KEPT = 1 << 62
NOBODY: Mapping[int, int] = MappingProxyType({})


@dataclass(frozen=True, slots=True, eq=False)
class Minds:
    """n tracks, a row each; nobody may write into the arrays."""

    at: Ints  # (n,) ns, when these were thought; UNKNOWN = never
    courses: Floats  # (n, 2) at that time and at the one before, rad from east to north
    interval_s: Floats  # (n,) between the two
    speed: Floats  # (n,)
    wander: Floats  # (n,) mean square of what the speed changes by in a second, faded; NaN = not known yet
    unsettled: Floats  # (n,) radians that it turned by lately, faded
    cruise: Floats  # (n,) speed through the air that it keeps, m/s; NaN = not known yet
    gusts: Floats  # (n,) mean square of what its speed through the air is off that, on straights, faded
    turned: Floats  # (n,) radians that it turned by since it was first thought of
    agreed: Floats  # (n, c), `intent.Seen`
    length: Floats  # (n,)
    last: Floats  # (n, c)
    turning: Ints  # (n,)
    flown_at: Floats  # (n, c)
    trust: Floats  # (n,) that it goes where it declared
    declared_at: Ints  # (n,) since when it is said to go there
    circled: Floats  # (n,) radians flown round it, if it is a point that is flown round
    due_at: Ints  # (n, LEARNT, KEPT) ns, when predictions come due; NOT_KEPT = none
    foretold: NDArray[
        np.float32
    ]  # (n, LEARNT, KEPT, 6) where it was to be, east and north; course, sigmas; 1 = with a turn
    sigmas: Floats  # (n, 2, LEARNT, 2) without and with a turn: sum of how many sigmas they were off along and across, faded
    counted: Floats  # (n, 2, LEARNT) of how many predictions, in horizons' worths

    @classmethod
    def empty(cls, n: int) -> Minds:
        """Of tracks that were never thought of."""
        seen = Seen.nothing(n, COUNT)
        zero = np.zeros(n)
        return cls(
            np.full(n, UNKNOWN),
            np.full((n, 2), math.nan),
            zero,
            zero,
            np.full(n, math.nan),
            zero,
            np.full(n, math.nan),
            np.full(n, GUSTS_AT_FIRST),
            zero,
            seen.agreed,
            seen.length,
            seen.last,
            seen.turning,
            seen.flown_at,
            zero,
            np.full(n, UNKNOWN),
            zero,
            np.full((n, LEARNT, KEPT), NOT_KEPT),
            np.zeros((n, LEARNT, KEPT, 6), dtype=np.float32),
            np.zeros((n, 2, LEARNT, 2)),
            np.zeros((n, 2, LEARNT)),
        )

    @property
    def seen(self) -> Seen:
        """What the courses so far say."""
        return Seen(self.agreed, self.length, self.last, self.turning, self.flown_at)

    def taken(self, rows: Ints) -> Minds:
        """Some of the rows."""
        return Minds(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Remembered:
    """The minds of all tracks, by the rows that they are in."""

    rows: Mapping[int, int] = field(default_factory=lambda: NOBODY)
    minds: Minds = field(default_factory=lambda: Minds.empty(0))

    def of(self, tracks: Sequence[int]) -> Minds:
        """The minds of some tracks, new ones for those that have none."""
        rows = np.array([self.rows.get(track, -1) for track in tracks], dtype=np.int64)
        found, new = self.minds.taken(np.maximum(rows, 0)) if len(self.rows) else Minds.empty(len(rows)), rows < 0
        if not new.any() or not len(self.rows):
            return found
        empty = Minds.empty(len(rows))
        chosen = [
            np.where(_along(new, getattr(empty, one.name)), getattr(empty, one.name), getattr(found, one.name))
            for one in fields(found)
        ]
        return Minds(*chosen)

    def after(self, tracks: Sequence[int], minds: Minds) -> Remembered:
        """The same with some tracks' minds changed."""
        new = [track for track in tracks if track not in self.rows]
        rows, whole = self.rows, self.minds
        if new:
            rows = {**rows, **{track: len(rows) + place for place, track in enumerate(new)}}
            more = Minds.empty(len(new))
            whole = Minds(
                *(np.concatenate([getattr(whole, one.name), getattr(more, one.name)]) for one in fields(whole))
            )
        return Remembered(rows, _put(whole, np.array([rows[track] for track in tracks], dtype=np.int64), minds))

    def without(self, alive: Mapping[int, object]) -> Remembered:
        """The same without the minds of tracks that are not alive."""
        kept = [track for track in self.rows if track in alive]
        if len(kept) == len(self.rows):
            return self
        rows = np.array([self.rows[track] for track in kept], dtype=np.int64)
        return Remembered({track: row for row, track in enumerate(kept)}, self.minds.taken(rows))


def _along(rows: NDArray[np.bool_], values: NDArray[np.generic]) -> NDArray[np.bool_]:
    return rows.reshape(-1, *(1,) * (values.ndim - 1))


def _put(minds: Minds, rows: Ints, some: Minds) -> Minds:
    columns = []
    for one in fields(minds):
        column = getattr(minds, one.name).copy()
        column[rows] = getattr(some, one.name)
        columns.append(column)
    return Minds(*columns)
