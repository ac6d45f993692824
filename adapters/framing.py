"""Many MAVLink frames at once: headers and checksums of all frames that begin at given places of a block of bytes.

The CRC takes two bytes a step: its register is 16 bits wide, so that the next state depends on (state xor next two bytes)
alone, one look-up in a table of 65 536. Frames are sorted by length and worked column by column, the longest first, so that
those that have ended drop out at the end of the arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.mavlink_frames import CRC_WORDS, LONGEST, V2, definitions

Bytes = NDArray[np.uint8]
Places = NDArray[np.int64]

VERDICTS = ("good", "unknown id", "definition differs", "bad checksum", "not a frame")
GOOD, UNKNOWN_ID, DIFFERS, BAD_CHECKSUM, NOT_A_FRAME = range(5)
ROOM = LONGEST + 3  # what a block must have behind the last place: see `padded`

_SIGNED = 1
_WIDTHS = (32, 64, 128, LONGEST + 3)  # rows of this many bytes are cut out for the frames that fit


def _one_byte() -> NDArray[np.uint16]:
    return np.array(CRC_WORDS, np.uint16)


def _two_bytes() -> NDArray[np.uint16]:
    one, state = _one_byte(), np.arange(65_536, dtype=np.uint16)
    for _ in range(2):
        state = one[state & 255] ^ state >> 8
    return state


def _which_byte() -> NDArray[np.int16]:
    which = np.full(65_536, -1, np.int16)
    which[_one_byte()] = np.arange(256)
    return which


def _extras() -> NDArray[np.int16]:
    known = definitions()
    extras = np.full(max(known) + 2, -1, np.int16)
    for number, message in known.items():
        extras[number] = message.crc_extra
    return extras


ONE_BYTE, TWO_BYTES, EXTRAS = _one_byte(), _two_bytes(), _extras()  # steps of the CRC; the extra of each id or -1
_WHICH = _which_byte()


@dataclass(frozen=True, slots=True)
class Headers:
    """Frames side by side, one element a frame. `end` is behind the frame, signature included; `fits`: it is in the block.

    Of a frame that does not fit nothing else holds. `verdict`: index into VERDICTS; "not a frame" has unknown flags.
    """

    start: Places
    end: Places
    fits: NDArray[np.bool_]
    version: Bytes
    length: Bytes
    signed: NDArray[np.bool_]
    sequence: Bytes
    system: Bytes
    component: Bytes
    message: NDArray[np.uint32]
    verdict: Bytes

    def __getitem__(self, which: Any) -> Headers:
        """Some of them: an index, a mask or a slice."""
        return Headers(*(getattr(self, name)[which] for name in self.__slots__))

    @property
    def payload(self) -> Places:
        """Where each payload begins."""
        return self.start + np.where(self.version == 2, 10, 6)


def padded(data: bytes) -> Bytes:
    """A block as an array with the room behind it that reading beyond a frame's end needs."""
    block = np.zeros(len(data) + ROOM, np.uint8)
    block[: len(data)] = np.frombuffer(data, np.uint8)
    return block


def headers(block: Bytes, size: int, start: Places) -> Headers:
    """The frames that begin at each place (a magic byte stands there) of a padded block of `size` bytes, checked."""
    head = rows(block, start, 10)
    is_v2 = head[:, 0] == V2
    v1 = np.flatnonzero(~is_v2)
    if len(v1):  # laid out as v2: no flags, and two more bytes of the id
        head[v1, 4:8], head[v1, 2], head[v1, 8:] = head[v1, 2:6], 0, 0
    length, flags = head[:, 1].astype(np.int64), head[:, 2]
    signed = flags & _SIGNED == 1
    end = start + length + np.where(is_v2, 12, 8)
    end[signed] += 13
    message: NDArray[np.uint32] = np.ascontiguousarray(head[:, 6:10]).view("<u4")[:, 0] >> np.uint32(8)
    fits = end <= size
    verdict = np.full(len(start), NOT_A_FRAME, np.uint8)
    checked = np.flatnonzero(fits & (flags <= _SIGNED))
    bodies = length[checked] + np.where(is_v2[checked], 9, 5)
    verdict[checked] = _verdicts(block, start[checked] + 1, bodies, message[checked])
    version = np.where(is_v2, np.uint8(2), np.uint8(1))
    return Headers(start, end, fits, version, head[:, 1], signed, head[:, 4], head[:, 5], head[:, 6], message, verdict)


def windows(block: Bytes, width: int) -> NDArray[np.void]:
    """`width` bytes from every place on, as one void element each; a view."""
    return np.ndarray(len(block) - width + 1, np.dtype((np.void, width)), block, strides=(1,))


def rows(block: Bytes, start: Places, width: int) -> Bytes:
    """`width` bytes from each place on, (places, width)."""
    return windows(block, width)[start].view(np.uint8).reshape(len(start), width)


def _verdicts(block: Bytes, start: Places, size: Places, message: NDArray[np.uint32]) -> Bytes:
    crc = checksums(block, start, size)
    told = rows(block, start + size, 2).view("<u2")[:, 0]
    which = _WHICH[told ^ crc >> 8]
    needed = np.where(which < 0, np.int16(-1), which ^ (crc & 255).astype(np.int16))
    ours = EXTRAS[np.minimum(message, len(EXTRAS) - 1)]
    verdict = np.where(ours < 0, UNKNOWN_ID, np.where(needed == ours, GOOD, DIFFERS))
    return np.where(which < 0, BAD_CHECKSUM, verdict).astype(np.uint8)


def checksums(block: Bytes, start: Places, size: Places) -> NDArray[np.uint16]:
    """The CRC-16/MCRF4XX of `size` bytes (at most LONGEST) from each place of a padded block on, without any extra."""
    odd = size & 1
    first = ONE_BYTE[block[start] ^ 0xFF] ^ np.uint16(0xFF)  # one byte on, so that the rest is a whole number of words
    crc = np.where(odd == 1, first, np.uint16(0xFFFF))
    begin, words = start + odd, (size >> 1).astype(np.uint16)
    order = np.argsort(words, kind="stable")[::-1]
    sizes, low = 2 * words[order].astype(np.int64), len(order)
    for width in _WIDTHS:
        high, low = low, int(np.searchsorted(-sizes, -width, side="left"))
        if low < high:
            some = order[low:high]
            crc[some] = _by_columns(rows(block, begin[some], width), words[some], crc[some])
    return crc


def _by_columns(cut: Bytes, words: NDArray[np.uint16], crc: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """`cut`: one row a frame, the longest first; `words`: how many pairs of bytes of each row count."""
    columns = np.ascontiguousarray(cut.view("<u2").T)
    longest = int(words[0]) if len(words) else 0
    going_on = np.searchsorted(-words.astype(np.int32), -np.arange(longest), side="left")
    for column, many in zip(columns, going_on.tolist(), strict=False):
        crc[:many] = TWO_BYTES.take(crc[:many] ^ column[:many])
    return crc
