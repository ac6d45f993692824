"""Whole tracks out of pictures, piece by piece: the rows as they were in the end, each with the whole state behind it.

A picture's rows correct those of earlier ones, and lack what a smoother needs: the source's error, and each mode by itself.
Here rows wait until their states have settled (`gateway.fuse.Settled`), and are joined to them. What waits is what the
gateway's history holds, so memory does not grow with the session.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import kalman, modes
from gateway.estimators.kalman import Estimate
from gateway.estimators.modes import Mixture
from gateway.fuse import Fused, Settled
from gateway.fuse.events import Event
from gateway.fuse.weighting import Model

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ENOUGH = 2048  # states
TAKEN_EACH_NS = 60 * SECOND
COMES_BACK_NS = 60 * SECOND  # a track that ended may be taken up again for this long, by data that come late


@dataclass(frozen=True, slots=True)
class Piece:
    """n rows of one track in the order of time, and the filter's states at them in m modes (1 for a single model)."""

    rows: Fused
    step: Ints  # (n,) of the picture that wrote each
    begins: Bools  # (n,) whether the filter began, or began anew, here: nothing leads from the state before
    mean: Floats  # (n, m, d)
    covariance: Floats  # (n, m, d, d)
    weight: Floats  # (n, m)

    @property
    def track(self) -> int:
        """Whose piece it is."""
        return int(self.rows.track[0])


@dataclass(slots=True)
class _Past:
    """What waits of one track: settled states, and how the last one of its last piece goes on."""

    events: list[Event]
    last: Event | None = None  # the last that is in a piece
    now: tuple[int, Estimate | Mixture] | None = None  # when and what the last state in a piece is, coasting included
    over_at: int | None = None
    begun: set[int] = field(default_factory=set)  # when another filter than before went on with the track


class Pieces:
    """Gathers from pictures; `take` gives what has settled since it was last called."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._rows: list[Fused] = []
        self._steps: list[Ints] = []
        self._pasts: dict[int, _Past] = {}
        self._now = 0
        self._taken_at = 0
        self._waiting = 0  # states that have settled
        self._rows_waiting = 0

    @property
    def due(self) -> bool:
        """Whether it is time to take: enough has settled to be worth sorting what waits, or a minute has passed."""
        return self._waiting >= max(ENOUGH, self._rows_waiting // 4) or self._now - self._taken_at > TAKEN_EACH_NS

    def add(self, fused: Fused, step: int, now: int) -> None:
        """Take a picture's rows and what has settled with it; its number and its time."""
        self._now, self._taken_at = now, self._taken_at or now
        if len(fused.time):
            self._rows.append(without_news(fused))
            self._steps.append(np.full(len(fused.time), step))
            self._rows_waiting += len(fused.time)
        self.settle(fused.settled)

    def settle(self, settled: Sequence[Settled]) -> None:
        """Take settled states alone, at the end of a session."""
        for one in settled:
            past = self._pasts.setdefault(one.track, _Past([]))
            newest = past.events[-1] if past.events else past.last
            if past.over_at is not None and one.events[0] is not newest:
                past.begun.add(one.events[0].at)
            past.events += one.events[1:] if one.events[0] is newest else one.events
            past.over_at = self._now if one.over else None
            self._waiting += len(one.events)

    def take(self, *, all_of_it: bool = False) -> list[Piece]:
        """What has settled, in pieces, tracks in the order of their numbers; with `all_of_it` the tails of tracks too.

        A tail is what a track wrote after its last measurement, while it coasted.
        """
        self._waiting, self._taken_at = 0, self._now
        if not self._rows:
            return []
        rows, step = joined(self._rows), np.concatenate(self._steps)
        order = np.lexsort((np.arange(len(step)), rows.time, rows.track))
        places = {int(track): order[at] for track, at in _groups(rows.track[order])}
        left, pieces = [], []
        for track in sorted(set(places) | set(self._pasts)):
            past = self._pasts.get(track)
            mine = places.get(track, np.zeros(0, dtype=np.int64))
            is_over = past is not None and past.over_at is not None and past.over_at < self._now - COMES_BACK_NS
            if past is not None and (past.events or all_of_it or is_over):
                piece, mine = self._piece(past, rows, step, mine, with_tail=all_of_it or is_over)
                pieces += piece
            if is_over:
                del self._pasts[track]
            else:
                left.append(mine)
        kept = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *left]))
        self._rows, self._steps = ([chosen(rows, kept)], [step[kept]]) if len(kept) else ([], [])
        self._rows_waiting = len(kept)
        return pieces

    def _piece(self, past: _Past, rows: Fused, step: Ints, mine: Ints, *, with_tail: bool) -> tuple[list[Piece], Ints]:
        """What a track's settled states make, and those of its rows that go on waiting.

        A row that is neither a settled measurement's nor a coasting one was of a measurement that became another track's.
        """
        last_of = {int(rows.time[row]): int(row) for row in mine}
        until = past.events[-1].at if past.events else (past.last.at if past.last is not None else 0)
        coasted = [
            row for time, row in last_of.items() if rows.updated_by[row] == "coast" and (with_tail or time < until)
        ]
        settled = {event.at: event for event in past.events}
        begun = {event.at for event in past.events if _begins(event)} | past.begun
        found, states, begins = [], [], []
        for time, row in _in_order(past.events, coasted, last_of, rows.time):
            event = settled.get(time)
            state = self._coasted(past.now, time) if event is None else state_of(event)
            if state is None:
                continue
            past.now = time, state
            found.append(row)
            states.append(state)
            begins.append(event is not None and time in begun)
        waits = mine[rows.time[mine] > until] if not with_tail else mine[:0]
        if past.events:
            past.last, past.events, past.begun = past.events[-1], [], set()
        if not found:
            return [], waits
        at = np.array(found)
        mean, covariance, weight = arrays_of(states)
        return [Piece(chosen(rows, at), step[at], np.array(begins), mean, covariance, weight)], waits

    def _coasted(self, now: tuple[int, Estimate | Mixture] | None, time: int) -> Estimate | Mixture | None:
        """The last state carried on to a later time, or None without one."""
        if now is None or now[0] >= time:
            return None
        elapsed_s = np.array([(time - now[0]) / SECOND])
        if isinstance(now[1], Estimate):
            return kalman.predict(now[1], elapsed_s, self._model.motion)
        assert self._model.modes is not None
        return modes.predict(now[1], elapsed_s, self._model.modes)


def _begins(event: Event) -> bool:
    """Whether the filter knew nothing before a measurement, or gave up what it knew."""
    return event.interval == 0 or event.restarted is not None


def state_of(event: Event) -> Estimate | Mixture:
    """The whole state after a measurement: by mode, where there are modes."""
    return event.mixture or Estimate(event.mean[None], event.covariance[None])


def _in_order(
    events: Sequence[Event], coasted: Sequence[int], last_of: dict[int, int], time: Ints
) -> list[tuple[int, int]]:
    """Times and rows of a track in the order that they were flown in.

    That is the order of time, unless the session's time was set back in between: then each part by itself, and what was
    coasted goes with the last part that it fits.
    """
    backs = [place + 1 for place, (one, other) in enumerate(pairwise(events)) if other.at < one.at]
    parts = [events[first:end] for first, end in pairwise([0, *backs, len(events)])]
    ordered: list[tuple[int, int]] = []
    left = {int(time[row]): row for row in coasted}
    for part in reversed(parts):
        times = {event.at: last_of[event.at] for event in part if event.at in last_of}
        first = min(times, default=0) if part is not parts[0] else 0
        fitting = {at: row for at, row in left.items() if at > first}
        left = {at: row for at, row in left.items() if at <= first}
        ordered[:0] = sorted((fitting | times).items())
    return ordered


def arrays_of(states: Sequence[Estimate | Mixture]) -> tuple[Floats, Floats, Floats]:
    """Means (n, m, d), covariances (n, m, d, d) and weights (n, m) of some states by mode."""
    mean = np.array([state.mean.reshape(-1, state.mean.shape[-1]) for state in states])
    covariance = np.array([state.covariance.reshape(-1, *state.covariance.shape[-2:]) for state in states])
    weight = np.array([state.weight[0] if isinstance(state, Mixture) else (1.0,) for state in states])
    return mean, covariance, weight


def _groups(sorted_tracks: Ints) -> list[tuple[int, slice]]:
    """Each track and where it is in a sorted column."""
    tracks, first = np.unique(sorted_tracks, return_index=True)
    ends = [*first[1:].tolist(), len(sorted_tracks)]
    return [(int(t), slice(a, b)) for t, a, b in zip(tracks, first.tolist(), ends, strict=True)]


_NEWS = ("ended", "lived", "settled")  # of a picture, not of its rows


def without_news(fused: Fused) -> Fused:
    """The rows alone."""
    return replace(fused, ended=(), lived=(), settled=())


def chosen(fused: Fused, places: Ints) -> Fused:
    """Some of the rows, in this order."""
    columns: dict[str, Any] = {}
    for one in fields(Fused):
        column = getattr(fused, one.name)
        if one.name not in _NEWS:
            columns[one.name] = column[places] if isinstance(column, np.ndarray) else tuple(column[i] for i in places)
    return Fused(**columns)


def joined(parts: Sequence[Fused]) -> Fused:
    """Rows of several pictures as one."""
    columns: dict[str, Any] = {}
    for one in fields(Fused):
        column = [getattr(part, one.name) for part in parts]
        if one.name not in _NEWS:
            is_array = isinstance(column[0], np.ndarray)
            columns[one.name] = np.concatenate(column) if is_array else tuple(v for part in column for v in part)
    return Fused(**columns)
