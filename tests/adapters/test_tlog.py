"""The .tlog file."""

import io
import random
from pathlib import Path

import pytest

from adapters.mavlink_frames import FrameEncoder, encode
from adapters.tlog import TlogReader, TlogWriter

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
T0 = 1_790_000_000_000_000  # microseconds


def _frame(number: int) -> bytes:
    return encode("SYSTEM_TIME", {"time_unix_usec": number + 1, "time_boot_ms": 7}, system=1, sequence=number)


def _file(stamps: list[int]) -> bytes:
    return b"".join(stamp.to_bytes(8, "big") + _frame(number) for number, stamp in enumerate(stamps))


def _read(data: bytes) -> tuple[list[int], list[bytes], TlogReader]:
    reader = TlogReader(io.BytesIO(data))
    found = list(reader)
    return [stamp for stamp, _ in found], [frame for _, frame in found], reader


class Records(list[bytes]):
    """Takes records as a file does."""

    def write(self, record: bytes) -> int:
        self.append(record)
        return len(record)


def test_what_was_written_reads_back_stamp_for_stamp_and_byte_for_byte() -> None:
    sink = Records()
    writer = TlogWriter(sink)
    written = [((T0 + gap * 4) * 1000, _frame(number)) for number, gap in enumerate((0, 1, 2, 10**9, 2 * 10**9))]
    for stamp, frame in written:
        writer.write(stamp, frame)
    assert len(sink) == len(written)  # one write a record: a file that is cut ends with a whole one
    assert list(TlogReader(io.BytesIO(b"".join(sink)))) == written


def test_stamps_that_repeat_are_made_to_increase_by_four_microseconds() -> None:
    stamps, _, _ = _read(_file([T0, T0, T0, T0 + 100]))
    assert stamps == [T0 * 1000, (T0 + 4) * 1000, (T0 + 8) * 1000, (T0 + 100) * 1000]


def test_the_low_two_bits_are_masked_and_alone_mean_nothing() -> None:
    stamps, frames, _ = _read(_file([T0 + 3, T0 + 103, T0 + 203]))
    assert stamps == [T0 * 1000, (T0 + 100) * 1000, (T0 + 200) * 1000]
    assert len(frames) == 3


def test_frames_of_the_ground_station_are_left_out_where_other_low_bits_occur_too() -> None:
    _, frames, reader = _read(_file([T0, T0 + 103, T0 + 200]))
    assert frames == [_frame(0), _frame(2)]
    assert reader.counters["sent by the ground station"] == 1


def test_a_single_mad_stamp_is_replaced_by_its_neighbours() -> None:
    stamps, frames, reader = _read(_file([T0, T0 + 100, 4, T0 + 300]))
    assert stamps == [T0 * 1000, (T0 + 100) * 1000, (T0 + 104) * 1000, (T0 + 300) * 1000]
    assert len(frames) == 4
    assert reader.counters["bad timestamps"] == 1


def test_a_clock_that_was_set_back_goes_on_from_where_it_was() -> None:
    hour = 3600 * 10**6
    stamps, _, reader = _read(_file([T0, T0 + 1000, T0 - hour, T0 - hour + 1000, T0 - hour + 2000]))
    assert [stamp // 1000 - T0 for stamp in stamps] == [0, 1000, 1004, 2000, 3000]
    assert reader.counters["clock set back"] == 1


def test_junk_between_records_loses_none_of_them() -> None:
    chance = random.Random(8)
    with EXCERPT.open("rb") as file:
        whole = list(TlogReader(file))
    pieces = [(stamp // 1000).to_bytes(8, "big") + frame for stamp, frame in whole]
    junk = [piece + (chance.randbytes(37) if number % 50 == 49 else b"") for number, piece in enumerate(pieces)]
    reader = TlogReader(io.BytesIO(b"".join(junk)))
    assert list(reader) == whole
    assert reader.counters["bytes skipped"] + reader.counters["cut at the end"] == len(whole) // 50 * 37


def test_a_file_cut_anywhere_keeps_every_whole_record() -> None:
    data = _file([T0 + 100 * number for number in range(5)])
    size = len(data) // 5
    for end in range(len(data)):
        _, frames, _ = _read(data[:end])
        assert frames == [_frame(number) for number in range(end // size)]


@pytest.mark.parametrize("junk", [b"", b"\0" * 100, b"\xfd" * 400, b"hello, this is no telemetry log at all" * 50])
def test_what_is_no_tlog_yields_nothing_and_never_raises(junk: bytes) -> None:
    assert _read(junk)[1] == []


def test_a_file_larger_than_a_block_reads_the_same() -> None:
    encoder = FrameEncoder(1)
    count = 40_000
    frames = [
        encoder.encode("SYSTEM_TIME", time_unix_usec=10**15 + number, time_boot_ms=number) for number in range(64)
    ]
    data = b"".join((T0 + 4 * n).to_bytes(8, "big") + frames[n % 64] for n in range(count))
    assert len(data) > 1 << 20
    stamps, found, reader = _read(data)
    assert stamps == [(T0 + 4 * number) * 1000 for number in range(count)]
    assert found == [frames[number % 64] for number in range(count)]
    assert not +reader.counters
