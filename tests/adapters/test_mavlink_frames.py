"""The frame scanner, held against pymavlink's own parser."""

import random
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import FrameEncoder, FrameScanner, encode, fields, parse
from adapters.sequences import SequenceCheck
from adapters.tlog import TlogReader

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
POSITION: dict[str, Any] = {"lat": 1, "lon": 2, "alt": 3, "relative_alt": 4, "vx": 5, "vy": 6, "vz": 7, "hdg": 8}


def _frames() -> list[bytes]:
    with EXCERPT.open("rb") as file:
        return [frame for _, frame in TlogReader(file)]


def _various() -> list[bytes]:
    """Frames of both versions, signed and unsigned, with and without zeros at the payload's end."""
    encoder = FrameEncoder(3, 1)
    frames = []
    for number in range(40):
        frames.append(encoder.encode("GLOBAL_POSITION_INT", time_boot_ms=number, **POSITION))
        frames.append(encoder.encode("SYSTEM_TIME", time_unix_usec=number, time_boot_ms=0))
        frames.append(encode("ATTITUDE", _attitude(number), system=9, sequence=number, version=1))
        frames.append(_signed(number))
    return frames


def _attitude(number: int) -> dict[str, Any]:
    angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), number / 7)
    return {"time_boot_ms": number, **angles}


def _signed(number: int) -> bytes:
    link = dialect.MAVLink(None, srcSystem=4, srcComponent=1)
    link.signing.secret_key = bytes(32)
    link.signing.sign_outgoing = True
    link.signing.timestamp = number
    return bytes(dialect.MAVLink_system_time_message(number, 77).pack(link))


def _by_pymavlink(data: bytes) -> list[bytes]:
    link = dialect.MAVLink(None)
    link.robust_parsing = True
    return [bytes(message.get_msgbuf()) for message in link.parse_buffer(bytearray(data)) or []]


def test_on_a_whole_stream_the_scanner_finds_what_pymavlink_finds() -> None:
    stream = b"".join(_various() + _frames()[:800])
    assert FrameScanner().feed(stream) == _by_pymavlink(stream)


def test_payloads_decode_as_pymavlink_decodes_them() -> None:
    """Truncated zeros are filled up, extensions that v1 cannot carry are zero."""
    link = dialect.MAVLink(None)
    names = ("GPS_RAW_INT", "HOME_POSITION", "MISSION_ITEM_INT", "SIM_STATE", "HEARTBEAT", "GLOBAL_POSITION_INT")
    wanted = {"GPS_RAW_INT": ("time_usec", "h_acc"), "HOME_POSITION": ("altitude", "approach_z")}
    readers = {name: fields(name, *wanted.get(name, tuple(_class(name).fieldnames[:2]))) for name in names}
    seen = set()
    for frame in _frames():
        taken, message = parse(frame), link.decode(bytearray(frame))
        assert taken is not None
        name = message.get_type()
        if name in readers:
            number, read = readers[name]
            chosen = wanted.get(name, tuple(message.get_fieldnames()[:2]))
            expected = tuple(getattr(message, one) for one in chosen)
            assert taken.message == number
            assert repr(read(taken.payload)) == repr(expected)  # repr: NaN equals NaN
            seen.add(name)
    assert seen == set(names)


def _class(name: str) -> Any:
    return next(message for message in dialect.mavlink_map.values() if message.msgname == name)


@pytest.mark.parametrize("size", [1, 7, 64, 281, 4096])
def test_however_a_stream_is_cut_the_same_frames_come_out(size: int) -> None:
    frames = _various() + _frames()[:100]
    stream, scanner = b"".join(frames), FrameScanner()
    found = [frame for at in range(0, len(stream), size) for frame in scanner.feed(stream[at : at + size])]
    assert found == frames


def test_junk_between_frames_loses_none_of_them() -> None:
    """37 bytes of junk every 50 frames, many of them magic bytes."""
    chance, frames, stream = random.Random(5), _frames(), bytearray()
    for number, frame in enumerate(frames):
        stream += frame
        if number % 50 == 49:
            stream += bytes(chance.choice((0xFD, 0xFE, chance.randrange(256))) for _ in range(37))
    scanner = FrameScanner()
    assert scanner.feed(bytes(stream)) + scanner.finish() == frames
    assert scanner.counters["resynced bytes"] == len(frames) // 50 * 37


def test_a_damaged_frame_costs_itself_only() -> None:
    frames = _frames()[:60]
    broken = bytes([*frames[30][:-3], frames[30][-3] ^ 1, *frames[30][-2:]])
    scanner = FrameScanner()
    found = scanner.feed(b"".join([*frames[:30], broken, *frames[31:]])) + scanner.finish()
    assert found == frames[:30] + frames[31:]
    assert scanner.counters["crc error"] == 1


def test_a_length_that_was_damaged_does_not_swallow_the_frames_behind_it() -> None:
    frames = _frames()[:60]
    broken = bytes([frames[30][0], 255, *frames[30][2:]])
    scanner = FrameScanner()
    assert scanner.feed(b"".join([*frames[:30], broken, *frames[31:]])) + scanner.finish() == frames[:30] + frames[31:]


def test_what_is_left_of_a_datagram_never_reaches_the_next_one() -> None:
    frame, scanner = _frames()[0], FrameScanner()
    assert scanner.feed_datagram(frame[:12]) == []
    assert scanner.feed_datagram(frame[12:] + frame) == [frame]
    assert scanner.feed_datagram(frame[12:]) == []


def test_a_cut_frame_at_a_datagrams_end_does_not_hide_the_frames_within_it() -> None:
    """A magic byte in junk can promise a frame longer than the datagram."""
    frame, scanner = _frames()[0], FrameScanner()
    assert scanner.feed_datagram(b"\xfd\xff\x00" + frame) == [frame]


def test_what_the_scanner_holds_back_is_bounded() -> None:
    scanner = FrameScanner()
    for _ in range(200):
        scanner.feed(b"\xfd\xff\x01" + b"\xfe" * 997)
        assert len(scanner._held) < 300


def test_unknown_flags_discard_a_frame_and_only_that() -> None:
    frame, scanner = _frames()[0], FrameScanner()
    assert scanner.feed_datagram(frame[:2] + b"\x02" + frame[3:] + frame) == [frame]
    assert scanner.counters["incompatible flags"] == 1
    assert parse(frame[:2] + b"\x02" + frame[3:]) is None


def _with_extra(payload: bytes, number: int, extra: int) -> bytes:
    """A v2 frame of a message whose definition has this CRC extra."""
    from fastcrc.crc16 import mcrf4xx

    body = bytes([len(payload), 0, 0, 5, 1, 1]) + number.to_bytes(3, "little") + payload
    return b"\xfd" + body + mcrf4xx(bytes([extra]), mcrf4xx(body)).to_bytes(2, "little")


def test_frames_of_unknown_ids_are_found_and_told_from_damage() -> None:
    known, unknown = _frames()[0], _with_extra(b"some of another dialect", 70_001, 99)
    scanner = FrameScanner()
    assert scanner.feed_datagram(known + unknown + known) == [known, unknown, known]
    taken = parse(unknown)
    assert taken is not None
    assert taken.verdict == "unknown id"
    assert scanner.counters["resynced bytes"] == 0


def test_an_id_that_others_define_differently_is_no_damage() -> None:
    differs = _with_extra(b"\1" * 28, 33, 17)
    taken = parse(differs)
    assert taken is not None
    assert taken.verdict == "definition differs"
    assert FrameScanner().feed_datagram(differs) == [differs]


def test_the_encoder_counts_and_pymavlink_reads_what_it_writes() -> None:
    encoder = FrameEncoder(7, 2, sequence=255)
    frames = [encoder.encode("SYSTEM_TIME", time_unix_usec=10**15, time_boot_ms=5) for _ in range(2)]
    messages = [dialect.MAVLink(None).decode(bytearray(frame)) for frame in frames]
    assert [message.get_seq() for message in messages] == [255, 0]
    assert [(message.get_srcSystem(), message.get_srcComponent()) for message in messages] == [(7, 2)] * 2
    assert messages[0].time_unix_usec == 10**15


def _counted(numbers: list[int]) -> dict[str, int]:
    check, counters = SequenceCheck(), Counter[str]()
    for number in numbers:
        check.hear(number, 0, counters)
    return {reason: total for reason, total in counters.items() if total}


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ([254, 255, 0, 1], {}),
        ([1, 2, 5], {"lost": 2}),
        ([1, 2, 2, 3], {"duplicate": 1}),
        ([1, 2, 4, 3, 5], {"reordered": 1}),
        ([1, 2, 3, 4, 2, 5], {"duplicate": 1}),
        ([9, 9, 9], {"unsequenced": 2}),
    ],
    ids=["wrap", "gap", "duplicate", "reordered", "late duplicate", "unsequenced"],
)
def test_sequence_numbers_are_counted_modulo_256(numbers: list[int], expected: dict[str, int]) -> None:
    assert _counted(numbers) == expected


def test_two_messages_that_share_a_number_are_no_duplicate() -> None:
    """A radio's RADIO and RADIO_STATUS do."""
    check, counters = SequenceCheck(), Counter[str]()
    for number in range(3):
        check.hear(number, 166, counters)
        check.hear(number, 109, counters)
    assert not +counters


@pytest.mark.parametrize("name", ["copter-lossy-radio", "sub-five-components", "sitl-three-planes"])
def test_recorded_streams_come_through_whole(name: str) -> None:
    path = RECORDINGS / f"{name}.tlog"
    if not path.exists():
        pytest.skip(f"the recording {name}.tlog is not beside the project")
    with path.open("rb") as file:
        frames = [frame for _, frame in TlogReader(file)][:20_000]
    scanner = FrameScanner()
    found = scanner.feed(b"".join(frames)) + scanner.finish()
    lost = [frame for frame in frames if (taken := parse(frame)) is None or taken.verdict == "bad checksum"]
    assert len(found) == len(frames) - len(lost)
    assert len(lost) <= 4  # camera messages of another definition
