"""The .tlog file: repeated {uint64 big-endian microseconds since 1970, MAVLink frame}; no header, index or checksum.

Our own files hold strictly increasing multiples of 4 microseconds. In files of others the low two bits can carry a link's
number, so they are masked; 3 means "sent by the ground station" where other values occur too, and such frames are left out.
Stamps that cannot be are replaced by their neighbours', stamps that repeat or fall back are made to increase.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, Protocol

from adapters.mavlink_frames import LONGEST, V1, V2, parse

STEP_NS = 4_000
SECOND = 10**9
_MICROSECONDS_2200 = 7_258_118_400 * 10**6
_JUMP_NS = 3_600 * SECOND  # a single stamp further off than this is damage
_FELL_BACK_NS = SECOND
_BLOCK = 1 << 20
_SENT_BY_STATION = 3
_RECORD_AT_MOST = 8 + LONGEST + 9  # with the next record's stamp and magic


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


@dataclass(slots=True)
class _Stamps:
    """Makes the stamps of a file sane and strictly increasing."""

    counters: Counter[str]
    last: int = -1
    shift: int = 0
    before: int = -1

    def next(self, stamp: int, following: int | None) -> int:
        """The stamp (ns, low bits masked) of a frame as it will be told; `following`: the next frame's, if known."""
        if self.before >= 0:
            jump = stamp - self.before
            returns = following is not None and abs(following - self.before) < _JUMP_NS
            if abs(jump) > _JUMP_NS and returns:
                self.counters["bad timestamps"] += 1
                stamp = self.before
            elif jump < -_FELL_BACK_NS:
                self.counters["clock set back"] += 1
                self.shift += -jump
        self.before = stamp
        self.last = max(stamp + self.shift, self.last + STEP_NS if self.last >= 0 else 0)
        return self.last


@dataclass(slots=True)
class TlogReader:
    """The frames of a .tlog in their order. Counters: "bytes skipped", "bad timestamps", "clock set back", "sent by the
    ground station", "cut at the end".
    """

    file: BinaryIO
    counters: Counter[str] = field(default_factory=Counter)

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Stamp (ns since 1970 UTC, strictly increasing multiples of 4000) and frame."""
        stamps = _Stamps(self.counters)
        tells_senders: bool | None = None
        pending: list[tuple[int, bytes]] = []  # until the first block tells what the low bits mean
        previous: tuple[int, bytes] | None = None
        low_bits: set[int] = set()
        for micros, frame, first_block in self._records():
            if first_block:
                low_bits.add(micros & 3)
                pending.append((micros, frame))
                continue
            if tells_senders is None:
                tells_senders = _tells_senders(low_bits)
            pending.append((micros, frame))
            for record in pending:
                if previous is not None and not self._is_outgoing(previous, tells_senders):
                    yield stamps.next(_masked(previous), _masked(record)), previous[1]
                previous = record
            pending.clear()
        yield from self._rest(stamps, previous, pending, _tells_senders(low_bits))

    def _rest(
        self,
        stamps: _Stamps,
        previous: tuple[int, bytes] | None,
        pending: list[tuple[int, bytes]],
        tells_senders: bool,
    ) -> Iterator[tuple[int, bytes]]:
        records = [*([previous] if previous else []), *pending]
        for index, record in enumerate(records):
            if not self._is_outgoing(record, tells_senders):
                following = _masked(records[index + 1]) if index + 1 < len(records) else None
                yield stamps.next(_masked(record), following), record[1]

    def _is_outgoing(self, record: tuple[int, bytes], tells_senders: bool) -> bool:
        outgoing = tells_senders and record[0] & 3 == _SENT_BY_STATION
        self.counters["sent by the ground station"] += outgoing
        return outgoing

    def _records(self) -> Iterator[tuple[int, bytes, bool]]:
        """Microseconds, frame, and whether it is of the first block; resynchronised after damage."""
        data, first = b"", True
        while True:
            block = self.file.read(_BLOCK)
            data += block
            at, last = 0, not block
            while len(data) - at >= _RECORD_AT_MOST or (last and at < len(data)):
                end = record_end(data, at)
                if end is None:
                    goal = self._resync(data, at + 1, last)
                    self.counters["cut at the end" if last and goal == len(data) else "bytes skipped"] += goal - at
                    at = goal
                    continue
                yield int.from_bytes(data[at : at + 8], "big"), data[at + 8 : end], first
                at = end
            data, first = data[at:], first and at == 0
            if last:
                return

    def _resync(self, data: bytes, at: int, last: bool) -> int:
        """Where the next record begins at or after a place: one that is good by its checksum."""
        limit = len(data) if last else len(data) - _RECORD_AT_MOST
        while at < limit:
            ones = [place for place in (data.find(b"\xfd", at + 8), data.find(b"\xfe", at + 8)) if place >= 0]
            at = min(ones, default=len(data) + 8) - 8
            if at >= limit:
                return limit
            end = record_end(data, at)
            if end is not None:
                frame = parse(data[at + 8 : end])
                if frame is not None and frame.verdict == "good":
                    return at
            at += 1
        return max(at, limit) if last else at


def record_end(data: bytes, at: int) -> int | None:
    """Where the record at a place ends, if a record stands there: a sane stamp, a frame whose length brings us to the
    end or to the next frame's magic, or whose checksum is right.
    """
    start = at + 8
    if len(data) - start < 8 or int.from_bytes(data[at:start], "big") >= _MICROSECONDS_2200:
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


def _masked(record: tuple[int, bytes]) -> int:
    return (record[0] & ~3) * 1000


def _tells_senders(low_bits: set[int]) -> bool:
    return _SENT_BY_STATION in low_bits and len(low_bits) > 1
