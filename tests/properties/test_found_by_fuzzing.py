"""The least inputs of what `make fuzz` has found: each once ended a run, held it up, or made it grow without end."""

import io
import json
import struct
from collections import Counter
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from adapters import Arrival, Source
from adapters.captures import CaptureRecording
from adapters.decode import Decoder
from adapters.kinds import FileError, kind_of
from adapters.landing_radar import Header, Plot, encode
from adapters.mavlink_frames import FrameEncoder
from adapters.mavlink_frames import encode as mavlink
from adapters.meters import SpeedMeter
from adapters.mission_files import MissionFileError, read_mission
from adapters.pcap import PcapWriter
from adapters.plans import plan_point
from adapters.radar import LandingRadarReceiver, Taken
from gateway import pipeline
from gateway.observation import FlightPlan, GpsReport, Heard, PlanPoint, RadarStatus
from gateway.offline.site import propose_site
from gateway.runtime.folder import FolderError, InputFile, Record, read_record, write_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.playback import open_playback
from gateway.settings import DEMO_SITE, Options, SiteError, parse_site

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
RECORD = Record("0.1.0", ("replay",), Options(), T0, watermark=T0 + SECOND, ended="done")


@pytest.mark.parametrize("content", [b"[" * 60_000, b'{"a":' * 10_000])
def test_a_file_of_brackets_is_no_recording(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "brackets"
    path.write_bytes(content)
    with pytest.raises(FileError, match="not a recording"):
        kind_of(path)


def test_a_plan_with_a_number_of_thousands_of_digits_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "digits.plan"
    path.write_text('{"fileType": "Plan", "mission": {"version": ' + "1" * 5000 + "}}")
    with pytest.raises(MissionFileError, match="thousands of digits"):
        read_mission(path)


@pytest.mark.parametrize("text", ["x = " + "[" * 2000, "x = " + "9" * 5000])
def test_a_site_file_that_nobody_would_write_is_refused_in_a_sentence(text: str) -> None:
    with pytest.raises(SiteError, match="not TOML"):
        parse_site(text)


def _damaged(**changed: Any) -> str:
    return json.dumps({"format": 1, **asdict(RECORD), **changed})


@pytest.mark.parametrize(
    "text",
    [
        "[" * 2000,
        _damaged(watermark={}),
        _damaged(watermark=[]),
        _damaged(started_at=None),
        _damaged(started_at=10**30),
        _damaged(started_at=True),
        _damaged(epoch_offset_s="far"),
        _damaged(site=["x"]),
        _damaged(options={**asdict(Options()), "history_s": ""}),
        _damaged(options={**asdict(Options()), "history_s": float("inf")}),
        _damaged(options={**asdict(Options()), "prediction_period_s": 0.0}),
        _damaged(options={**asdict(Options()), "horizons_s": [10.0, None]}),
        _damaged(options={**asdict(Options()), "weighting": "none"}),
        _damaged(options={**asdict(Options()), "begins_at": "now"}),
        _damaged(options={**asdict(Options()), "mutes": [{"what": "gps", "number": 1, "since": "", "until": 0}]}),
        _damaged(sources=[asdict(InputFile(0, "mavlink", "a", "b", "inputs/a.tlog"))] * 2),
        _damaged(sources=[{**asdict(InputFile(0, "mavlink", "a", "b", "inputs/a.tlog")), "kind": "sonar"}]),
    ],
)
def test_a_session_whose_record_is_damaged_is_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "session.json").write_text(text)
    with pytest.raises(FolderError) as refused:
        read_record(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_record_as_it_is_written_is_read(tmp_path: Path) -> None:
    record = replace(RECORD, sources=(InputFile(0, "radar", "radar-1", "udpin:0.0.0.0:30070", "inputs/radar-1.pcap"),))
    write_record(tmp_path, record)
    assert read_record(tmp_path) == record


def test_a_source_whose_file_can_have_no_name_is_a_file_that_is_missing(tmp_path: Path) -> None:
    write_record(tmp_path, replace(RECORD, sources=(InputFile(0, "mavlink", "a", "b", "x" * 5000),)))
    with pytest.raises(FileError, match="is missing"):
        open_playback([tmp_path])


def test_a_sources_file_that_is_of_another_kind_is_refused_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / "radar-1.pcap"
    path.write_bytes(b"no capture")
    with pytest.raises(FileError, match=r"radar-1\.pcap is not what radar-1 can have sent"):
        list(SessionInput(path, Source(0, "radar", "radar-1", "")).arrivals())


def _pcapng(*stamps_ns: int) -> bytes:
    """Radar datagrams at these times, by an interface that counts ns."""
    blocks = [(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))]
    blocks.append((1, struct.pack("<HHI", 101, 0, 65535) + struct.pack("<HHB3xHH", 9, 1, 9, 0, 0)))
    for number, stamp in enumerate(stamps_ns):
        sink = io.BytesIO()
        PcapWriter(sink).write(0, encode(Header("plots", 1, number, T0), []), "10.0.0.1:5")
        packet = sink.getvalue()[40:]
        size = struct.pack("<IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        blocks.append((6, size + packet + bytes(-len(packet) % 4)))
    return b"".join(
        struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12) for kind, body in blocks
    )


@pytest.mark.parametrize("bad", [(1 << 64) - 1, 8_000_000_000 * SECOND, T0 + 7200 * SECOND, T0 - 7200 * SECOND])
def test_a_stamp_of_a_capture_that_cannot_be_takes_the_one_before(tmp_path: Path, bad: int) -> None:
    """The picture's clock would go through all the seconds up to it, and never come back."""
    path = tmp_path / "radar.pcapng"
    path.write_bytes(_pcapng(T0, T0 + SECOND, bad, T0 + 2 * SECOND, T0 + 3 * SECOND))
    recording = CaptureRecording(path)
    stamps = [arrival.received_at for arrival in recording.arrivals()]
    assert stamps == [T0, T0 + SECOND, T0 + SECOND + 4000, T0 + 2 * SECOND, T0 + 3 * SECOND]
    assert recording.counters["bad timestamps"] == 1


def test_a_clock_of_a_capture_that_was_set_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "radar.pcapng"
    path.write_bytes(_pcapng(T0, T0 + SECOND, T0 + 7200 * SECOND, T0 + 7201 * SECOND))
    recording = CaptureRecording(path)
    assert [arrival.received_at for arrival in recording.arrivals()][-1] == T0 + 7201 * SECOND
    assert not recording.counters["bad timestamps"]


def test_made_up_senders_take_no_memory_without_end_and_those_known_are_heard_on() -> None:
    """Each component has a clock, its sequence numbers and rates: some 9 kB."""
    decoder, notes = Decoder([Source(0, "mavlink", "mavlink-1", "here")]), []
    values = {"time_boot_ms": 1000, "roll": 0, "pitch": 0, "yaw": 0, "rollspeed": 0, "pitchspeed": 0, "yawspeed": 0}
    stamp = T0
    for component in range(1, 11):
        for system in range(1, 256):
            stamp += 4000
            heard = decoder.hear(Arrival(stamp, 0, mavlink("ATTITUDE", values, system=system, component=component)))
            notes += [] if heard is None else heard.notes
    assert decoder.counters()["mavlink-1 too many components"] == 2550 - 2048
    assert sum("senders speak MAVLink" in text for _, text in notes) == 1
    again = {**values, "time_boot_ms": 1100}
    assert decoder.feed(Arrival(stamp + SECOND, 0, mavlink("ATTITUDE", again, system=1))).observations


def test_a_damaged_frame_makes_no_sender() -> None:
    decoder = Decoder([Source(0, "mavlink", "mavlink-1", "here")])
    frame = bytearray(FrameEncoder(9).encode("SYSTEM_TIME", time_unix_usec=5, time_boot_ms=7))
    frame[-1] ^= 0x10
    decoder.hear(Arrival(T0, 0, bytes(frame)))
    assert decoder.counters() == {"mavlink-1 frames": 1, "mavlink-1 definition differs": 1}
    assert not decoder.health(T0 + SECOND).vehicles


def _plots(radar: int, sequence: int, key: bytes | None = None) -> bytes:
    time = T0 + sequence * SECOND
    return encode(Header("plots", radar, sequence, time), [Plot(1, time, 1000.0)], key=key)


def test_made_up_radar_numbers_are_refused_when_there_are_too_many_but_never_one_that_has_a_key() -> None:
    receiver = LandingRadarReceiver({999: b"key"})
    said = [receiver.hear(_plots(radar, 1), "a", "a", T0) for radar in range(1, 101)]
    assert said[-1] == "too many radars"
    assert 64 <= receiver.counters["datagrams"] == 100 - receiver.counters["too many radars"] <= 65
    assert isinstance(receiver.hear(_plots(999, 1, b"key"), "a", "a", T0), Taken)
    assert isinstance(receiver.hear(_plots(1, 2), "a", "a", T0), Taken)


def test_made_up_senders_of_a_radar_are_forgotten_and_soon_not_told_any_more() -> None:
    receiver, notes = LandingRadarReceiver(), []
    for number in range(300):
        for sender in ("the radar", f"stranger {number}"):
            taken = receiver.hear(_plots(1, number), sender, sender, T0)
            assert isinstance(taken, Taken)
            notes += taken.notes
    assert len(notes) < 16
    assert receiver.counters["second sender"] == 300
    assert receiver.hear(_plots(1, 299), "the radar", "the radar", T0) == "duplicate"  # its window was kept
    assert isinstance(receiver.hear(_plots(1, 0), "stranger 0", "stranger 0", T0), Taken)  # this one's was not


def test_times_that_run_faster_than_any_simulator_are_no_clock() -> None:
    meter = SpeedMeter()
    for number in range(10):
        meter.hear(T0 + number * 3 * SECOND, number * 10**15)
    assert meter.speed is None


def test_a_radar_that_says_each_second_that_it_stands_elsewhere_is_told_once() -> None:
    state, told = pipeline.initial(DEMO_SITE), Counter[str]()
    for number in range(20):
        now = T0 + number * SECOND
        latitude = 0.541 + number * 1e-4
        status = RadarStatus(1, now, now, "operating", "search", 0.4, latitude, 1.8151, 500.0, 4.7)
        state, picture = pipeline.step(state, [Heard(now, (status,))])
        told.update("the site file is used" in event.text for event in picture.events)
    assert told[True] == 1


def test_drones_of_made_up_numbers_whose_clocks_are_wrong_are_not_all_told() -> None:
    decoder, notes = Decoder([Source(0, "mavlink", "mavlink-1", "here")]), []
    values: dict[str, Any] = dict.fromkeys(
        ("target_system", "target_component", "status", "direction", "speed_horizontal", "speed_vertical",
         "altitude_barometric", "altitude_geodetic", "height_reference", "height", "horizontal_accuracy",
         "vertical_accuracy", "barometer_accuracy", "speed_accuracy", "timestamp_accuracy"), 0,
    )  # fmt: skip
    values |= {"latitude": 310_000_000, "longitude": 1_040_000_000, "timestamp": 1000.0}
    utc = mavlink("SYSTEM_TIME", {"time_unix_usec": T0 // 1000, "time_boot_ms": 1000}, system=1)
    later = mavlink("SYSTEM_TIME", {"time_unix_usec": T0 // 1000 + 10**6, "time_boot_ms": 2000}, system=1)
    for stamp, frame in ((T0, utc), (T0 + SECOND, later)):
        decoder.hear(Arrival(stamp, 0, frame))
    for number in range(600):
        frame = mavlink(
            "OPEN_DRONE_ID_LOCATION", {**values, "id_or_mac": list(number.to_bytes(20, "little"))}, system=2
        )
        heard = decoder.hear(Arrival(T0 + 2 * SECOND + number * 4000, 0, frame))
        notes += [] if heard is None else heard.notes
    assert 200 < sum("is shown, not fused" in text for _, text in notes) <= 256


def test_the_neighbours_of_a_bad_stamp_stay_in_order(tmp_path: Path) -> None:
    path = tmp_path / "radar.pcapng"
    path.write_bytes(_pcapng(T0, (1 << 64) - 1, 0, T0 + 5, (1 << 63), T0 + SECOND))
    stamps = [arrival.received_at for arrival in CaptureRecording(path).arrivals()]
    assert all(late > early for early, late in pairwise(stamps))
    assert stamps[-1] == T0 + SECOND


def _home(altitude_mm: int) -> Decoder:
    decoder = Decoder([Source(0, "mavlink", "mavlink-1", "here")])
    values: dict[str, Any] = dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0)
    values |= {"latitude": 310_000_000, "longitude": 1_040_000_000, "altitude": altitude_mm, "q": [1.0, 0.0, 0.0, 0.0]}
    decoder.hear(Arrival(T0, 0, mavlink("HOME_POSITION", values, system=1)))
    return decoder


def test_a_home_in_space_is_none() -> None:
    assert _home(2_131_290_522).counters()["mavlink-1 altitude out of range"] == 1
    assert "mavlink-1 altitude out of range" not in _home(500_000).counters()


@pytest.mark.parametrize(("altitude_m", "told_by"), [(500.0, "home"), (50_000.0, "heard first")])
def test_a_place_that_no_site_file_could_say_is_not_taken(altitude_m: float, told_by: str) -> None:
    """The next that tells of the place is: it ended every session without a site file."""
    report = GpsReport("mavlink:1", T0, T0, 0.541, 1.8151, altitude_msl_m=510.0)
    plan = FlightPlan("mavlink:1", T0, T0, (PlanPoint(0, "home", 0.541, 1.8151, altitude_msl_m=altitude_m),))
    proposal = propose_site([plan, report], complete=True)
    assert proposal is not None
    assert told_by in proposal.origin.lower()


def test_an_item_of_a_plan_as_high_as_no_number_should_be_has_no_altitude() -> None:
    point = plan_point(1, 16, 3, 31.0, 104.0, 1e38)
    assert point is not None
    assert point.altitude_above_home_m is None


@pytest.mark.parametrize("last", [b"", b"L", b"LR\x01"])
def test_a_radars_stub_of_a_datagram_behind_many_frames_is_refused_as_any_other(last: bytes) -> None:
    """Many arrivals are taken together, those of radars among them; nothing may be read behind the last."""
    encoder = FrameEncoder(1)
    frames = [encoder.encode("SYSTEM_TIME", time_unix_usec=5, time_boot_ms=7) for _ in range(150)]
    arrivals = [Arrival(T0 + place * 4000, 0, frame) for place, frame in enumerate(frames)]
    arrivals.append(Arrival(T0 + SECOND, 1, last))
    decoder = Decoder([Source(0, "mavlink", "mavlink-1", "here"), Source(1, "radar", "radar-1", "there")])
    assert decoder.hear_many(arrivals)[1] == [150]
    assert decoder.counters()["mavlink-1 frames"] == 150
    assert decoder.counters()["radar-1 length"] == 1
