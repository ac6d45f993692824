"""Whole .tlog files as NumPy columns: one structured array a message, and one of all frames. Every checksum is checked.

The same records, stamps and counters as TlogReader's. Layouts are pymavlink's own: payloads are padded with zeros, surplus
bytes are ignored, and what v1 cannot carry (extensions) is zero.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from adapters.framing import GOOD, VERDICTS, Bytes, windows
from adapters.mavlink_frames import definitions, message_name
from adapters.records import Records, read_records
from adapters.tlog import stamped

__all__ = ["FRAME", "VERDICTS", "Columns", "iter_columns", "message_dtype", "read_columns"]

Structured = NDArray[Any]
BLOCK_BYTES = 64 << 20

FRAME = np.dtype(
    [
        ("received_at", "<i8"),  # ns since 1970 UTC
        ("system", "u1"),
        ("component", "u1"),
        ("sequence", "u1"),
        ("version", "u1"),
        ("signed", "?"),
        ("length", "u1"),  # of the payload as it was sent
        ("verdict", "u1"),  # index into VERDICTS
        ("outgoing", "?"),  # sent by the ground station that recorded the file
        ("offset", "<i8"),  # of the frame in the file
        ("message", "<u4"),
        ("gap", "V4"),
    ]
)
# A row of a message begins with the same 16 bytes as a frame's, so that they are copied at once; these are named in it.
_HEAD = ("received_at", "system", "component", "sequence", "version", "signed")
_BODY_AT = 16  # of a row: where the payload begins
_HEAD_BYTES = np.dtype([("head", f"V{_BODY_AT}"), ("rest", f"V{FRAME.itemsize - _BODY_AT}")])
_TYPES = {
    "char": "S1",
    "float": "<f4",
    "double": "<f8",
    **{f"{sign}int{8 * size}_t": f"<{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)},
}


@dataclass(frozen=True)
class Columns:
    """`messages`: by name, those that are good and were not sent by the recording ground station, in order of the file.

    Their fields: `received_at` (ns since 1970 UTC), `system`, `component`, `sequence`, `version`, `signed`, then the
    message's own in their declared order and the wire's units (see `message_dtype`). `frames`: all frames in order of the
    file, dtype FRAME; without those that are `outgoing`, stamps are strictly increasing.
    """

    messages: Mapping[str, Structured]
    frames: Structured


@cache
def message_dtype(number: int) -> np.dtype[Any]:
    """The row of a message id. Arrays are subarrays, texts bytes; a field named as one of ours has "_" behind its name.

    Raises KeyError for an unknown id.
    """
    body = payload_dtype(number)
    fields: Mapping[str, Any] = body.fields or {}
    return np.dtype(
        {
            "names": [*_HEAD, *(f"{name}_" if name in _HEAD else name for name in fields)],
            "formats": [*(FRAME[name] for name in _HEAD), *(one[0] for one in fields.values())],
            "offsets": [*range(0, 1), *range(8, 13), *(one[1] + _BODY_AT for one in fields.values())],
            "itemsize": _BODY_AT + body.itemsize,
        }
    )


@cache
def datagram_dtype(number: int) -> np.dtype[Any]:
    """A whole unsigned MAVLink 2 frame of a message id, none of whose zeros are cut, with the fields of its payload."""
    payload = payload_dtype(number)
    fields: Mapping[str, Any] = payload.fields or {}
    return np.dtype(
        {
            "names": list(fields),
            "formats": [one[0] for one in fields.values()],
            "offsets": [10 + one[1] for one in fields.values()],
            "itemsize": payload.itemsize + 12,
        }
    )


@cache
def payload_dtype(number: int) -> np.dtype[Any]:
    """The whole payload of a message id, its fields in their declared order. Arrays are subarrays, texts bytes.

    Raises KeyError for an unknown id.
    """
    message = definitions()[number]
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    formats: dict[str, Any] = {}
    places: dict[str, int] = {}
    place = 0
    for name, repeats in zip(message.ordered_fieldnames, message.array_lengths, strict=True):
        if kinds[name] == "char":
            formats[name] = np.dtype(f"S{max(repeats, 1)}")
        else:
            one = np.dtype(_TYPES[kinds[name]])
            formats[name] = np.dtype((one, (repeats,))) if repeats else one
        places[name], place = place, place + formats[name].itemsize
    return np.dtype(
        {
            "names": message.fieldnames,
            "formats": [formats[name] for name in message.fieldnames],
            "offsets": [places[name] for name in message.fieldnames],
            "itemsize": place,
        }
    )


def read_columns(
    path_or_file: str | Path | BinaryIO,
    wanted: Collection[str | int] | None = None,
    counters: Counter[str] | None = None,
) -> Columns:
    """A whole .tlog. `wanted`: names or ids of the messages to unpack, None for all; `counters`: see TlogReader.

    Never raises for what is in the file; raises OSError where it cannot be read, KeyError for a wanted name that no message has.
    """
    return _joined([part for _, part in _parts(path_or_file, wanted, counters)])


def iter_columns(
    path_or_file: str | Path | BinaryIO,
    wanted: Collection[str | int] | None = None,
    counters: Counter[str] | None = None,
    *,
    block_bytes: int = BLOCK_BYTES,
) -> Iterator[Columns]:
    """The same in blocks of about so many bytes of the file, so that a file of any length takes the memory of one block."""
    parts: list[Columns] = []
    size = 0
    for read, part in _parts(path_or_file, wanted, counters):
        parts.append(part)
        size += read
        if size >= block_bytes:
            yield _joined(parts)
            size = 0
    if parts:
        yield _joined(parts)


def _parts(
    path_or_file: str | Path | BinaryIO, wanted: Collection[str | int] | None, counters: Counter[str] | None
) -> Iterator[tuple[int, Columns]]:
    """The columns of each block that is read, and the block's size in bytes."""
    kinds = _Kinds(wanted)
    counted = Counter[str]() if counters is None else counters
    with _opened(path_or_file) as file:
        for records, told, outgoing in stamped(read_records(file, counted), counted):
            yield len(records.data), _columns(records, told, outgoing, kinds)


def _opened(path_or_file: str | Path | BinaryIO) -> AbstractContextManager[BinaryIO]:
    """A file that was given stays open."""
    return Path(path_or_file).open("rb") if isinstance(path_or_file, str | Path) else nullcontext(path_or_file)


class _Kinds:
    """Wanted messages numbered from 0 by their ids; `of_message` finds the number of an id, -1 for what is not wanted."""

    def __init__(self, wanted: Collection[str | int] | None) -> None:
        known = definitions()
        numbers = {message.msgname: number for number, message in known.items()}
        chosen = known if wanted is None else {numbers[one] if isinstance(one, str) else one for one in wanted}
        self.ids = sorted(set(chosen) & set(known))
        self.names = [message_name(number) for number in self.ids]
        self._of_message = np.full(max(known) + 2, -1, np.int16)
        self._of_message[self.ids] = np.arange(len(self.ids))

    def of_message(self, messages: NDArray[np.uint32]) -> NDArray[np.int16]:
        """The number of each frame's kind."""
        return self._of_message[np.minimum(messages, len(self._of_message) - 1)]


def _columns(records: Records, told: NDArray[np.int64], outgoing: NDArray[np.bool_], kinds: _Kinds) -> Columns:
    frames = records.frames
    table = np.zeros(len(told), FRAME)
    table["received_at"], table["outgoing"] = told, outgoing
    table["offset"] = frames.start + records.offset
    for name in ("message", "length", "system", "component", "sequence", "version", "signed", "verdict"):
        table[name] = getattr(frames, name)
    kind = np.where((frames.verdict == GOOD) & ~outgoing, kinds.of_message(frames.message), -1).astype(np.int16)
    order = np.argsort(kind, kind="stable")
    bounds = np.searchsorted(kind[order], np.arange(len(kinds.ids) + 1))
    heads, payloads, lengths = table.view(_HEAD_BYTES)["head"][order], frames.payload[order], frames.length[order]
    messages = {}
    for index in np.flatnonzero(np.diff(bounds)).tolist():
        some = slice(bounds[index], bounds[index + 1])
        dtype = message_dtype(kinds.ids[index])
        messages[kinds.names[index]] = _unpacked(records.bytes, heads[some], payloads[some], lengths[some], dtype)
    return Columns(messages, table)


def _unpacked(
    block: Bytes, heads: Structured, payloads: NDArray[np.int64], lengths: Bytes, dtype: np.dtype[Any]
) -> Structured:
    size = dtype.itemsize - _BODY_AT
    found = np.empty(len(payloads), [("head", f"V{_BODY_AT}"), ("body", f"V{size}")])
    found["head"] = heads
    found["body"] = windows(block, size)[payloads]
    short = np.flatnonzero(lengths < size)
    if len(short):
        raw = found.view(np.uint8).reshape(len(payloads), dtype.itemsize)
        raw[short, _BODY_AT:] *= np.arange(size, dtype=np.uint8) < lengths[short, None]
    return found.view(dtype)


def _joined(parts: list[Columns]) -> Columns:
    """The parts end to end. They are let go one message after the other, so that their memory is used again."""
    if not parts:
        return Columns({}, np.empty(0, FRAME))
    tables, by_name = [part.frames for part in parts], [dict(part.messages) for part in parts]
    parts.clear()
    frames = _end_to_end(tables)
    tables.clear()
    names = sorted({name for messages in by_name for name in messages})
    return Columns({name: _end_to_end([one.pop(name) for one in by_name if name in one]) for name in names}, frames)


def _end_to_end(arrays: list[Structured]) -> Structured:
    dtype = arrays[0].dtype  # as bytes: field by field it takes ten times as long
    whole: Structured = np.concatenate([one.view(np.dtype((np.void, dtype.itemsize))) for one in arrays]).view(dtype)
    return whole
