"""The .tlog file: repeated {uint64 big-endian microseconds since 1970, MAVLink frame}; no header, index or checksum.

Our own files hold strictly increasing multiples of 4 microseconds. In files of others the low two bits can carry a link's
number, so they are masked; 3 means "sent by the ground station" where other values occur too, and such frames are left out.
Stamps that cannot be are replaced by their neighbours', stamps that repeat or fall back are made to increase. Which bytes
are records after damage: records.py.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from adapters.framing import Places
from adapters.mavlink_frames import V1, V2, parse
from adapters.records import MICROSECONDS_2200, Records, read_records

STEP_NS = 4_000
SECOND = 10**9
_JUMP_NS = 3_600 * SECOND  # a single stamp further off than this is damage
_FELL_BACK_NS = SECOND
_SENT_BY_STATION = 3


class RecordSink(Protocol):
    """Where whole records go; one `write` is one record."""

    def write(self, record: bytes, /) -> int:
        """Take one record."""


class TlogWriter:
    """Writes records. The stamp is ns since 1970 UTC, a multiple of 4000."""

    def __init__(self, sink: RecordSink) -> None:
        self._sink = sink

    def write(self, received_at: int, data: bytes, peer: str = "") -> None:
        """Add one frame; a .tlog has no place for the peer's name."""
        self._sink.write((received_at // 1000).to_bytes(8, "big") + data)


def tlog_records(received_at: NDArray[np.int64], frames: list[bytes]) -> list[bytes]:
    """What TlogWriter writes, of many frames and their stamps at once."""
    stamps: list[bytes] = (received_at // 1000).astype(">i8").view("V8").tolist()
    return list(map(bytes.__add__, stamps, frames))


@dataclass(slots=True)
class _Stamps:
    """Makes the stamps of a file sane and strictly increasing."""

    counters: Counter[str]
    last: int = -1
    shift: int = 0
    before: int = -1

    def next(self, stamp: int, following: int | None) -> int:
        """The stamp (ns, low bits masked; negative: none) of a frame as it will be told; `following`: the next one's."""
        if self.before >= 0:
            jump = stamp - self.before
            returns = following is None or following < 0 or abs(following - self.before) < _JUMP_NS
            if stamp < 0 or (abs(jump) > _JUMP_NS and following is not None and returns):
                self.counters["bad timestamps"] += 1
                stamp = self.before
            elif jump < -_FELL_BACK_NS:
                self.counters["clock set back"] += 1
                self.shift += -jump
        self.before = stamp
        self.last = max(stamp + self.shift, self.last + STEP_NS if self.last >= 0 else 0)
        return self.last

    def many(self, stamps: Places, outgoing: NDArray[np.bool_], following: int | None) -> Places:
        """The stamps of the frames of a block; those that the station sent keep theirs, moved as the others are."""
        kept = stamps[~outgoing]
        told = stamps + self.shift
        jumps = np.diff(kept, prepend=self.before if self.before >= 0 else kept[:1])
        if len(kept) and kept.min() >= 0 and jumps.min() >= -_FELL_BACK_NS and jumps.max() <= _JUMP_NS:
            steps = STEP_NS * np.arange(1, len(kept) + 1)
            floor = self.last if self.last >= 0 else -STEP_NS
            told[~outgoing] = steps + np.maximum.accumulate(np.maximum(kept + self.shift - steps, floor))
            self.before, self.last = int(kept[-1]), int(told[~outgoing][-1])
            return told
        after = [*stamps[1:].tolist(), following]
        for index, stamp in enumerate(stamps.tolist()):
            told[index] = stamp + self.shift if outgoing[index] else self.next(stamp, after[index])
        return told


def stamped(
    blocks: Iterator[Records], counters: Counter[str]
) -> Iterator[tuple[Records, NDArray[np.int64], NDArray[np.bool_]]]:
    """Each block with its frames' stamps (ns since 1970 UTC) and which of them the ground station sent.

    Without those that the station sent, stamps are strictly increasing over all blocks. Counters: "bad timestamps", "clock
    set back", "sent by the ground station".
    """
    stamps = _Stamps(counters)
    held = next(blocks, None)
    tells_senders = held is not None and _tells_senders(held)
    while held is not None:
        coming = next(blocks, None)
        following = None if coming is None else int(_masked(coming)[0])
        outgoing = (held.micros & 3 == _SENT_BY_STATION) & (held.micros >= 0) & tells_senders
        if outgoing.any():
            counters["sent by the ground station"] += int(outgoing.sum())
        yield held, stamps.many(_masked(held), outgoing, following), outgoing
        held = coming


@dataclass(slots=True)
class TlogReader:
    """The frames of a .tlog in their order. Counters: "bytes skipped", "bad timestamps", "clock set back", "sent by the
    ground station", "cut at the end".
    """

    file: BinaryIO
    counters: Counter[str] = field(default_factory=Counter)

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Stamp (ns since 1970 UTC, strictly increasing multiples of 4000) and frame."""
        for records, told, outgoing in stamped(read_records(self.file, self.counters), self.counters):
            data, frames = records.data, records.frames
            begins, ends = frames.start[~outgoing].tolist(), frames.end[~outgoing].tolist()
            for stamp, begin, end in zip(told[~outgoing].tolist(), begins, ends, strict=True):
                yield stamp, data[begin:end]


def record_end(data: bytes, at: int) -> int | None:
    """Where the record at a place ends, if a record stands there: a sane stamp, a frame whose length brings us to the
    end or to the next frame's magic, or whose checksum is right.
    """
    start = at + 8
    if len(data) - start < 8 or int.from_bytes(data[at:start], "big") >= MICROSECONDS_2200:
        return None
    if data[start] == V2 and len(data) - start >= 12:
        end = start + data[start + 1] + (25 if data[start + 2] & 1 else 12)
    elif data[start] == V1:
        end = start + data[start + 1] + 8
    else:
        return None
    if end > len(data):
        return None
    if end == len(data) or (end + 8 < len(data) and data[end + 8] in (V1, V2)):
        return end
    frame = parse(data[start:end])
    return end if frame is not None and frame.verdict == "good" else None


def _masked(records: Records) -> Places:
    return np.where(records.micros < 0, -1, (records.micros & ~3) * 1000)


def _tells_senders(first: Records) -> bool:
    low_bits = np.unique(first.micros[first.micros >= 0] & 3)
    return bool(_SENT_BY_STATION in low_bits and len(low_bits) > 1)
