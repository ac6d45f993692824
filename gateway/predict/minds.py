"""What is thought of each track from one prediction to the next: its turn, what its course said of candidates, its trust."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, fields

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

    @classmethod
    def joined(cls, parts: Sequence[Minds]) -> Minds:
        """Some minds behind others."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))


@dataclass(frozen=True, slots=True, eq=False)
class Remembered:
    """The minds of all tracks, in the parts in which they were thought of last: mostly the parts of the next round too."""

    parts: tuple[tuple[tuple[int, ...], Minds], ...] = ()  # no track is in two

    def of(self, tracks: Sequence[int]) -> Minds:
        """The minds of some tracks, at least one and each once; new ones for those that have none."""
        wanted = tuple(tracks)
        known = next((minds for part, minds in self.parts if part == wanted), None)
        if known is not None:
            return known
        places = {track: place for place, track in enumerate(wanted)}
        found, order = [], []
        for part, minds in self.parts:
            rows = [row for row, track in enumerate(part) if track in places]
            if rows:
                found.append(minds.taken(np.array(rows)))
                order += [places.pop(part[row]) for row in rows]
        whole = Minds.joined([*found, Minds.empty(len(places))])
        return whole.taken(np.argsort([*order, *places.values()]))

    def after(self, tracks: Sequence[int], minds: Minds) -> Remembered:
        """The same with some tracks' minds changed."""
        changed = tuple(tracks)
        if any(part == changed for part, _ in self.parts):
            return Remembered(tuple((part, minds if part == changed else one) for part, one in self.parts))
        others = self._only(set().union(*(part for part, _ in self.parts)).difference(changed))
        return Remembered((*others.parts, (changed, minds)))

    def without(self, alive: Mapping[int, object]) -> Remembered:
        """The same without the minds of tracks that are not alive."""
        return self._only(alive)

    def _only(self, kept: Container[int]) -> Remembered:
        parts = []
        for part, minds in self.parts:
            rows = [row for row, track in enumerate(part) if track in kept]
            if len(rows) == len(part):
                parts.append((part, minds))
            elif rows:
                parts.append((tuple([part[row] for row in rows]), minds.taken(np.array(rows))))
        return Remembered(tuple(parts))
