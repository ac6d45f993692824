"""The .BIN file: ArduPilot's dataflash log, as entries of the kinds that are wanted.

    A3 95 type  body          one message; its length and the layout of its body come from a FMT message before it
    A3 95 80    type B, length B, name 4s, format 16s, columns 64s      FMT: one letter and one column name a value

Little-endian; no checksum. The letters are those of pymavlink's DFReader, which this reader agrees with on whole files. It
is a reader of its own because logs come damaged: DFReader indexes a file before it tells anything, writes what it stumbles
over to the terminal, and can end in an exception. This one reads in blocks, in flat memory, and goes on after damage one
byte later. A message counts as one where another header, or the end of the file, follows it.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO, NamedTuple

from pymavlink.DFReader import FORMAT_TO_STRUCT

from adapters.telling import LONGEST_US

HEADER = b"\xa3\x95"
_FMT = 0x80
_FMT_SIZE = 89
_LONGEST = 255
_BLOCK = 1 << 20
_TEXTS = ("Name", "Message")  # all other wanted columns are numbers; a column that is not what it should be is left out
_JUMP_US = 3600 * 10**6  # a time further than this from the one before is damage, unless the next one agrees
_MOMENT_AT_MOST = 4096  # entries

Values = dict[str, Any]


class Entry(NamedTuple):
    """One message of a log: its time since boot, its name, and the wanted columns that it has, in the log's units."""

    time_us: int
    name: str
    values: Values


@dataclass(slots=True)
class DataflashReader:
    """The wanted entries of a log in their order. `wanted`: for each name the columns.

    Counters: "bytes skipped", "cut at the end", "bad timestamps", "definitions not understood".
    """

    file: BinaryIO
    wanted: Mapping[str, tuple[str, ...]]
    counters: Counter[str] = field(default_factory=Counter)
    _sizes: dict[int, int] = field(default_factory=lambda: {_FMT: _FMT_SIZE})
    _readers: dict[int, Callable[[bytes], tuple[str, Values] | None]] = field(default_factory=dict)
    _last_us: int = -1
    _suspect_us: int = -1

    def moments(self) -> Iterator[list[Entry]]:
        """Entries that carry the same time, together."""
        moment: list[Entry] = []
        for entry in self:
            if moment and (entry.time_us != moment[0].time_us or len(moment) >= _MOMENT_AT_MOST):
                yield moment
                moment = []
            moment.append(entry)
        if moment:
            yield moment

    def __iter__(self) -> Iterator[Entry]:
        """Every wanted entry that has a time. Never raises for what the file holds."""
        for body in self._bodies():
            told = self._readers[body[2]](body)
            if told is None:
                continue
            name, values = told
            time_us = values.pop("TimeUS")
            if self._is_sane(time_us):
                yield Entry(time_us, name, values)
            else:
                self.counters["bad timestamps"] += 1

    def _is_sane(self, time_us: int) -> bool:
        if not 0 <= time_us < LONGEST_US:
            return False
        if self._last_us >= 0 and abs(time_us - self._last_us) > _JUMP_US:
            agrees = self._suspect_us >= 0 and abs(time_us - self._suspect_us) <= _JUMP_US
            self._suspect_us = time_us
            if not agrees:
                return False
        self._last_us, self._suspect_us = time_us, -1
        return True

    def _bodies(self) -> Iterator[bytes]:
        """The messages of wanted kinds, with their headers."""
        data, sizes, readers = b"", self._sizes, self._readers
        in_step = True
        while True:
            block = self.file.read(_BLOCK)
            data += block
            last, at = not block, 0
            limit = len(data) if last else len(data) - _LONGEST - 2
            while at < limit:
                size = sizes.get(data[at + 2]) if data[at : at + 2] == HEADER and at + 2 < len(data) else None
                end = at + (size or 0)
                if size is None or end > len(data) or data[end : end + 2] not in (HEADER, b"", b"\xa3"):
                    following = data.find(HEADER, at + 1)
                    goal = following if 0 <= following < limit else limit
                    self._skip(goal - at, in_step and last and goal == limit)
                    at, in_step = goal, False
                    continue
                kind = data[at + 2]
                if kind == _FMT:
                    self._define(data[at + 3 : end])
                elif kind in readers:
                    yield data[at:end]
                at, in_step = end, True
            data = data[at:]
            if last:
                return

    def _skip(self, number: int, at_the_end: bool) -> None:
        self.counters["cut at the end" if at_the_end else "bytes skipped"] += number

    def _define(self, body: bytes) -> None:
        """Take a FMT message in."""
        kind, size, name, letters, columns = struct.unpack("<BB4s16s64s", body)
        kinds = [FORMAT_TO_STRUCT.get(letter) for letter in _text(letters)]
        if kind == _FMT:
            return
        layout = struct.Struct("<" + "".join(one[0] for one in kinds if one is not None))
        if None in kinds or size != layout.size + 3:
            self.counters["definitions not understood"] += 1
            return
        self._sizes[kind] = size
        self._readers.pop(kind, None)
        names = _text(columns).split(",")
        if _text(name) in self.wanted and "TimeUS" in names and len(names) == len(kinds):
            scales = [one[1] for one in kinds if one is not None]
            self._readers[kind] = _reader(_text(name), self.wanted[_text(name)], layout, names, scales)


def _reader(
    name: str, wanted: tuple[str, ...], layout: struct.Struct, names: list[str], scales: list[float | None]
) -> Callable[[bytes], tuple[str, Values] | None]:
    """From a message's bytes to its name and values; numbers scaled, texts without their padding."""
    letters = layout.format.removeprefix("<")
    is_text = [letter.endswith("s") for letter in re.findall(r"\d*[a-zA-Z]", letters)]
    places = [
        (column, place, round(1 / scale) if (scale := scales[place]) else None)
        for column in ("TimeUS", *wanted)
        if column in names and is_text[place := names.index(column)] == (column in _TEXTS)
    ]

    def read(message: bytes) -> tuple[str, Values] | None:
        found = layout.unpack_from(message, 3)
        values: Values = {}
        for column, place, divisor in places:
            value = found[place]
            if divisor is not None:
                value = value / divisor
            elif isinstance(value, bytes):
                value = _text(value)
            values[column] = value
        return (name, values) if isinstance(values.get("TimeUS"), int) else None

    return read


def _text(padded: bytes) -> str:
    return padded.partition(b"\0")[0].decode("ascii", "replace")
