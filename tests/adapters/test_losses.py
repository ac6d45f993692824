"""Every loss under its own name: streams with known faults, and what the counters say of them."""

from hypothesis import given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import encode

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
LINK = Source(0, "mavlink", "link", "udpin:0")
WANTED, UNWANTED = "ATTITUDE", "SERVO_OUTPUT_RAW"  # of which the decoder reads the first, and only counts the second


def _frame(name: str, sequence: int, component: int = 1, boot_ms: int | None = None) -> bytes:
    boot_ms = 10_000 + 10 * sequence if boot_ms is None else boot_ms
    if name == WANTED:
        angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.1)
        return encode(WANTED, {"time_boot_ms": boot_ms, **angles}, system=1, component=component, sequence=sequence)
    values = {"time_usec": boot_ms * 1000, "port": 0} | {f"servo{number}_raw": 1500 for number in range(1, 9)}
    return encode(UNWANTED, values, system=1, component=component, sequence=sequence)


def _counters(frames: list[bytes]) -> dict[str, int]:
    decoder = Decoder([LINK])
    for number, frame in enumerate(frames):
        decoder.feed(Arrival(T0 + number * 4_000_000, 0, frame))
    return {reason.removeprefix("link "): total for reason, total in decoder.counters().items()}


def _stream(numbers: list[int], name: str = UNWANTED) -> list[bytes]:
    return [_frame(name, number & 255, boot_ms=10_000 + 10 * number) for number in numbers]


def test_a_stream_without_faults_has_none_over_the_end_of_its_sequence_numbers() -> None:
    for name in (WANTED, UNWANTED):
        assert _counters(_stream(list(range(700)), name)) == {"frames": 700}


def test_gaps_are_lost_frames_also_over_the_end_of_the_sequence_numbers() -> None:
    for name in (WANTED, UNWANTED):
        kept = [number for number in range(600) if number not in (10, 11, 12, 255, 256, 300)]
        assert _counters(_stream(kept, name)) == {"frames": 594, "lost": 6}


def test_duplicates_and_late_frames_are_told_from_losses() -> None:
    assert _counters(_stream([0, 1, 2, 2, 3, 4, 4, 5])) == {"frames": 8, "duplicate": 2}
    assert _counters(_stream([0, 1, 2, 4, 5, 6, 3, 7])) == {"frames": 8, "reordered": 1}
    assert _counters(_stream([0, 1, 2, 4, 5, 3, 6, 3, 7])) == {"frames": 9, "reordered": 1, "duplicate": 1}


def test_a_source_that_never_counts_is_unsequenced_and_loses_nothing() -> None:
    frames = [_frame(UNWANTED, 0, boot_ms=10_000 + number) for number in range(50)]
    assert _counters(frames) == {"frames": 50, "unsequenced": 49}


def test_each_component_counts_for_itself() -> None:
    frames = []
    for number in range(300):
        frames.append(_frame(UNWANTED, number & 255, 1))
        if number % 3 == 0:
            frames.append(_frame(UNWANTED, number // 3, 154))
    assert _counters(frames) == {"frames": 400}


def test_damage_another_dialect_and_an_unknown_message_are_told_apart() -> None:
    good = _stream(list(range(20)))
    damaged = bytearray(good[5])
    damaged[14] ^= 0x10
    damaged[15] ^= 0x37
    unknown = bytearray(_frame(UNWANTED, 20))
    unknown[7:10] = (60_001).to_bytes(3, "little")
    differs = _with_extra(_frame(WANTED, 21), 77)
    counted = _counters([*good[:5], bytes(damaged), *good[6:], _with_extra(bytes(unknown), 5), differs])
    assert counted == {"frames": 22, "crc error": 1, "unknown id": 1, "definition differs": 1}


def _with_extra(frame: bytes, extra: int) -> bytes:
    from fastcrc.crc16 import mcrf4xx

    return frame[:-2] + mcrf4xx(bytes([extra]), mcrf4xx(frame[1:-2])).to_bytes(2, "little")


def test_a_date_that_is_none_is_a_bad_time_and_a_missing_one_is_not() -> None:
    frames = []
    for number, usec in enumerate((0, 5_000_000, 1_170_000_000 * 10**6, 2**63, 0)):
        values = {"time_unix_usec": usec, "time_boot_ms": 10_000 + number}
        frames.append(encode("SYSTEM_TIME", values, system=1, sequence=number))
    assert _counters(frames) == {"frames": 5, "bad time": 2}


def test_frames_of_nobody_and_no_frames_are_counted_as_such() -> None:
    nobody = encode("SYSTEM_TIME", {"time_unix_usec": 0, "time_boot_ms": 1}, system=0)
    assert _counters([nobody, b"\xfd\x00", nobody[:-1]]) == {"frames": 1, "system 0": 1, "not a frame": 2}


@given(st.lists(st.tuples(st.integers(0, 255), st.sampled_from((1, 154)), st.booleans()), max_size=80))
@settings(max_examples=60)
def test_frames_that_are_only_counted_are_counted_as_all_others(sent: list[tuple[int, int, bool]]) -> None:
    """MAVLink 1 frames of the same numbers take the long way, and come to the same counters."""
    short, long = [], []
    for sequence, component, damaged in sent:
        values = {"time_usec": 1, "port": 0} | {f"servo{number}_raw": 1500 for number in range(1, 9)}
        for version, frames in ((2, short), (1, long)):
            frame = encode(UNWANTED, values, system=1, component=component, sequence=sequence, version=version)
            frames.append(frame[:-1] + bytes([frame[-1] ^ 0x55]) if damaged else frame)
    counted, expected = _counters(short), _counters(long)
    checks = ("crc error", "definition differs", "unknown id")  # one damaged frame in 256 passes for a known one's
    assert {reason: total for reason, total in counted.items() if reason not in checks} == {
        reason: total for reason, total in expected.items() if reason not in checks
    }
