"""Conflicts: pairs of tracks that are foretold to lose their separation, told when that lasts, and cleared when it is over."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame, turn
from gateway.predict.encounters import Encounters, Near, encounters, near_each_other
from gateway.predict.ways import Ways
from gateway.settings import Separation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOLD_AFTER, CLEARED_AFTER = 3, 5  # rounds in a row
LESS_PROBABLE = 0.5  # of the probability that is told: what is still as probable goes on
WATCHED_AT_MOST, TOLD_AT_MOST = 500, 50  # pairs at a time: of a swarm nobody could read more

Pair = tuple[int, int]
"""The numbers of two tracks, the smaller first."""
Met = tuple[Encounters, int]
"""One of some encounters, by its row."""


@dataclass(frozen=True, slots=True)
class Watched:
    """A pair that came near each other in the last rounds. `since`: when it was told, None = it is not told yet."""

    found: int = 0  # rounds in a row in which it is a conflict
    missed: int = 0  # rounds in a row in which it is none
    since: int | None = None


@dataclass(frozen=True, slots=True)
class Conflicts:
    """Conflicts at the instants of some rounds, n rows; what is not told any more has a last row of state "over"."""

    time: Ints  # (n,) ns, when this was so
    pair: tuple[Pair, ...]
    state: tuple[str, ...]  # "found", "goes on", "over"
    closest_at: Ints  # (n,) ns
    loses_at: Ints
    horizontal_m: Floats  # when they are nearest
    vertical_m: Floats  # NaN where a height is not known
    probability: Floats
    latitude_rad: Floats  # in the middle between both, then
    longitude_rad: Floats
    height_m: Floats
    places_m: Floats  # (n, 2, 3) of both in the runway frame
    rounds: tuple[int, ...] = ()  # instants at which was probed, with or without a conflict


_NO_TIME, _NO_VALUE = np.zeros(0, dtype=np.int64), np.zeros(0)
NONE_FOUND = Conflicts(_NO_TIME, (), (), _NO_TIME, _NO_TIME, *(_NO_VALUE,) * 6, places_m=np.zeros((0, 2, 3)))
"""Where nothing was probed."""


@dataclass(frozen=True, slots=True)
class Round:
    """What one round of probing found: encounters that are told, each with its state."""

    at: int
    told: Encounters
    state: tuple[str, ...]
    untold: int = 0  # conflicts beyond those, later than they


@dataclass(frozen=True, slots=True)
class Probing:
    """What is remembered from round to round: the newest ways of all tracks, and the pairs that are watched.

    A round is three things, so that a crowd holds nothing up for long: looking who comes near whom, when they meet, and
    watching these.
    """

    ways: tuple[Ways, ...] = ()
    watched: Mapping[Pair, Watched] = field(default_factory=dict)
    last: Mapping[Pair, Met] = field(default_factory=dict)  # of those that are told, as they were told last
    near: Near | None = None  # of the round that is under way
    met: Encounters | None = None

    def hearing(self, ways: Ways, at: int, period_s: float) -> Probing:
        """The same with ways that were made at an instant; each track has new ones once in a period."""
        oldest = at - int(2.0 * period_s * SECOND)
        return replace(self, ways=(*(one for one in self.ways if int(one.made.max(initial=0)) >= oldest), ways))

    def looking(self, at: int, alive: Sequence[int], separation: Separation) -> Probing:
        """The same with who comes near whom, of the tracks with these numbers, as it is foretold at an instant."""
        if not alive:
            return replace(self, ways=(), near=None, met=None)
        if not self.ways or len(alive) < 2:
            return replace(self, near=None, met=None)
        newest = Ways.joined(self.ways)
        newest = newest.taken(np.isin(newest.track, np.array(alive, dtype=np.int64)))
        return replace(self, near=near_each_other(newest, at, separation), met=None)

    def meeting(self, separation: Separation) -> Probing:
        """The same with when and how near they meet who were found near each other."""
        return self if self.near is None else replace(self, near=None, met=encounters(self.near, separation))

    def watching(self, at: int, alive: Sequence[int], separation: Separation) -> tuple[Probing, Round]:
        """The round told at an instant, of the tracks with these numbers; what is remembered after it.

        Of a swarm, where each is near everybody, the pairs that lose their separation soonest are watched and told.
        """
        met = Encounters.joined([]) if self.met is None else self.met
        near = _soonest(met, self.last)
        conflict = (met.ratio < 1.0) & (met.probability >= separation.least_probability)
        still = conflict | (met.probability >= LESS_PROBABLE * separation.least_probability)
        watched: dict[Pair, Watched] = {}
        due = [pair for pair, row in near.items() if conflict[row] and _is_due(self.watched.get(pair))]
        room = TOLD_AT_MOST - len(self.last)
        waits = set(due[max(room, 0) :])
        told: list[tuple[Met, str]] = []
        last: dict[Pair, Met] = {}
        here = set(alive)
        for pair in sorted({*near, *self.watched}):
            row = near.get(pair)
            before = self.watched.get(pair, Watched())
            now = _watched(before, at, row is not None and bool(conflict[row]), row is not None and bool(still[row]))
            if now is not None and pair in waits:
                now = replace(now, since=None)
            if before.since is not None and (now is None or not here.issuperset(pair)):
                told.append((self.last[pair], "over"))
                continue
            if now is None:
                continue
            watched[pair] = now
            if now.since is not None:
                last[pair] = self.last[pair] if row is None else (met, row)
                told.append((last[pair], "found" if before.since is None else "goes on"))
        return replace(self, watched=watched, last=last, near=None, met=None), Round(
            at, _of([one for one, _ in told]), tuple(state for _, state in told), len(waits)
        )


def _soonest(met: Encounters, told: Container[Pair]) -> dict[Pair, int]:
    """The rows of encounters by their pairs, who loses the separation soonest first: all that are told, and some others."""
    order = np.lexsort((met.pair[:, 1], met.pair[:, 0], met.loses_at)).tolist()
    rows = {(first, second): row for (first, second), row in zip(met.pair[order].tolist(), order, strict=True)}
    others = [pair for pair in rows if pair not in told]
    for pair in others[WATCHED_AT_MOST:]:
        del rows[pair]
    return rows


def _is_due(before: Watched | None) -> bool:
    """Whether a pair that is a conflict once more has been one for long enough to be told, and is not told yet."""
    return before is not None and before.since is None and before.found + 1 >= TOLD_AFTER


def _of(some: Sequence[Met]) -> Encounters:
    """Some encounters, one behind the other."""
    first: dict[Encounters, int] = {}
    for whole, _ in some:
        first.setdefault(whole, sum(len(one.ratio) for one in first))
    rows = np.array([first[whole] + row for whole, row in some], dtype=np.int64)
    return Encounters.joined(list(first)).where(rows)


def _watched(before: Watched, at: int, conflict: bool, still: bool) -> Watched | None:
    """A pair after one round more; None where nobody need watch it."""
    if before.since is None:
        found = before.found + 1 if conflict else 0
        if not found:
            return None
        return Watched(found, 0, at if found >= TOLD_AFTER else None)
    missed = 0 if still else before.missed + 1
    return None if missed >= CLEARED_AFTER else replace(before, missed=missed)


def table(rounds: Sequence[Round], frame: RunwayFrame) -> Conflicts:
    """Rounds as columns in geodetic coordinates."""
    told = Encounters.joined([one.told for one in rounds])
    middle = told.places.mean(axis=1)
    latitude, longitude, height = frame.geodetic_from_enu(middle)
    return Conflicts(
        time=np.repeat([one.at for one in rounds], [len(one.state) for one in rounds]).astype(np.int64),
        pair=tuple((first, second) for first, second in told.pair.tolist()),
        state=tuple(state for one in rounds for state in one.state),
        closest_at=told.closest_at,
        loses_at=told.loses_at,
        horizontal_m=told.horizontal_m,
        vertical_m=told.vertical_m,
        probability=told.probability,
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=np.where(np.isnan(told.vertical_m), np.nan, height),
        places_m=turn(frame.runway_from_enu, told.places),
        rounds=tuple(one.at for one in rounds),
    )


def sentence(one: Round, row: int, names: Mapping[int, str], frame: RunwayFrame) -> str:
    """A conflict that was found, or is over, for people; `names` are those of the tracks."""
    first, second = (names.get(track, f"track {track}") for track in one.told.pair[row].tolist())
    if one.state[row] == "over":
        return f"the conflict of {first} and {second} is over"
    told = one.told
    left_s = (int(told.loses_at[row]) - one.at) / SECOND
    near = f"{told.horizontal_m[row]:.0f} m apart"
    if not np.isnan(told.vertical_m[row]):
        near += f" and {told.vertical_m[row]:.0f} m in height"
    x, y, _ = turn(frame.runway_from_enu, told.places[row].mean(axis=0)).tolist()
    where = f"{np.hypot(x, y) / 1000.0:.1f} km {_direction(one, row)} of the runway"
    when = f"in {left_s:.0f} s" if left_s >= 1.0 else "now"
    return (
        f"conflict: {first} and {second} lose their separation {when}, {near} at the nearest, {where}; "
        f"probability {told.probability[row]:.2f}"
    )


def _direction(one: Round, row: int) -> str:
    east, north, _ = one.told.places[row].mean(axis=0).tolist()
    words = ("north", "north-east", "east", "south-east", "south", "south-west", "west", "north-west")
    return words[round(np.degrees(np.arctan2(east, north)) / 45.0) % 8]
