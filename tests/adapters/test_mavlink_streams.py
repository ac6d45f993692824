"""Every way in which frames are read, held against pymavlink on all messages there are."""

import io
import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect
from pymavlink.generator.mavcrc import x25crc

from adapters.columns import read_columns
from adapters.frame_batches import NO_HEAD, frame_of, heads_of, payload_of, places_of, wanted
from adapters.mavlink_frames import FrameScanner, fields, padded, parse
from adapters.tlog import TlogReader

T0 = 1_790_000_000_000_000  # microseconds
MESSAGES: dict[int, Any] = dialect.mavlink_map


def _frame(number: int, payload: bytes, *, version: int, signed: bool = False, sequence: int = 7) -> bytes:
    if version == 2:
        head = bytes([len(payload), signed, 0, sequence, 3, 4]) + number.to_bytes(3, "little")
    else:
        head = bytes([len(payload), sequence, 3, 4, number])
    crc = x25crc(head + payload + bytes([MESSAGES[number].crc_extra])).crc
    return (b"\xfd" if version == 2 else b"\xfe") + head + payload + crc.to_bytes(2, "little") + bytes(13 * signed)


def _payload(chance: random.Random, size: int, kind: str) -> bytes:
    if kind == "truncated":
        return chance.randbytes(chance.randint(1, size))
    return chance.randbytes(min(size + 5, 255)) if kind == "surplus" else chance.randbytes(size)


def _frames(version: int, kind: str) -> list[bytes]:
    """One frame of random bytes of each message that the version can carry."""
    chance = random.Random(f"{version} {kind}")
    return [
        _frame(number, _payload(chance, message.unpacker.size, kind), version=version, signed=kind == "signed")
        for number, message in MESSAGES.items()
        if version == 2 or number < 256
    ]


STREAMS = [(2, "whole"), (2, "signed"), (2, "truncated"), (2, "surplus"), (1, "whole"), (1, "truncated")]
streams = pytest.mark.parametrize(("version", "kind"), STREAMS, ids=[f"v{version} {kind}" for version, kind in STREAMS])


def _reference(frames: list[bytes]) -> list[Any]:
    link = dialect.MAVLink(None)
    return [link.decode(bytearray(frame)) for frame in frames]


def _told(message: Any, name: str) -> Any:
    """A field as pymavlink read it: numbers, lists of them, texts as their bytes."""
    raw = getattr(message, f"_{name}_raw", None)
    return raw.rstrip(b"\0") if isinstance(raw, bytes) else getattr(message, name)


def _as_tlog(frames: list[bytes]) -> bytes:
    return b"".join((T0 + 4 * place).to_bytes(8, "big") + frame for place, frame in enumerate(frames))


@streams
def test_columns_hold_what_pymavlink_reads(version: int, kind: str) -> None:
    """Every field of every message, arrays and texts too; values are compared as they print, so that NaN equals NaN."""
    frames = _frames(version, kind)
    columns = read_columns(io.BytesIO(_as_tlog(frames)))
    assert (columns.frames["verdict"] == 0).all()
    for place, (frame, message) in enumerate(zip(frames, _reference(frames), strict=True)):
        rows = columns.messages[message.get_type()]
        names = rows.dtype.names[6:]
        assert len(rows) == 1
        assert [rows[0][name].tolist() for name in rows.dtype.names[:6]] == [
            *((T0 + 4 * place) * 1000, 3, 4, 7, version, bool(version == 2 and frame[2]))
        ]
        found = {name.removesuffix("_"): rows[0][name].tolist() for name in names}
        expected = {name: _told(message, name) for name in message.get_fieldnames()}
        assert repr(found) == repr(expected)


@streams
def test_readers_and_batches_read_what_pymavlink_reads(version: int, kind: str) -> None:
    """One by one and many at once give the same frames; a batch leaves alone what is signed or of version 1."""
    frames = _frames(version, kind)
    plain = version == 2 and kind != "signed"
    together = [
        None if head == NO_HEAD else frame_of(head, payload_of(frame, head >> 24))
        for frame, head in zip(frames, heads_of(frames).tolist(), strict=True)
    ]
    for frame, message, taken_together in zip(frames, _reference(frames), together, strict=True):
        taken, numbers = parse(frame), _numbers(message)
        assert taken is not None
        assert taken[:5] == (version, 3, 4, 7, message.get_msgId())
        assert (taken.verdict, taken.signed) == ("good", kind == "signed")
        assert taken_together == (taken if plain else None)
        if numbers:
            number, read = fields(message.get_type(), *numbers)
            assert number == message.get_msgId()
            assert repr(read(taken.payload)) == repr(tuple(getattr(message, name) for name in numbers))


def test_fields_come_in_the_order_in_which_they_are_asked_for() -> None:
    by_id = {message.get_msgId(): message for message in _reference(_frames(2, "whole"))}
    payloads = {frame[7]: frame[10:-2] for frame in _frames(2, "whole") if not any(frame[8:10])}
    for asked in (("lat", "hdg"), ("hdg", "lat"), ("hdg",)):
        number, read = fields("GLOBAL_POSITION_INT", *asked)
        assert read(padded(payloads[number], number)) == tuple(getattr(by_id[number], name) for name in asked)


def _numbers(message: Any) -> list[str]:
    """The fields that are single numbers."""
    return [name for name in message.get_fieldnames() if isinstance(getattr(message, name), int | float)]


def test_a_batch_takes_a_datagram_only_where_it_is_one_good_frame() -> None:
    good = _frames(2, "whole")[0]
    mixed = [
        b"",
        b"\xfd",
        good,
        good + good,
        good[:-1],
        good + b"\0",
        good[:12] + bytes([good[12] ^ 1]) + good[13:],
        good,
    ]
    mixed += [good[:2] + b"\2" + good[3:], good[:7] + b"\xff\xff\xff" + good[10:], _frames(1, "whole")[0]]
    heads = heads_of(mixed)
    assert [head != NO_HEAD for head in heads] == [one == good for one in mixed]
    assert places_of(heads, wanted([good[7]])).tolist() == [one == good for one in mixed]
    assert not places_of(heads, wanted(())).any()


def _many(count: int) -> list[bytes]:
    """Frames of all messages, no two alike in their neighbourhood."""
    chance, numbers = random.Random(4), sorted(MESSAGES)
    frames = []
    for place in range(count):
        number = numbers[place % len(numbers)]
        size = min(MESSAGES[number].unpacker.size, 40)
        version = 1 if number < 256 and place % 3 == 0 else 2
        frames.append(_frame(number, chance.randbytes(size), version=version, sequence=place & 255))
    return frames


COUNT = 50_000


def test_junk_every_500_frames_loses_nothing() -> None:
    """37 random bytes; in the .tlog, and in a stream."""
    chance, frames = random.Random(37), _many(COUNT)
    pieces = [(T0 + 4 * place).to_bytes(8, "big") + frame for place, frame in enumerate(frames)]
    junk = [chance.randbytes(37) if place % 500 == 499 else b"" for place in range(COUNT)]
    data = b"".join(piece + more for piece, more in zip(pieces, junk, strict=True))
    reader = TlogReader(io.BytesIO(data))
    assert list(reader) == [((T0 + 4 * place) * 1000, frame) for place, frame in enumerate(frames)]
    assert reader.counters.total() == 37 * (COUNT // 500)
    assert len(read_columns(io.BytesIO(data), wanted=()).frames) == COUNT
    scanner = FrameScanner()
    stream = b"".join(frame + more for frame, more in zip(frames, junk, strict=True))
    assert [*scanner.feed(stream), *scanner.finish()] == frames


def test_flipped_bits_lose_at_most_the_frames_that_they_hit() -> None:
    """One flip in a hundred frames, anywhere; every frame that was not hit comes out byte for byte, at its place."""
    frames = _many(COUNT)
    data, intact = _flipped(_as_tlog(frames), [8 + len(frame) for frame in frames])
    found = read_columns(io.BytesIO(data), wanted=()).frames
    ends = np.cumsum([8 + len(frame) for frame in frames])
    begins = ends - [len(frame) for frame in frames]
    assert np.isin(begins[intact], found["offset"]).all()
    assert len(found) <= COUNT
    told = [frame for _, frame in TlogReader(io.BytesIO(data))]
    assert _is_within([frames[place] for place in np.flatnonzero(intact)], told)
    assert len(told) == (~found["outgoing"]).sum()
    stream, intact = _flipped(b"".join(frames), [len(frame) for frame in frames])
    scanner = FrameScanner()
    scanned = [frame for at in range(0, len(stream), 4096) for frame in scanner.feed(stream[at : at + 4096])]
    scanned += scanner.finish()
    assert _is_within([frames[place] for place in np.flatnonzero(intact)], scanned)
    assert len(scanned) <= COUNT


def _flipped(data: bytes, sizes: list[int]) -> tuple[bytes, np.ndarray[Any, Any]]:
    """The data with one bit in a hundred pieces flipped, and which pieces were not hit."""
    chance, damaged = random.Random(500), bytearray(data)
    intact, ends = np.ones(len(sizes), bool), np.cumsum(sizes)
    for _ in range(len(sizes) // 100):
        at = chance.randrange(len(data))
        damaged[at] ^= 1 << chance.randrange(8)
        intact[np.searchsorted(ends, at, side="right")] = False
    return bytes(damaged), intact


def _is_within(some: list[bytes], told: list[bytes]) -> bool:
    """Whether some come in this order among what was told."""
    rest: Iterator[bytes] = iter(told)
    return all(frame in rest for frame in some)
