"""ArduPilot's .BIN logs, read and told as MAVLink."""

import io
import math
import random
import struct
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pymavlink.DFReader import DFReader_binary
from pymavlink.dialects.v20 import all as dialect

from adapters.dataflash import DataflashFrames
from adapters.dataflash_identity import WANTED, identity_of
from adapters.dataflash_reader import DataflashReader
from adapters.files import FileError, open_recording
from adapters.mavlink_frames import parse

DATA = Path(__file__).parents[1] / "data"
EXCERPT = DATA / "sitl-landing-excerpt.BIN"
TLOG = DATA / "sitl-landing-excerpt.tlog"
FORMATS = {
    "GPS": ("QBBIHBcLLffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U"),
    "PARM": ("QNff", "TimeUS,Name,Value,Default"),
    "VER": ("QB", "TimeUS,BU"),
    "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "MAG": ("QBhhh", "TimeUS,I,MagX,MagY,MagZ"),
    "BARO": ("QBff", "TimeUS,I,Press,Temp"),
    "ARM": ("QB", "TimeUS,ArmState"),
    "MODE": ("QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "ATT": ("Qccccc", "TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw"),
}
LETTERS = {"Q": "Q", "B": "B", "M": "b", "I": "I", "H": "H", "h": "h", "c": "h", "L": "i", "f": "f", "N": "16s"}


def made(*entries: tuple[Any, ...], formats: dict[str, tuple[str, str]] = FORMATS) -> bytes:
    """A log of these entries (name, values in the wire's units), with the formats that they need."""
    out = b""
    numbers = {name: 129 + index for index, name in enumerate(formats)}
    for name, (letters, columns) in formats.items():
        size = 3 + struct.calcsize("<" + "".join(LETTERS[letter] for letter in letters))
        head = struct.pack("<BB4s16s64s", numbers[name], size, name.encode(), letters.encode(), columns.encode())
        out += b"\xa3\x95\x80" + head
    for name, *values in entries:
        layout = "<" + "".join(LETTERS[letter] for letter in formats[name][0])
        out += bytes((0xA3, 0x95, numbers[name])) + struct.pack(layout, *values)
    return out


def told(log: bytes) -> tuple[list[Any], Counter[str]]:
    """The messages of a log, decoded by pymavlink."""
    counters: Counter[str] = Counter()
    frames = list(DataflashFrames(io.BytesIO(log), identity_of(io.BytesIO(log)), counters))
    assert all(later > earlier and later % 4000 == 0 for (earlier, _), (later, _) in pairwise(frames))
    link = dialect.MAVLink(None)
    messages = [link.decode(bytearray(frame)) for _, frame in frames]
    for message, (stamp, _) in zip(messages, frames, strict=True):
        message.stamp = stamp
    return messages, counters


def of_kind(messages: list[Any], kind: str) -> list[Any]:
    return [message for message in messages if message.get_type() == kind]


def gps(at_us: int, **changes: Any) -> tuple[Any, ...]:
    values = {"status": 3, "ms": 345_600_000, "week": 2399, "lat": -353632610, "lon": 1491652299, **changes}
    fix = (values["status"], values["ms"], values["week"], 10, 121, values["lat"], values["lon"])
    return ("GPS", at_us, 0, *fix, 584.0, 3.0, 90.0, 0.0, 1)


def test_the_reader_agrees_with_pymavlinks_on_every_wanted_value() -> None:
    with EXCERPT.open("rb") as file:
        mine = list(DataflashReader(file, WANTED))
    count = 0
    with DFReader_binary(str(EXCERPT)) as reference:
        while (message := reference.recv_msg()) is not None:
            name = message.get_type()
            if name not in WANTED or "TimeUS" not in message.get_fieldnames():
                continue
            entry = mine[count]
            count += 1
            assert (entry.time_us, entry.name) == (message.TimeUS, name)
            for column, value in entry.values.items():
                assert value == getattr(message, column)
    assert count == len(mine) > 4000


def test_the_log_and_the_telemetry_of_one_flight_tell_the_same_places_at_the_same_times() -> None:
    """Positions and truth of the .BIN, interpolated in those of the .tlog by the time since boot: centimetres apart."""
    for kind in ("GLOBAL_POSITION_INT", "SIM_STATE"):
        log, telemetry = _places(EXCERPT, kind), _places(TLOG, kind)
        inside = (log[:, 0] > telemetry[0, 0]) & (log[:, 0] < telemetry[-1, 0]) & (log[:, 0] > 702)
        at = log[inside, 0]
        between = np.stack([np.interp(at, telemetry[:, 0], telemetry[:, axis]) for axis in (1, 2, 3)], axis=1)
        apart_m = np.linalg.norm((log[inside, 1:] - between) * (111_319.5, 90_800.0, 1.0), axis=1)
        assert len(at) > 300
        assert apart_m.max() < 0.6  # at 20 m/s this is 30 ms, of which 4 are the stamps' and the rest turbulence
        assert np.median(apart_m) < 0.1


def _places(path: Path, kind: str) -> Any:
    """Seconds by the recording's clock since its first frame's day began, latitude, longitude (degrees), altitude (m)."""
    rows = []
    link = dialect.MAVLink(None)
    for arrival in open_recording(path).arrivals():
        message = link.decode(bytearray(arrival.data))
        if message.get_type() != kind:
            continue
        boot_s = arrival.received_at / 1e9 - 1_767_225_599.972
        if kind == "SIM_STATE":
            rows.append((boot_s, message.lat_int / 1e7, message.lon_int / 1e7, message.alt))
        elif abs(message.lat) > 10**7:
            rows.append((message.time_boot_ms / 1e3, message.lat / 1e7, message.lon / 1e7, message.alt / 1e3))
    return np.array(rows)


def test_the_excerpt_tells_what_it_holds_and_nothing_else() -> None:
    messages, counters = told(EXCERPT.read_bytes())
    kinds = Counter(message.get_type() for message in messages)
    assert set(kinds) == {
        *("HEARTBEAT", "SYSTEM_TIME", "EXTENDED_SYS_STATE", "GPS_RAW_INT", "GLOBAL_POSITION_INT", "ATTITUDE"),
        *("HIGHRES_IMU", "SCALED_PRESSURE", "VFR_HUD", "WIND", "SIM_STATE", "HOME_POSITION"),
        *("MISSION_COUNT", "MISSION_ITEM_INT", "SIMSTATE"),
    }
    assert kinds["SIMSTATE"] == 1  # where the cut took the velocity away
    assert kinds["MISSION_ITEM_INT"] == 12
    assert not counters
    heartbeat = of_kind(messages, "HEARTBEAT")[-1]
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.base_mode & 128, heartbeat.custom_mode) == (1, 3, 128, 10)
    wind = of_kind(messages, "WIND")[-1]
    assert math.isclose(wind.direction, 290, abs_tol=25)  # the simulator's wind, with its turbulence
    assert 0.5 < wind.speed < 8  # it has landed


def test_utc_is_gps_time_less_eighteen_seconds_at_the_time_since_boot() -> None:
    """GPS week 2399, 345 600 s into it, is 2025-12-31T23:59:42 UTC; it was logged 7 s after boot."""
    messages, _ = told(made(gps(7_000_000), gps(7_200_000, ms=345_600_200)))
    time = of_kind(messages, "SYSTEM_TIME")[0]
    assert time.time_unix_usec == 1_767_225_582 * 10**6
    assert time.time_boot_ms == 7000
    assert messages[0].stamp == 1_767_225_582 * 10**9


def test_a_log_without_gps_time_is_stamped_from_a_fixed_date_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "indoors.BIN"
    path.write_bytes(made(gps(1_000_000, status=1, week=0), ("POS", 1_500_000, 10**8, 10**8, 5.0, 1.0, 1.0)))
    recording = open_recording(path)
    stamps = [arrival.received_at for arrival in recording.arrivals()]
    assert stamps[0] == 946_684_801 * 10**9
    assert recording.notes
    assert "2000-01-01" in recording.notes[0]
    times = of_kind(told(path.read_bytes())[0], "SYSTEM_TIME")
    assert all(time.time_unix_usec == 0 for time in times)


@pytest.mark.parametrize("name", [b"SYSID_THISMAV", b"MAV_SYSID"])
def test_system_and_kind_come_from_the_log(name: bytes) -> None:
    messages, _ = told(made(("PARM", 1, name, 7.0, 1.0), ("VER", 2, 2), gps(1_000_000)))
    assert {message.get_srcSystem() for message in messages} == {7}
    assert {heartbeat.type for heartbeat in of_kind(messages, "HEARTBEAT")} == {2}  # a quadrotor


def test_armed_and_mode_are_told_from_the_moment_on_when_they_change() -> None:
    entries = [
        gps(0),
        ("MODE", 500_000, 5, 5, 1),
        ("ARM", 2_500_000, 1),
        gps(4_000_000),
        ("ARM", 5_500_000, 0),
        gps(7 * 10**6),
    ]
    heartbeats = of_kind(told(made(*entries))[0], "HEARTBEAT")
    assert [bool(one.base_mode & 128) for one in heartbeats] == [False, True, True, False, False]
    assert [one.custom_mode for one in heartbeats] == [0, 5, 5, 5, 5]


def test_the_velocity_of_a_position_without_an_estimator_is_the_receivers() -> None:
    messages, _ = told(made(gps(1_000_000), ("POS", 1_100_000, 10**8, 10**8, 5.0, 1.0, 1.0)))
    (position,) = of_kind(messages, "GLOBAL_POSITION_INT")
    assert (position.vx, position.vy, position.vz) == (0, 300, 0)
    assert position.hdg == 65535  # no attitude in the log


def test_a_magnetic_field_is_told_in_gauss_and_a_pressure_without_a_pitot_alone() -> None:
    messages, _ = told(made(("MAG", 1, 1, 216, -80, 528), ("BARO", 2, 0, 94500.0, 28.5)))
    field, pressure = of_kind(messages, "HIGHRES_IMU")
    assert (field.id, field.fields_updated) == (1, 0x1C0)
    assert np.allclose((field.xmag, field.ymag, field.zmag), (0.216, -0.08, 0.528))
    assert pressure.fields_updated == 0x200
    assert math.isclose(pressure.abs_pressure, 945.0)
    assert math.isnan(pressure.xacc)


def test_junk_between_messages_costs_the_message_before_it_at_most() -> None:
    """There is no checksum: a message that no header follows cannot be told from one that lost its end."""
    start = made()
    pieces = [made(gps(n * 200_000, ms=345_600_000 + n * 200))[len(start) :] for n in range(50)]
    junk = bytes(range(100, 137))
    damaged = start + b"".join(piece + (junk if n % 10 == 9 else b"") for n, piece in enumerate(pieces))
    messages, counters = told(damaged)
    assert len(of_kind(messages, "GPS_RAW_INT")) == 45
    assert counters["bytes skipped"] + counters["cut at the end"] == 5 * (len(junk) + len(pieces[0]))


def test_a_single_impossible_time_is_left_out() -> None:
    messages, counters = told(made(gps(10**6), gps(10**13), gps(1_200_000), gps(2**63), gps(1_400_000)))
    assert [fix.time_usec for fix in of_kind(messages, "GPS_RAW_INT")] == [10**6, 1_200_000, 1_400_000]
    assert counters["bad timestamps"] == 2


def test_a_definition_that_cannot_be_is_counted_and_not_believed() -> None:
    log = made(gps(10**6))
    bad = b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", 200, 0, b"POS", b"QLLf", b"TimeUS,Lat,Lng,Alt")
    messages, counters = told(bad + log)
    assert len(of_kind(messages, "GPS_RAW_INT")) == 1
    assert counters["definitions not understood"] == 1


def test_values_that_no_frame_can_hold_are_counted() -> None:
    nowhere = ("POS", 10**6, 10**8, 10**8, math.nan, 1.0, 1.0)
    messages, counters = told(made(nowhere, ("POS", 2 * 10**6, 10**8, 10**8, 1e30, 1.0, 1.0)))
    assert not of_kind(messages, "GLOBAL_POSITION_INT")
    assert counters["values not usable"] == 2


def test_a_log_with_nothing_in_it_is_said(tmp_path: Path) -> None:
    path = tmp_path / "empty.BIN"
    path.write_bytes(made())
    with pytest.raises(FileError, match="nothing that can be replayed"):
        list(open_recording(path).arrivals())


@pytest.mark.parametrize("seed", range(25))
def test_whatever_is_damaged_frames_stay_whole_and_in_order(seed: int) -> None:
    """Flipped, lost and added bytes, also in the definitions."""
    chance = random.Random(seed)
    log = bytearray(EXCERPT.read_bytes()[: 12_000 + seed * 500])
    for _ in range(chance.choice((1, 10, 200))):
        at = chance.randrange(len(log) - 50)
        act = chance.randrange(3)
        if act == 0:
            log[at] ^= 1 << chance.randrange(8)
        elif act == 1:
            del log[at : at + chance.randrange(40)]
        else:
            log[at:at] = chance.randbytes(chance.randrange(40))
    frames = list(DataflashFrames(io.BytesIO(log), identity_of(io.BytesIO(log)), Counter()))
    assert all(later > earlier for (earlier, _), (later, _) in pairwise(frames))
    assert all((frame := parse(data)) is not None and frame.verdict == "good" for _, data in frames)
