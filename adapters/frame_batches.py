"""Many datagrams at once: which of them are one good frame each, who sent it, and the fields of the messages that are wanted.

This is for what comes in thick: from some dozen datagrams on it takes a third of the time that one by one takes. A datagram that
is anything else than one good frame (several frames, damage, an unknown id) is for FrameScanner and `parse`.

A CRC can be run backwards: from its state behind the checksum, and the checksum, follows its state before it. So the CRC of
a whole datagram tells what that of its middle would be, and no datagram is cut to be checked.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Any

import numpy as np
from fastcrc.crc16 import mcrf4xx
from numpy.typing import NDArray

from adapters.framing import EXTRAS, ONE_BYTE, TWO_BYTES
from adapters.mavlink_frames import V2, definitions, parse

_V1_BIT = 1 << 8
_BEFORE_TWO = np.empty(65_536, np.uint16)
_BEFORE_TWO[TWO_BYTES] = np.arange(65_536)
_INITIAL = next(state for state in range(65_536) if int(ONE_BYTE[(state ^ V2) & 255]) ^ state >> 8 == 0xFFFF)


@dataclass(frozen=True, slots=True)
class FrameBatch:
    """Datagrams side by side, one element each. Where `is_good` is False nothing else holds.

    `layout`: message id << 9 | 1 << 8 if version 1 | length of the payload.
    """

    datagrams: Sequence[bytes]
    is_good: NDArray[np.bool_]
    sequence: NDArray[np.uint8]
    system: NDArray[np.uint8]
    component: NDArray[np.uint8]
    message: NDArray[np.int32]
    layout: NDArray[np.int64]


def take_datagrams(datagrams: Sequence[bytes]) -> FrameBatch:
    """Check many datagrams: which of them are one whole good frame."""
    count = len(datagrams)
    sizes = np.fromiter(map(len, datagrams), np.int64, count)
    block = np.frombuffer(b"".join((*datagrams, bytes(12))), np.uint8)
    start = np.cumsum(sizes)
    end = start.copy()
    start -= sizes
    head = np.ndarray(len(block) - 9, "V10", block, strides=(1,))[start].view(np.uint8).reshape(count, 10)
    message = head[:, 6:10].copy().view("<u4")[:, 0] >> 8
    message = message.astype(np.int32)
    plain = (head[:, 0] == V2) & (head[:, 2] == 0) & (sizes == head[:, 1] + np.int64(12))
    state = np.fromiter(map(mcrf4xx, datagrams, repeat(_INITIAL)), np.uint16, count)
    told = block[end - 2] | block[end - 1].astype(np.uint16) << 8
    crc = _BEFORE_TWO[state] ^ told
    ours = EXTRAS[np.minimum(message, len(EXTRAS) - 1)]
    is_good = plain & (ours >= 0) & (ONE_BYTE[(crc ^ ours) & 255] ^ crc >> 8 == told)
    batch = FrameBatch(
        datagrams, is_good, head[:, 4], head[:, 5], head[:, 6], message, message.astype(np.int64) << 9 | head[:, 1]
    )
    for index in np.flatnonzero(~plain).tolist():
        _one(batch, index)
    return batch


def _one(batch: FrameBatch, index: int) -> None:
    frame = parse(batch.datagrams[index])
    if frame is None or frame.verdict != "good":
        return
    batch.is_good[index] = True
    batch.sequence[index], batch.system[index], batch.component[index] = frame.sequence, frame.system, frame.component
    batch.message[index] = frame.message
    batch.layout[index] = frame.message << 9 | (_V1_BIT if frame.version == 1 else 0) | len(frame.payload)


class FieldReaders:
    """Reads the wanted fields of the wanted messages, None for all fields of all.

    Values come in the order of the wire, which `names` tells: numbers, texts as bytes, an array as its elements.
    Raises KeyError for an unknown name.
    """

    def __init__(self, wanted: Mapping[str, Sequence[str]] | None = None) -> None:
        messages = {message.msgname: message for message in definitions().values()}
        chosen = {name: messages[name].ordered_fieldnames for name in messages} if wanted is None else wanted
        self.names: dict[int, tuple[str, ...]] = {}
        self._structs: dict[int, struct.Struct] = {}
        for name, fields in chosen.items():
            number = int(messages[name].id)
            self.names[number], self._structs[number] = _chosen(messages[name], set(fields))
        self._is_wanted = np.zeros(len(EXTRAS), np.bool_)
        self._is_wanted[list(self._structs)] = True
        self._layouts = _Layouts(self._structs)

    def read(self, batch: FrameBatch) -> tuple[list[int], list[tuple[Any, ...]]]:
        """Which datagrams hold a wanted message, and its values."""
        which = np.flatnonzero(batch.is_good & self._is_wanted[np.minimum(batch.message, len(EXTRAS) - 1)])
        places, layouts, datagrams = which.tolist(), self._layouts, batch.datagrams
        values = []
        for place, layout in zip(places, batch.layout[which].tolist(), strict=True):
            unpack, payload, zeros = layouts[layout]
            values.append(unpack(datagrams[place][payload] + zeros))
        return places, values


class _Layouts(dict[int, tuple[Callable[[bytes], tuple[Any, ...]], slice, bytes]]):
    """How to read a payload: made when it is first met, for one id, version and length."""

    def __init__(self, structs: Mapping[int, struct.Struct]) -> None:
        self._structs = structs

    def __missing__(self, layout: int) -> tuple[Callable[[bytes], tuple[Any, ...]], slice, bytes]:
        one, length = self._structs[layout >> 9], layout & 255
        begin, told = (6 if layout & _V1_BIT else 10), min(length, one.size)
        self[layout] = found = (one.unpack, slice(begin, begin + told), bytes(one.size - told))
        return found


def _chosen(message: Any, wanted: set[str]) -> tuple[tuple[str, ...], struct.Struct]:
    """The names and the layout of some fields of a message, the others skipped."""
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    formats, names = ["<"], list[str]()
    parts = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)  # one a field
    for name, repeats, part in zip(message.ordered_fieldnames, message.array_lengths, parts, strict=True):
        if name not in wanted:
            formats.append(f"{struct.calcsize('<' + part)}x")
            continue
        formats.append(part)
        is_array = repeats > 0 and kinds[name] != "char"
        names += [f"{name}[{index}]" for index in range(repeats)] if is_array else [name]
    if missing := wanted - set(kinds):
        raise KeyError(f"{message.msgname} has no field {', '.join(sorted(missing))}")
    return tuple(names), struct.Struct("".join(formats))
