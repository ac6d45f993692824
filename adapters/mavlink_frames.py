"""MAVLink frames: found in bytes, checked, taken apart, and made. Definitions are pymavlink's own tables (dialect "all").

    v2   FD length incompat compat sequence system component id[3] payload checksum[2] (signature[13] if incompat bit 0)
    v1   FE length sequence system component id payload checksum[2]

Little-endian. Checksum: CRC-16/MCRF4XX over everything after the magic and before the checksum, then over the message's CRC
extra. v2 cuts trailing zeros of the payload; v1 carries no extensions: a payload is padded with zeros, surplus is ignored.

A frame whose id is not known, or whose definition differs from ours, cannot be checked against its CRC extra. But the
checksum itself tells which extra byte would make it right, and for 255 of 256 damaged frames none does. So such a frame
is taken as a frame where some extra byte fits and where the stream goes on with a magic byte; else it is damage.
"""

from __future__ import annotations

import re
import struct
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from operator import itemgetter
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple, cast

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import all as dialect

V2, V1 = 0xFD, 0xFE
_SIGNED = 0x01
LONGEST = 280 + 13

_MESSAGES: dict[int, Any] = dialect.mavlink_map
_EXTRA: dict[int, int] = {number: message.crc_extra for number, message in _MESSAGES.items()}
WHOLE_SIZES: dict[int, int] = {number: message.unpacker.size for number, message in _MESSAGES.items()}
ZEROS = tuple(bytes(number) for number in range(256))
_NUMBERS: dict[str, int] = {message.msgname: number for number, message in _MESSAGES.items()}


def _crc_words() -> tuple[int, ...]:
    """What one byte adds to a CRC: the reflected polynomial's 256 words."""
    words = []
    for byte in range(256):
        word = byte
        for _ in range(8):
            word = word >> 1 ^ (0x8408 if word & 1 else 0)
        words.append(word)
    return tuple(words)


CRC_WORDS = _crc_words()
_BYTE_OF_WORD = {word: byte for byte, word in enumerate(CRC_WORDS)}


class Frame(NamedTuple):
    """One frame taken apart. Only one whose verdict is "good" may be decoded. The payload is `padded`.

    Other verdicts: "unknown id" and "definition differs" (some CRC extra fits, but not ours), "bad checksum" (none does).
    """

    version: int
    system: int
    component: int
    sequence: int
    message: int
    payload: bytes
    signed: bool
    verdict: str


def _is_good(body: bytes, extra: int, checksum: int) -> bool:
    crc: int = mcrf4xx(body)
    return CRC_WORDS[crc & 255 ^ extra] ^ crc >> 8 == checksum


def fits_some_extra(body: bytes, checksum: int) -> bool:
    """Whether any CRC extra makes this checksum right: true for every intact frame, for 1 of 256 damaged ones."""
    crc = mcrf4xx(body)
    return (checksum ^ crc >> 8) in _BYTE_OF_WORD


def parse(frame: bytes) -> Frame | None:
    """One whole frame taken apart; None where it is no frame, cut, or has unknown flags. Never raises."""
    size = len(frame)
    if size < 8:
        return None
    if frame[0] == V2 and size >= 12:
        length, flags, sequence, system, component, low, high = _V2_HEADER(frame)
        if flags > _SIGNED or size != length + (25 if flags else 12):
            return None
        version, start, message = 2, 10, low | high << 16
    elif frame[0] == V1 and size == frame[1] + 8:
        version, start, flags = 1, 6, 0
        length, sequence, system, component, message = _V1_HEADER(frame)
    else:
        return None
    end = start + length
    crc, told = mcrf4xx(frame[1:end]), frame[end] | frame[end + 1] << 8
    extra = _EXTRA.get(message)
    if extra is not None and CRC_WORDS[crc & 255 ^ extra] ^ crc >> 8 == told:
        verdict = "good"
    elif told ^ crc >> 8 in _BYTE_OF_WORD:
        verdict = "unknown id" if extra is None else "definition differs"
    else:
        verdict = "bad checksum"
    # in the order of Frame, whose own constructor takes twice as long
    payload = padded(frame[start:end], message)
    return new_frame((version, system, component, sequence, message, payload, flags == _SIGNED, verdict))


def padded(payload: bytes, message: int) -> bytes:
    """A payload with the zeros that MAVLink 2 has cut from its end, and those of the extensions that version 1 lacks."""
    missing = WHOLE_SIZES.get(message, 0) - len(payload)
    return payload + ZEROS[missing] if missing > 0 else payload


_V2_HEADER = struct.Struct("<xBBxBBBHB").unpack_from
_V1_HEADER = struct.Struct("<xBBBBB").unpack_from
new_frame: Callable[[Any], Frame] = partial(tuple.__new__, Frame)


@dataclass(slots=True)
class FrameScanner:
    """Finds the frames of one peer's bytes. One scanner a peer: nothing of one peer ever completes another's frame.

    After damage it goes on one byte later, so that no intact frame is lost. What it holds back is less than one frame.
    Counters: "crc error", "resynced bytes", "incompatible flags", "leftover bytes".
    """

    counters: Counter[str] = field(default_factory=Counter)
    _held: bytes = b""
    _in_step: bool = True  # the byte before was the end of a frame

    def feed(self, data: bytes) -> list[bytes]:
        """The whole frames in a stream that goes on: what is incomplete waits for the next bytes."""
        return self._scan(self._held + data if self._held else data, last=False)

    def feed_datagram(self, data: bytes) -> list[bytes]:
        """The whole frames of one datagram; what is left over at its end is dropped and counted."""
        self._in_step = True
        size = len(data)
        if size >= 12 and data[0] == V2 and data[2] == 0 and size == data[1] + 12:  # one frame, as most senders do
            extra, crc = _EXTRA.get(data[7] | data[8] << 8 | data[9] << 16), mcrf4xx(data[1:-2])
            if extra is not None and CRC_WORDS[crc & 255 ^ extra] ^ crc >> 8 == data[-2] | data[-1] << 8:
                return [data]
        return self._scan(data, last=True)

    def finish(self) -> list[bytes]:
        """The stream has ended, or has paused for so long that what is held back cannot be a frame's beginning."""
        return self._scan(self._held, last=True)

    def _scan(self, data: bytes, *, last: bool) -> list[bytes]:
        frames: list[bytes] = []
        extras, size, at = _EXTRA, len(data), 0
        while at + 8 <= size:  # the shortest frame
            if data[at] == V2 and at + 12 <= size and data[at + 2] <= _SIGNED:
                end = at + data[at + 1] + 10
                after = end + 15 if data[at + 2] else end + 2
                extra = extras.get(data[at + 7] | data[at + 8] << 8 | data[at + 9] << 16)
            elif data[at] == V1:
                end = at + data[at + 1] + 6
                after = end + 2
                extra = extras.get(data[at + 5])
            elif data[at] == V2 and at + 12 > size and not last:
                break
            else:
                at = self._step(data, at)
                continue
            if after > size:
                if not last:
                    break
                at = self._step(data, at)
            elif extra is not None and _is_good(data[at + 1 : end], extra, data[end] | data[end + 1] << 8):
                frames.append(data[at:after])
                self._in_step = True
                at = after
            elif not last and after == size and self._in_step:
                break  # whether this is a frame shows in the byte after it
            elif self._goes_on(data, at, end, after):
                frames.append(data[at:after])
                at = after
            else:
                self.counters["crc error"] += self._in_step
                at = self._step(data, at)
        return self._leave(data, at, last, frames)

    def _goes_on(self, data: bytes, at: int, end: int, after: int) -> bool:
        """Whether this is a frame that we cannot check: in step before and after, and some CRC extra fits."""
        if not self._in_step or (after < len(data) and data[after] not in (V1, V2)):
            return False
        return fits_some_extra(data[at + 1 : end], data[end] | data[end + 1] << 8)

    def _step(self, data: bytes, at: int) -> int:
        """To the next byte that can begin a frame."""
        if self._in_step and data[at] == V2 and len(data) > at + 2 and data[at + 2] > _SIGNED:
            self.counters["incompatible flags"] += 1
        self._in_step = False
        ones = [place for place in (data.find(b"\xfd", at + 1), data.find(b"\xfe", at + 1)) if place > 0]
        goal = min(ones, default=len(data))
        self.counters["resynced bytes"] += goal - at
        return goal

    def _leave(self, data: bytes, at: int, last: bool, frames: list[bytes]) -> list[bytes]:
        if last:
            self._held = b""
            self._in_step = True
            self.counters["leftover bytes"] += len(data) - at
        else:
            self._held = data[at:]
        return frames


def fields(name: str, *wanted: str) -> tuple[int, Callable[[bytes], tuple[Any, ...]]]:
    """The id of a message and a function from its whole (`padded`) payload to the wanted fields (at least two), in that order.

    Fields are numbers, texts are bytes; of an array one element each: "covariance[7]". In the order of the wire is fastest.
    """
    message = _MESSAGES[_NUMBERS[name]]
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    formats, order = ["<"], list[str]()
    parts = re.findall(r"\d*[a-zA-Z]", message.unpacker.format)  # one a field
    for field_name, repeats, part in zip(message.ordered_fieldnames, message.array_lengths, parts, strict=True):
        is_array = repeats > 0 and kinds[field_name] != "char"  # a text is one value, an array many
        for index in range(repeats if is_array else 1):
            told = f"{field_name}[{index}]" if is_array and f"{field_name}[{index}]" in wanted else field_name
            code = part[-1] if is_array else part
            is_wanted = told in wanted and (index == 0 or told != field_name)
            formats.append(code if is_wanted else f"{struct.calcsize('<' + code)}x")
            order += [told] if is_wanted else []
    unpack: Callable[[bytes], tuple[Any, ...]] = struct.Struct("".join(formats)).unpack_from
    if order == list(wanted):
        return int(message.id), unpack
    pick = itemgetter(*(order.index(one) for one in wanted))
    return int(message.id), lambda payload: cast("tuple[Any, ...]", pick(unpack(payload)))


def definitions() -> Mapping[int, Any]:
    """pymavlink's class of each message id that we know."""
    return MappingProxyType(_MESSAGES)


def message_name(number: int) -> str:
    """The name of a message id, or the number itself where we do not know it."""
    return str(_MESSAGES[number].msgname) if number in _MESSAGES else str(number)


def encode(
    name: str, values: dict[str, Any], *, system: int, component: int = 1, sequence: int = 0, version: int = 2
) -> bytes:
    """The bytes of one frame, packed by pymavlink itself. `values` are its fields in the wire's units.

    Raises KeyError for an unknown message, TypeError for wrong field names, struct.error for values that do not fit.
    """
    link = SimpleNamespace(
        seq=sequence & 255, srcSystem=system, srcComponent=component, signing=SimpleNamespace(sign_outgoing=False)
    )
    message = _MESSAGES[_NUMBERS[name]](**values)
    packed: bytes = message.pack(link, force_mavlink1=version == 1)
    return packed


@dataclass(slots=True)
class FrameEncoder:
    """Frames of one component with its running sequence number."""

    system: int
    component: int = 1
    sequence: int = 0

    def encode(self, name: str, **values: Any) -> bytes:
        """The next frame; see `encode`."""
        frame = encode(name, values, system=self.system, component=self.component, sequence=self.sequence)
        self.sequence = self.sequence + 1 & 255
        return frame
