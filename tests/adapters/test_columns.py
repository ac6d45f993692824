"""Whole .tlog files as columns, held against TlogReader, and both against a plain reading of the rules, byte by byte."""

import io
import tracemalloc
from collections import Counter
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.columns import FRAME, VERDICTS, iter_columns, message_dtype, read_columns
from adapters.mavlink_frames import Frame, encode, parse
from adapters.tlog import TlogReader

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
T0 = 1_790_000_000_000_000  # microseconds
SANE = 7_258_118_400 * 10**6  # microseconds up to the year 2200
FRAMES = [frame for _, frame in TlogReader(io.BytesIO(EXCERPT.read_bytes()))][:400]
UNKNOWN = b"\xfd\x03\x00\x00\x07\x01\x01\x70\x11\x01abc\x51\x8a"  # an id that is in no definition
DIFFERS = bytes.fromhex("fd0400000701011e000001020304") + b"\x12\x34"


def _record(micros: int, frame: bytes) -> bytes:
    return micros.to_bytes(8, "big") + frame


def _file(frames: list[bytes]) -> bytes:
    return b"".join(_record(T0 + 100 * place, frame) for place, frame in enumerate(frames))


def _at(data: bytes, at: int) -> tuple[int, Frame | None, bool] | None:
    """What stands at a place, if a stamp and a frame that fits do: its end, the frame, whether the stamp is sane."""
    start = at + 8
    if start + 8 > len(data) or data[start] not in (0xFD, 0xFE):
        return None
    signed = data[start] == 0xFD and data[start + 2] & 1
    end = start + data[start + 1] + (8 if data[start] == 0xFE else 25 if signed else 12)
    if end > len(data):
        return None
    return end, parse(data[start:end]), int.from_bytes(data[at:start], "big") < SANE


def _begins_anew(data: bytes, at: int) -> bool:
    found = _at(data, at)
    return found is not None and found[2] and found[1] is not None and found[1].verdict == "good"


def _is_record(data: bytes, at: int) -> bool:
    """Whether a record stands here, right behind another one: the rules of adapters/records.py, read as they are written."""
    found = _at(data, at)
    if found is None:
        return False
    end, frame, is_sane = found
    verdict = "not a frame" if frame is None else frame.verdict
    if verdict == "good":
        return is_sane or at > 0
    if not is_sane:
        return False
    if verdict in ("unknown id", "definition differs") and not any(
        _begins_anew(data, one) for one in range(at + 1, end)
    ):
        return True
    behind = _at(data, end)
    could_be = behind is not None and behind[1] is not None and behind[1].verdict != "bad checksum"
    return end == len(data) or (could_be and behind is not None and (behind[2] or behind[1].verdict == "good"))  # type: ignore[union-attr]


def _plainly(data: bytes) -> tuple[list[int], dict[str, int]]:
    """Where the frames of a .tlog stand, and how many bytes were skipped."""
    at, skipped, told, places = 0, 0, Counter[str](), []
    while at < len(data):
        if _begins_anew(data, at) if skipped else _is_record(data, at):
            told["bytes skipped"] += skipped
            places.append(at + 8)
            at, skipped = _at(data, at)[0], 0  # type: ignore[index]
        else:
            at, skipped = at + 1, skipped + 1
    told["cut at the end"] = skipped
    return places, {reason: total for reason, total in told.items() if total}


PIECES = st.lists(
    st.one_of(
        st.sampled_from(FRAMES).map(lambda frame: _record(T0, frame)),
        st.sampled_from([_record(T0, UNKNOWN), _record(T0, DIFFERS), _record(1 << 63, FRAMES[3])]),
        st.binary(max_size=20),
        st.sampled_from([b"\xfd", b"\xfe\x00", b"\0\0\0\0\0\0\0\0\xfd", b"\0" * 8 + b"\xfe\x09\1\1\1\1"]),
    ),
    max_size=12,
)
DAMAGE = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), max_size=6)


@settings(max_examples=100)
@given(PIECES, DAMAGE, st.integers(1, 2000))
def test_damaged_files_are_read_by_the_rules(pieces: list[bytes], damage: list[tuple[float, int]], cut: int) -> None:
    """Both readers, however the file comes in pieces, find what a plain reading finds, and count what it counts."""
    data = bytearray(b"".join(pieces))
    for where, byte in damage if data else ():
        data[int(where * len(data))] = byte
    places, told = _plainly(bytes(data))
    counters = Counter[str]()
    frames = read_columns(_Slow(bytes(data), cut), counters=counters).frames
    assert frames["offset"].tolist() == places
    skipped = {reason: counters[reason] for reason in ("bytes skipped", "cut at the end") if counters[reason]}
    assert skipped == told
    reader = TlogReader(io.BytesIO(data))
    kept = frames[~frames["outgoing"]]
    found = list(reader)
    assert [stamp for stamp, _ in found] == kept["received_at"].tolist()
    assert all(data.startswith(frame, at) for (_, frame), at in zip(found, kept["offset"].tolist(), strict=True))
    assert +reader.counters == +counters
    for one in frames:
        taken = _at(bytes(data), int(one["offset"]) - 8)[1]  # type: ignore[index]
        assert VERDICTS[one["verdict"]] == ("not a frame" if taken is None else taken.verdict)


class _Slow(io.BytesIO):
    """A file that gives little at a time."""

    def __init__(self, data: bytes, at_most: int) -> None:
        super().__init__(data)
        self._at_most = at_most

    def read(self, size: int | None = -1) -> bytes:
        return super().read(self._at_most)


def test_a_real_recording_reads_the_same_as_columns_and_frame_by_frame() -> None:
    columns, data = read_columns(EXCERPT), EXCERPT.read_bytes()
    told = [
        (int(one["received_at"]), data[int(one["offset"]) : int(one["offset"]) + int(one["length"]) + 12])
        for one in columns.frames
    ]
    assert told == list(TlogReader(io.BytesIO(data)))
    assert sum(map(len, columns.messages.values())) == len(told)
    for name, rows in columns.messages.items():
        assert (np.diff(rows["received_at"]) > 0).all(), name


@pytest.mark.parametrize(
    "micros",
    [
        [0, 0, 0, 100, 100, 50],
        [0, 3, 6, 9, 13],
        [100, -4 * 10**9, 200, 300],
        [100, 200, -(10**10), -(10**10) + 50, -(10**10) + 70],
        [10**10, 3 * 10**6, 10**6, 0],
    ],
    ids=["repeats", "low bits", "one mad stamp", "set back", "falls"],
)
def test_stamps_are_mended_as_the_reader_mends_them(micros: list[int]) -> None:
    data = b"".join(_record(T0 + one, frame) for one, frame in zip(micros, FRAMES, strict=False))
    counters = Counter[str]()
    frames = read_columns(io.BytesIO(data), counters=counters).frames
    reader = TlogReader(io.BytesIO(data))
    assert frames["received_at"][~frames["outgoing"]].tolist() == [stamp for stamp, _ in reader]
    assert +counters == +reader.counters


def test_a_stamp_that_was_hit_does_not_cost_its_frame() -> None:
    """It cannot be a time, but it stands behind a record and its frame is good: it is told with its neighbour's time."""
    whole = _file(FRAMES[:5])
    at = sum(8 + len(frame) for frame in FRAMES[:2])
    counters = Counter[str]()
    frames = read_columns(io.BytesIO(whole[:at] + b"\xff" + whole[at + 1 :]), counters=counters).frames
    assert (frames["received_at"] // 1000 - T0).tolist() == [0, 100, 104, 300, 400]
    assert counters == {"bad timestamps": 1}


def test_what_the_ground_station_sent_is_a_frame_but_no_message() -> None:
    data = b"".join(_record(T0 + 100 * place + (3 if place == 2 else 0), FRAMES[place]) for place in range(5))
    columns = read_columns(io.BytesIO(data))
    assert columns.frames["outgoing"].tolist() == [False, False, True, False, False]
    assert sum(map(len, columns.messages.values())) == 4


def test_wanted_messages_by_name_or_id_and_no_others() -> None:
    columns = read_columns(EXCERPT, wanted=("ATTITUDE", 33))
    everything = read_columns(EXCERPT)
    assert sorted(columns.messages) == ["ATTITUDE", "GLOBAL_POSITION_INT"]
    assert (columns.messages["ATTITUDE"] == everything.messages["ATTITUDE"]).all()
    assert columns.frames.tolist() == everything.frames.tolist()
    with pytest.raises(KeyError):
        read_columns(EXCERPT, wanted=("ALTITUDES",))


def test_frames_of_damage_and_of_other_dialects_are_told_apart() -> None:
    frames = [FRAMES[0], UNKNOWN, FRAMES[1], FRAMES[2][:-1] + bytes([FRAMES[2][-1] ^ 85]), FRAMES[3]]
    verdicts = [one if one is None else one.verdict for one in map(parse, frames)]
    columns = read_columns(io.BytesIO(_file(frames)))
    assert [VERDICTS[one] for one in columns.frames["verdict"]] == verdicts
    assert sum(map(len, columns.messages.values())) == verdicts.count("good")


def test_a_field_that_is_named_as_one_of_ours_keeps_a_name() -> None:
    names = message_dtype(267).names
    assert names is not None
    assert names[3] == "sequence"
    assert "sequence_" in names


@pytest.mark.parametrize("junk", [b"", b"\0" * 100, b"\xfd" * 400, b"hello, this is no telemetry log at all" * 50])
def test_what_is_no_tlog_has_no_frames_and_never_raises(junk: bytes) -> None:
    columns = read_columns(io.BytesIO(junk))
    assert len(columns.frames) == 0
    assert columns.frames.dtype == FRAME
    assert columns.messages == {}


class _Repeated:
    """A long file: the same records again and again, made when they are read."""

    def __init__(self, part: bytes, times: int) -> None:
        self._part, self._left, self._rest = part, times, b""

    def read(self, size: int) -> bytes:
        while self._left and len(self._rest) < size:
            self._rest, self._left = self._rest + self._part, self._left - 1
        told, self._rest = self._rest[:size], self._rest[size:]
        return told


def _peak(file: Any, block_bytes: int) -> tuple[int, int]:
    """Frames, and the most memory that was held at a time."""
    tracemalloc.start()
    count = sum(len(columns.frames) for columns in iter_columns(file, block_bytes=block_bytes))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return count, peak


def test_in_blocks_a_file_of_any_length_takes_the_memory_of_one_block() -> None:
    part = EXCERPT.read_bytes()
    many = 20 * (1 << 20) // len(part)
    short, long = (_peak(_Repeated(part, times), 1 << 20) for times in (many // 4, many))
    assert long[0] > 3 * short[0]
    assert long[1] < 1.5 * short[1]  # a file that was held would take four times as much
    assert long[1] < 32 << 20


def test_blocks_end_to_end_are_the_whole() -> None:
    def file() -> BinaryIO:
        return io.BytesIO(EXCERPT.read_bytes() * 20)

    blocks, whole = list(iter_columns(file(), block_bytes=1 << 20)), read_columns(file())
    assert len(blocks) > 1
    assert np.concatenate([block.frames for block in blocks]).tolist() == whole.frames.tolist()
    for name, rows in whole.messages.items():
        assert sum(len(block.messages.get(name, ())) for block in blocks) == len(rows)


def test_text_comes_as_bytes() -> None:
    frame = encode("STATUSTEXT", {"severity": 6, "text": b"Ground start"}, system=1)
    assert read_columns(io.BytesIO(_file([frame]))).messages["STATUSTEXT"]["text"].tolist() == [b"Ground start"]
