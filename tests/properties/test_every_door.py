"""Every door from bytes, whatever the bytes: nothing raises but the one error that it names, and numbers are numbers.

Quick, and shrinks what it finds. The long run over the same doors, with what reaches further in, is `make fuzz`.
"""

import io
import math
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from fastcrc.crc16 import mcrf4xx
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source, told
from adapters.columns import read_columns
from adapters.dataflash import DataflashFrames
from adapters.dataflash_identity import identity_of
from adapters.decode import Decoder
from adapters.epoch import SessionEpoch
from adapters.kinds import FileError, kind_of
from adapters.landing_radar import Header, Plot, encode
from adapters.mavlink import MavlinkObserver
from adapters.mavlink_frames import FrameEncoder, FrameScanner, definitions, parse
from adapters.mission_files import MissionFileError, read_mission
from adapters.pcap import PcapReader, PcapWriter, is_capture
from adapters.signing import SigningGuard, sign
from adapters.tlog import TlogReader
from adapters.ulog import UlogDamaged, UlogFrames
from gateway import pipeline
from gateway.observation import GpsReport
from gateway.runtime.commands import read_commands
from gateway.runtime.intake import Intake
from gateway.runtime.links import Chunks
from gateway.runtime.manners import Manners
from gateway.runtime.stamps import Stamper
from gateway.settings import DEMO_SITE

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
TESTS = Path(__file__).parents[1]
KEY = bytes(range(32))
TLOG = (TESTS / "data" / "sitl-landing-excerpt.tlog").read_bytes()[:12_000]
BIN = (TESTS / "data" / "sitl-landing-excerpt.BIN").read_bytes()[:30_000]
FRAMES = [frame for _, frame in TlogReader(io.BytesIO(TLOG))]
WANTED = sorted(MavlinkObserver(SessionEpoch()).wanted)
QUICK = settings(max_examples=40, suppress_health_check=list(HealthCheck))


def _plots(number: int) -> bytes:
    time = T0 + number * SECOND // 5
    return encode(Header("plots", 1, number, time), [Plot(1 + number % 2, time, 9000.0 - number, 0.5, 3.0)])


def _capture() -> bytes:
    sink = io.BytesIO()
    writer = PcapWriter(sink)
    for number, frame in enumerate(FRAMES[:40]):
        writer.write(
            T0 + number * SECOND // 5, frame if number % 3 else _plots(number), f"10.0.0.{1 + (number % 3 > 0)}:5"
        )
    return sink.getvalue()


def _capture_ng() -> bytes:
    """What tshark would make of it: a section, an interface that counts microseconds, a block for each packet."""
    parts = [(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)), (1, struct.pack("<HHI", 101, 0, 65535))]
    content = _capture()
    at = 24
    while at < len(content):
        seconds, micros, kept, size = struct.unpack_from(">IIII", content, at)
        ticks = seconds * 10**6 + micros
        packet = content[at + 16 : at + 16 + kept]
        head = struct.pack("<IIIII", 0, ticks >> 32, ticks & 0xFFFFFFFF, kept, size)
        parts.append((6, head + packet + bytes(-kept % 4)))
        at += 16 + kept
    return b"".join(
        struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12) for kind, body in parts
    )


CAPTURE, CAPTURE_NG = _capture(), _capture_ng()
ULOG = b"".join(
    (
        b"ULog\x01\x12\x35\x01" + bytes(8),
        struct.pack("<HB", 66, ord("F"))
        + b"vehicle_global_position:uint64_t timestamp;double lat;double lon;"[:66].ljust(66),
        struct.pack("<HB", 26, ord("A")) + bytes(3) + b"vehicle_global_position",
        *(struct.pack("<HBHQdd", 26, ord("D"), 0, at * 100_000, 31.0, 104.0) for at in range(20)),
    )
)
PLAN = b"""{"fileType": "Plan", "mission": {"plannedHomePosition": [31.0, 104.0, 500.0], "items": [
 {"type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, null, 31.0, 104.0, 50]}]}}"""
WAYPOINTS = b"QGC WPL 110\n1\t0\t3\t16\t0\t0\t0\t0\t31.0\t104.0\t50\t1\n"
COMMANDS = b'{"stamp": 1790000000000000000, "told": "plan", "aircraft": "*", "points": []}\n' * 2
SPLICES = st.sampled_from([b"", b"\xff" * 8, b"\0" * 8, b"\xfd\xff", b"\xa3\x95", b"[[[[", b"1e999", b'"', b"null"])


@st.composite
def _damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """Cut out, put in, replaced: up to six times."""
    data = whole
    for _ in range(draw(st.integers(0, 6))):
        at = draw(st.integers(0, len(data)))
        piece = draw(SPLICES | st.binary(max_size=12))
        data = data[:at] + piece + data[at + draw(st.integers(0, 20) | st.just(len(piece))) :]
    return data


def _refusal(read: Callable[[], object], kind: type[Exception]) -> str:
    """What is said where this is refused; empty where it is not."""
    try:
        read()
    except kind as error:
        return str(error)
    return ""


def _is_sentence(text: str) -> bool:
    return not text or (text.endswith(".") and "\n" not in text)


@QUICK
@given(_damaged(TLOG))
def test_a_damaged_tlog_is_read_alike_as_frames_and_as_columns(data: bytes) -> None:
    counters, others = Counter[str](), Counter[str]()
    read = list(TlogReader(io.BytesIO(data), counters))
    columns = read_columns(io.BytesIO(data), counters=others)
    kept = columns.frames[~columns.frames["outgoing"]]
    assert [stamp for stamp, _ in read] == kept["received_at"].tolist()
    assert [data[at : at + len(frame)] for at, (_, frame) in zip(kept["offset"], read, strict=True)] == [
        frame for _, frame in read
    ]
    assert counters == others


@QUICK
@given(_damaged(CAPTURE) | _damaged(CAPTURE_NG))
def test_a_damaged_capture_is_read_or_refused(data: bytes) -> None:
    reader = PcapReader(io.BytesIO(data))
    refusal = _refusal(lambda: list(reader), ValueError)
    assert (refusal == "not a capture file") == (not is_capture(data))


@QUICK
@given(_damaged(BIN))
def test_a_damaged_dataflash_log_is_told_in_whole_frames_by_rising_stamps(data: bytes) -> None:
    last = -1
    for stamp, frame in DataflashFrames(io.BytesIO(data), identity_of(io.BytesIO(data))):
        taken = parse(frame)
        assert taken is not None
        assert taken.verdict == "good"
        assert stamp > last
        last = stamp


@QUICK
@given(_damaged(ULOG))
def test_a_damaged_ulog_is_told_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.ulg"
    path.write_bytes(data)
    frames: list[tuple[int, bytes]] = []
    _refusal(lambda: frames.extend(UlogFrames(path).frames(Counter())), UlogDamaged)
    assert all(late[0] > early[0] for early, late in pairwise(frames))


@settings(QUICK, max_examples=120)
@given(_damaged(PLAN) | _damaged(WAYPOINTS))
def test_a_damaged_mission_is_read_or_refused_in_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.plan"
    path.write_bytes(data)
    assert _is_sentence(_refusal(lambda: read_mission(path), MissionFileError))


@settings(QUICK, max_examples=120)
@given(
    st.one_of(*(_damaged(one[:600]) for one in (TLOG, CAPTURE, CAPTURE_NG, BIN, ULOG, PLAN, WAYPOINTS)), st.binary())
)
def test_any_file_is_known_or_refused_in_a_sentence(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "anything"
    path.write_bytes(data)
    assert _is_sentence(_refusal(lambda: kind_of(path), FileError))


@QUICK
@given(_damaged(COMMANDS))
def test_damaged_told_lines_are_understood_or_counted(data: bytes) -> None:
    counters = Counter[str]()
    lines = list(read_commands(io.BytesIO(data), counters))
    assert len(lines) + counters["lines not understood"] == len(data.splitlines(keepends=True)) or b"\r" in data
    for _, line in lines:
        told.decode(line)


@QUICK
@given(st.lists(_damaged(sign(FRAMES[0], KEY, 1, 10**13)) | st.sampled_from(FRAMES), max_size=8), st.integers(0, 3))
def test_only_what_was_signed_with_the_key_is_believed_and_once(frames: list[bytes], source: int) -> None:
    guard, right = SigningGuard(KEY), sign(FRAMES[0], KEY, 1, 10**13)
    believed = [frame for frame in frames if guard.judge(frame, source, T0) is None]
    assert believed in ([], [right])
    assert bool(believed) == (right in frames)


@QUICK
@given(st.lists(st.tuples(st.integers(0, 3), _damaged(b"".join(FRAMES[:4])) | st.binary(max_size=80)), max_size=12))
def test_whatever_links_bring_becomes_frames_with_rising_stamps(told: list[tuple[int, bytes]]) -> None:
    """Two links of datagrams, one byte stream and a radar's; also what answers is asked of all of it."""
    clock = iter(range(T0, T0 + 10**15, SECOND))
    intake = Intake(Stamper(lambda: T0, lambda: next(clock) - T0), ["a", "b", "stream"], ["radar"])
    manners = Manners(heartbeat=True, request_rates=True, fetch_mission=True)
    last = 0
    for link, data in told:
        sources, arrivals = intake.take([(link, Chunks.of(["10.0.0.1:5"], [data], [0], 0 if link == 2 else None))])
        for source in sources:
            manners.add(source)
        for arrival in arrivals:
            assert arrival.received_at > last
            last = arrival.received_at
            assert link == 3 or FrameScanner().feed_datagram(arrival.data) == [arrival.data]
        manners.hear(arrivals)
        for _, frame in manners.due(max(last, T0) + 60 * SECOND):
            taken = parse(frame)
            assert taken is not None
            assert taken.verdict == "good"


@st.composite
def _said(draw: st.DrawFn) -> bytes:
    """A message that is read, with any payload; a position near the runway; or a radar's plot."""
    kind, number = draw(st.integers(0, 3)), draw(st.integers(0, 200))
    if kind == 0:
        return _plots(number)
    encoder = FrameEncoder(draw(st.integers(1, 2)), 1, number)
    if kind == 1:
        place = {"lat": 310_000_000 + number * 500, "lon": 1_040_000_000, "alt": 600_000, "relative_alt": 100_000}
        return encoder.encode(
            "GLOBAL_POSITION_INT", time_boot_ms=100_000 + 200 * number, vx=2000, vy=0, vz=100, hdg=0, **place
        )
    message = definitions()[draw(st.sampled_from(WANTED))]
    payload = draw(st.binary(min_size=message.unpacker.size, max_size=message.unpacker.size))
    return _repaired(message.id, payload, encoder.system, number)


def _repaired(message: int, payload: bytes, system: int, number: int) -> bytes:
    """The frame with a right checksum."""
    body = bytes((len(payload), 0, 0, number, system, 1)) + message.to_bytes(3, "little") + payload
    crc = mcrf4xx(body + bytes((definitions()[message].crc_extra,)))
    return b"\xfd" + body + crc.to_bytes(2, "little")


@QUICK
@given(st.lists(st.tuples(_said(), st.integers(0, 5 * SECOND)), max_size=25))
def test_whatever_is_said_the_rows_of_the_picture_hold_numbers(said: list[tuple[bytes, int]]) -> None:
    decoder = Decoder([Source(0, "mavlink", "mavlink-1", "here"), Source(1, "radar", "radar-1", "there")])
    state, stamp = pipeline.initial(DEMO_SITE), T0
    for data, after in said:
        stamp += after + 4000
        heard = decoder.feed(Arrival(stamp, int(data[:2] == b"LR"), data))
        for one in heard.observations:
            assert not isinstance(one, GpsReport) or math.isfinite(one.latitude_rad + one.longitude_rad)
        state, picture = pipeline.step(state, [heard, decoder.watermark(stamp)], decoder.health(stamp))
        rows, ahead = picture.fuse, picture.predict
        for column in (
            rows.latitude_rad,
            rows.longitude_rad,
            rows.covariance,
            rows.velocity_mps[:, :2],
            ahead.latitude_rad,
        ):
            assert not column.size or math.isfinite(column.sum())


def test_the_fuzzer_finds_nothing_in_a_short_run() -> None:
    script = TESTS / "fuzz" / "run.py"
    run = subprocess.run(
        [sys.executable, str(script), "--datagrams", "3000", "--files", "13", "--seed", "11"],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    assert "nothing found: 30" in run.stdout
