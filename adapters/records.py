"""Where the records of a .tlog stand: {uint64 big-endian microseconds since 1970, MAVLink frame}, without index or checksum.

In step, behind a record, the next one is taken where
- its frame is good by its checksum (of the first of all the stamp must be sane, too); or
- its frame cannot be checked (unknown id, other definition), the stamp is sane and no good record begins within it; or
- the stamp is sane and the file ends behind it, or a record follows whose checksum some definition could give: a frame that
  was damaged, but not in its length.
Else the next record is the first behind it with a sane stamp and a good frame. What lies between is skipped and counted. So
damage costs the records that it hit and no other.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from adapters.framing import BAD_CHECKSUM, DIFFERS, GOOD, UNKNOWN_ID, Bytes, Headers, Places, headers, padded, rows
from adapters.mavlink_frames import LONGEST, V2

MICROSECONDS_2200 = 7_258_118_400 * 10**6
_BLOCK = 1 << 21
_AHEAD = 2 * (8 + LONGEST) + 9  # what must be known behind a record's beginning to judge it


@dataclass(frozen=True, slots=True)
class Records:
    """The records of one block of a file, in their order.

    `data` holds the block, `bytes` the same as a padded array; `frames` are places in it; `offset` is the block's place in the
    file. `micros`: the stamps as they are told, -1 where that cannot be one.
    """

    data: bytes
    bytes: Bytes
    offset: int
    micros: Places
    frames: Headers


def read_records(file: BinaryIO, counters: Counter[str], block: int = _BLOCK) -> Iterator[Records]:
    """The records of a file, some at a time, never none. Counters: "bytes skipped", "cut at the end"."""
    data, offset, skipped, in_step, last = b"", 0, 0, True, False
    while not last:
        more = file.read(block)
        last, data = not more, data + more
        if not last and len(data) < block:  # a short read
            continue
        limit = len(data) if last else max(len(data) - _AHEAD, 0)
        found = _Walk(data, limit, last=last, in_step=in_step, is_first=offset == 0)
        if found.chosen is not None:
            if found.skipped + skipped:
                counters["bytes skipped"] += found.skipped + skipped
            skipped = 0
            yield Records(data, found.block, offset, found.micros[found.chosen], found.frames[found.chosen])
        skipped += found.trailing
        data, offset, in_step = data[found.at :], offset + found.at, found.in_step
    if skipped:
        counters["cut at the end"] += skipped


class _Walk:
    """The way through one block: which candidates are records, and what was skipped between and behind them."""

    def __init__(self, data: bytes, limit: int, *, last: bool, in_step: bool, is_first: bool) -> None:
        self.at, self.in_step, self.skipped, self.trailing = 0, in_step, 0, 0
        self.block = padded(data)
        self.micros, self.frames = _candidates(self.block, len(data), in_step and not is_first)
        self._places = self.frames.start - 8
        self._sane = self.micros >= 0
        strong = self._sane & (self.frames.verdict == GOOD)
        self._strong = np.flatnonzero(strong)
        self._in_step = self._acceptable(len(data), last)
        if is_first:  # nothing stands before it whose time it could take
            self._in_step[:1] &= self._sane[:1]
        eligible = int(np.searchsorted(self._places, limit))
        self._strong = self._strong[: int(np.searchsorted(self._strong, eligible))]
        self.chosen = self._walk(limit, eligible)

    def _acceptable(self, size: int, last: bool) -> NDArray[np.bool_]:
        """Whether each candidate is a record, if it stands right behind one."""
        frames, places, verdict = self.frames, self._places, self.frames.verdict
        accepted: NDArray[np.bool_] = frames.fits & (verdict == GOOD)
        doubtful = np.flatnonzero(frames.fits & self._sane & ~accepted)
        if not len(doubtful):
            return accepted
        end = frames.end[doubtful]
        successor = np.minimum(np.searchsorted(places, end), len(places) - 1)
        could_be = frames.fits & (accepted | self._sane & (verdict < BAD_CHECKSUM))
        is_followed = (places[successor] == end) & could_be[successor]
        if last:
            is_followed |= end == size
        inner = np.searchsorted(places[self._strong], places[doubtful], side="right")
        bounds = np.append(places[self._strong], size)
        uncheckable = np.isin(verdict[doubtful], (UNKNOWN_ID, DIFFERS)) & (bounds[inner] >= end)
        accepted[doubtful] = is_followed | uncheckable
        return accepted

    def _walk(self, limit: int, eligible: int) -> NDArray[np.int64] | slice | None:
        places, ends, accepted = self._places, self.frames.end, self._in_step
        follows = (places[1:eligible] == ends[: max(eligible - 1, 0)]) & accepted[1:eligible]
        breaks = [*np.flatnonzero(~follows).tolist(), eligible - 1]
        strong_places = places[self._strong]
        runs: list[slice] = []
        while self.at < limit:
            index = int(np.searchsorted(places[:eligible], self.at))
            if not (self.in_step and index < eligible and places[index] == self.at and accepted[index]):
                known = int(np.searchsorted(strong_places, self.at + self.in_step))
                self.in_step = known < len(strong_places)
                goal = int(strong_places[known]) if self.in_step else limit
                if not self.in_step:
                    self.trailing = goal - self.at
                    self.at = goal
                    break
                self.skipped += goal - self.at
                index = int(self._strong[known])
            stop = breaks[bisect_left(breaks, index)]
            runs.append(slice(index, stop + 1))
            self.at = int(ends[stop])
        if not runs:
            return None
        return runs[0] if len(runs) == 1 else np.concatenate([np.arange(run.start, run.stop) for run in runs])


def _candidates(block: Bytes, size: int, is_behind_record: bool) -> tuple[Places, Headers]:
    """The stamps and frames at every place of a block where a record could begin, those within a good record left out."""
    magic = np.flatnonzero(block[:size] - np.uint8(V2) < 2)
    magic = magic[(magic >= 8) & (magic + 8 <= size)]
    micros = rows(block, magic - 8, 8).view(">u8")[:, 0]
    sane = np.flatnonzero(micros < MICROSECONDS_2200)
    frames = headers(block, size, magic[sane])
    good = frames.verdict == GOOD
    covered = np.maximum.accumulate(np.where(good, frames.end, 0))
    free = good.copy()
    free[:1] = True
    free[1:] |= magic[sane[1:]] - 8 >= covered[:-1]
    sane, frames = sane[free], frames[free]
    ends = np.zeros(size + 1, np.bool_)
    ends[0] = is_behind_record
    ends[frames.end[frames.fits]] = True
    if not (ends[magic - 8] & (micros >= MICROSECONDS_2200)).any():
        return micros[sane].astype(np.int64), frames
    # A stamp that was hit, its frame perhaps not: every place counts.
    told = np.where(micros < MICROSECONDS_2200, micros, 0).astype(np.int64)
    told[micros >= MICROSECONDS_2200] = -1
    return told, headers(block, size, magic)
