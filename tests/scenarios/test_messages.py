"""Each kind of message that is read, in a recording of its own: what it changes in tracks.parquet, or in /health.

Every scenario is replayed by the real program with an archive, and read back from what that archive holds. Beside the
message that it is about, a vehicle says only that it is there and what time it is; and, where the message tells of no
position, where it is.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from rerun.chunk import RrdReader

from adapters.mavlink_frames import FrameEncoder, definitions
from gateway.settings import DEMO_SITE, format_site
from gateway.sinks.scene.health import VEHICLES

START_US = 1_790_000_000_000_000
BOOT_S = 100.0
SECONDS = 6
PLACE = {"lat": 310_000_000, "lon": 1_040_000_000}
GEOID_M = -35.0  # of the demo site

Talkdown = Callable[..., Any]
Words = dict[str, str]


def nothing_said(name: str) -> dict[str, Any]:
    """Every field of a message with nothing in it."""
    (message,) = (one for one in definitions().values() if one.msgname == name)
    lengths = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    return {
        field: b"" if kind == "char" else [0] * lengths[field] if lengths[field] else 0 for field, kind in kinds.items()
    }


class Stream:
    """A .tlog in the making; `say` takes the fields that are not 0."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.second = 0.0
        self._encoders: dict[tuple[int, int], FrameEncoder] = {}

    @property
    def boot_ms(self) -> int:
        return round((BOOT_S + self.second) * 1000)

    @property
    def unix_us(self) -> int:
        return START_US + round(self.second * 1e6)

    def say(self, name: str, *, by: tuple[int, int] = (1, 1), **values: Any) -> None:
        encoder = self._encoders.setdefault(by, FrameEncoder(*by))
        self.bytes += struct.pack(">Q", self.unix_us // 4 * 4) + encoder.encode(name, **(nothing_said(name) | values))

    def be_there(self) -> None:
        self.say("HEARTBEAT", type=1, autopilot=3, base_mode=128, custom_mode=10, mavlink_version=3)
        self.say("SYSTEM_TIME", time_unix_usec=self.unix_us, time_boot_ms=self.boot_ms)

    def be_somewhere(self) -> None:
        self.say("GLOBAL_POSITION_INT", time_boot_ms=self.boot_ms, alt=935_000, relative_alt=400_000, hdg=9000, **PLACE)


Said = Callable[[Stream], None]


class Archive:
    """What a replay has kept."""

    def __init__(self, folder: Path) -> None:
        table = pq.read_table(folder / "tracks.parquet")
        times = {name: table[name].cast("int64") for name in ("time", "received")}
        self.rows: list[dict[str, Any]] = table.drop_columns(list(times)).to_pylist()
        for name, column in times.items():
            for row, time in zip(self.rows, column.to_pylist(), strict=True):
                row[name] = time
        self.vehicles = _words(folder / "session.rrd")

    def of(self, aircraft: str) -> list[dict[str, Any]]:
        """The rows that reports of an aircraft wrote."""
        return [row for row in self.rows if row["aircraft"] == aircraft and row["updated_by"] == "gps"]

    def sigma_m(self, aircraft: str) -> float:
        """Of the first row's position, east, without what the position source may be wrong by."""
        variance = self.of(aircraft)[0]["covariance"][0]
        return math.sqrt(variance - DEMO_SITE.position.systematic_m**2 / 3.0)


def _words(recording: Path) -> dict[str, Words]:
    """The last table of vehicles under /health, by vehicle and quantity."""
    last: tuple[int, str] = (-1, "")
    for chunk in RrdReader(recording).stream():
        if chunk.entity_path == VEHICLES and not chunk.is_static:
            batch = chunk.to_record_batch()
            texts = batch.column("TextDocument:text").to_pylist()
            last = max(
                last, *zip(batch.column("utc").cast("int64").to_pylist(), (text[0] for text in texts), strict=True)
            )
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in last[1].splitlines()]
    return {name: {row[0]: row[1 + column] for row in cells[2:]} for column, name in enumerate(cells[0][1:])}


Replay = Callable[..., Archive]


@pytest.fixture
def replay(talkdown: Talkdown, tmp_path: Path) -> Replay:
    """Replay what is said ten times a second (and files beside it) with an archive."""
    site = tmp_path / "site.toml"
    site.write_text(format_site(DEMO_SITE), encoding="utf-8")

    def run(say: Said, *files: Path, there: bool = False) -> Archive:
        stream = Stream()
        for tenth in range(10 * SECONDS):
            stream.second = 0.1 * tenth
            if tenth % 5 == 0:
                stream.be_there()
            if there:
                stream.be_somewhere()
            say(stream)
        recording = tmp_path / "flight.tlog"
        recording.write_bytes(bytes(stream.bytes))
        outcome = talkdown(
            "replay", recording, *files, "--site", site, "--viewer", "none", "--archive", tmp_path / "kept", "--json"
        )
        assert outcome.code == 0, outcome.err
        return Archive(Path(outcome.summary["archive"]))

    return run


def silent(stream: Stream) -> None:
    """Nothing."""


def test_without_the_messages_below_there_is_no_row_and_no_such_word(replay: Replay) -> None:
    """What the others assert is not there all the same."""
    archive = replay(silent)
    assert archive.rows == []
    (words,) = archive.vehicles.values()
    assert not {"landed", "home", "plan", "flight plan", "position", "next waypoint"} & words.keys()
    assert not {what for what in words if what.startswith(("accel", "turn", "field", "wind", "airspeed", "roll"))}


# messages that tell of a position: rows of tracks.parquet -----------------------------------------------------------


def test_global_position_int_cov(replay: Replay) -> None:
    """Its own covariance is the report's, its altitude is above mean sea level, its velocity z down."""

    def say(stream: Stream) -> None:
        covariance = [0.0] * 36
        covariance[0] = covariance[7] = covariance[14] = 9.0
        covariance[21] = covariance[28] = covariance[35] = 0.04
        told = {"alt": 935_000, "relative_alt": 400_000, "vx": 40.0, "vy": 0.0, "vz": 2.0, "covariance": covariance}
        stream.say("GLOBAL_POSITION_INT_COV", time_usec=stream.boot_ms * 1000, estimator_type=3, **(PLACE | told))

    archive = replay(say)
    row = archive.of("mavlink:1")[0]
    assert (row["latitude_deg"], row["longitude_deg"]) == pytest.approx((31.0, 104.0), abs=1e-9)
    assert row["altitude_msl_m"] == pytest.approx(935.0, abs=1e-6)
    assert row["height_m"] == pytest.approx(935.0 + GEOID_M, abs=1e-6)
    assert (row["velocity_north_mps"], row["velocity_up_mps"]) == pytest.approx((40.0, -2.0), abs=1e-6)
    assert archive.sigma_m("mavlink:1") == pytest.approx(3.0, rel=1e-3)


def test_utm_global_position(replay: Replay) -> None:
    """Its altitude is above the ellipsoid; its next waypoint is shown."""

    def say(stream: Stream) -> None:
        there = {"time": stream.unix_us, "alt": 900_000, "vx": 0, "vy": 3000, "vz": -100, "h_acc": 2000, "v_acc": 4000}
        onward = {"next_lat": 310_100_000, "next_lon": 1_040_100_000, "next_alt": 800_000}
        stream.say("UTM_GLOBAL_POSITION", flags=0xFF, flight_state=3, **(PLACE | there | onward))

    archive = replay(say)
    row = archive.of("mavlink:1")[0]
    assert row["height_m"] == pytest.approx(900.0, abs=1e-6)
    assert (row["velocity_east_mps"], row["velocity_up_mps"]) == pytest.approx((30.0, 1.0), abs=1e-6)
    assert archive.sigma_m("mavlink:1") == pytest.approx(2.0, rel=1e-3)
    assert archive.vehicles["mavlink:1"]["next waypoint"] == "31.010000, 104.010000"


@pytest.mark.parametrize("geometric", [False, True])
def test_adsb_vehicle(replay: Replay, geometric: bool) -> None:
    """Another aircraft, by its address, where it was `tslc` ago; a pressure altitude is no height."""

    def say(stream: Stream) -> None:
        if round(10 * stream.second) % 10 == 0:
            moved = round(stream.second * 60.0 / 111_195.0 * 1e7)
            place = {
                "lat": PLACE["lat"] + moved,
                "lon": PLACE["lon"],
                "altitude": 1_200_000,
                "altitude_type": geometric,
            }
            motion = {
                "heading": 0,
                "hor_velocity": 6000,
                "ver_velocity": 300,
                "tslc": 1,
                "flags": 1 | 2 | 4 | 8 | 16 | 128,
            }
            stream.say("ADSB_VEHICLE", ICAO_address=0x4840D6, callsign=b"TDN12", **(place | motion))

    rows = replay(say).of("icao:4840d6")
    assert rows[0]["callsign"] == "TDN12"
    assert rows[0]["velocity_north_mps"] == pytest.approx(60.0, abs=0.01)
    assert rows[0]["received"] - rows[0]["time"] == pytest.approx(1e9, abs=1e7)
    heights = {row["height_m"] for row in rows} if not geometric else {round(row["height_m"]) for row in rows[:1]}
    assert heights == ({1200} if geometric else {None})
    assert {row["altitude_msl_m"] is None for row in rows} == {not geometric}
    assert {row["pressure_altitude_m"] for row in rows} == ({None} if geometric else {1200.0})


def test_open_drone_id_location(replay: Replay) -> None:
    """Accuracy classes become sigmas; without a geodetic altitude there is no height."""

    def say(stream: Stream) -> None:
        place = {"latitude": PLACE["lat"], "longitude": PLACE["lon"], "altitude_geodetic": -1000.0}
        motion = {"direction": 9000, "speed_horizontal": 1000, "speed_vertical": 50, "altitude_barometric": 505.0}
        known = {"horizontal_accuracy": 10, "vertical_accuracy": 4, "speed_accuracy": 3, "status": 2}
        seconds = stream.unix_us / 1e6 % 3600.0
        stream.say("OPEN_DRONE_ID_LOCATION", timestamp=seconds, id_or_mac=[0] * 20, **(place | motion | known))

    archive = replay(say)
    row = archive.of("mavlink:1")[0]
    assert row["height_m"] is None
    assert row["pressure_altitude_m"] == 505.0
    assert row["velocity_east_mps"] == pytest.approx(10.0, abs=0.01)
    assert 4.0 < archive.sigma_m("mavlink:1") < 10.0  # 10 m in 95 of 100 cases, and what the time's steps add
    assert archive.vehicles["mavlink:1"]["landed"] == "in air"


def test_high_latency2(replay: Replay) -> None:
    """One message tells of place, air and way; it makes no velocity of a heading."""

    def say(stream: Stream) -> None:
        if round(10 * stream.second) % 10 == 0:
            place = {"latitude": PLACE["lat"], "longitude": PLACE["lon"], "altitude": 935, "heading": 45, "eph": 30}
            air = {"airspeed": 100, "groundspeed": 110, "temperature_air": 15}
            stream.say("HIGH_LATENCY2", timestamp=stream.boot_ms, type=1, autopilot=3, **(place | air))

    archive = replay(say)
    row = archive.of("mavlink:1")[0]
    assert row["altitude_msl_m"] == pytest.approx(935.0, abs=1e-6)
    words = archive.vehicles["mavlink:1"]
    assert (words["airspeed, m/s"], words["ground speed, m/s"]) == ("20.0", "22.0")
    assert words["air temperature, degrees C"] == "15.0"


# messages that tell of the vehicle: what is shown under /health -----------------------------------------------------

IMU = {"xacc": 0, "yacc": 300, "zacc": -400, "xgyro": 0, "ygyro": 0, "zgyro": 500}
HALF = math.sqrt(0.5)
SHOWN: dict[str, tuple[dict[str, Any], Words]] = {
    "ATTITUDE_QUATERNION": (
        {"q1": HALF, "q4": HALF},  # a quarter turn to the right
        {"roll, degrees": "0", "heading, degrees": "90.0"},
    ),
    "RAW_IMU": (IMU, {"acceleration, m/s2": "4.90", "turn rate, rad/s": "0.500"}),
    "SCALED_IMU": (IMU, {"acceleration, m/s2": "4.90", "turn rate, rad/s": "0.500"}),
    "SCALED_IMU2": (IMU, {"acceleration of sensor 2, m/s2": "4.90", "turn rate of sensor 2, rad/s": "0.500"}),
    "HIGHRES_IMU": (
        {"yacc": 3.0, "zacc": -4.0, "zgyro": 0.25, "abs_pressure": 950.0, "fields_updated": 0x23F},
        {"acceleration, m/s2": "5.00", "turn rate, rad/s": "0.250", "static pressure, hPa": "950"},
    ),
    "VFR_HUD": (
        {"airspeed": 23.5, "groundspeed": 21.0, "alt": 935.0, "climb": -1.5},
        {"airspeed, m/s": "23.5", "ground speed, m/s": "21.0", "climb, m/s": "-1.50", "altitude, m": "935"},
    ),
    "WIND": ({"direction": 290.0, "speed": 5.0}, {"wind, m/s": "5.00", "wind from, degrees": "290"}),
    "HOME_POSITION": (
        {"latitude": 310_000_000, "longitude": 1_040_000_000, "altitude": 535_000},
        {"home": "31.000000, 104.000000, 535.0 m", "flight plan": "home"},
    ),
    "EXTENDED_SYS_STATE": ({"landed_state": 4}, {"landed": "landing"}),
}
TIMES = {"time_boot_ms": lambda stream: stream.boot_ms, "time_usec": lambda stream: stream.boot_ms * 1000}


@pytest.mark.parametrize("name", SHOWN)
def test_what_a_vehicle_tells_of_itself_is_shown(replay: Replay, name: str) -> None:
    fields, expected = SHOWN[name]
    times = {field: tell for field, tell in TIMES.items() if field in nothing_said(name)}

    def say(stream: Stream) -> None:
        stream.say(name, **(fields | {field: tell(stream) for field, tell in times.items()}))

    archive = replay(say, there=True)
    words = archive.vehicles["mavlink:1"]
    assert {what: words.get(what) for what in expected} == expected
    assert len(archive.of("mavlink:1")) >= 10 * SECONDS - 1  # and the track goes on beside it


ITEMS = [
    (16, 310_100_000, 1_040_000_000, 100.0),
    (16, 310_200_000, 1_040_000_000, 120.0),
    (21, 310_000_000, 1_040_000_000, 0.0),
]


def test_a_mission_that_is_overheard(replay: Replay) -> None:
    """A station fetches the mission: the vehicle's own items, and the one that it goes to now."""

    def say(stream: Stream) -> None:
        tenth = round(10 * stream.second)
        station = {"target_system": 255, "target_component": 190}
        if tenth == 10:
            stream.say("MISSION_COUNT", count=1 + len(ITEMS), **station)
        if tenth == 11:
            stream.say(
                "MISSION_ITEM_INT", seq=0, command=16, frame=0, x=PLACE["lat"], y=PLACE["lon"], z=535.0, **station
            )
        if 12 <= tenth < 12 + len(ITEMS):
            command, x, y, z = ITEMS[tenth - 12]
            stream.say("MISSION_ITEM_INT", seq=tenth - 11, command=command, frame=3, x=x, y=y, z=z, **station)
        if tenth == 16:
            stream.say("MISSION_ACK", by=(255, 190), target_system=1, target_component=1)
        if tenth >= 20 and tenth % 10 == 0:
            stream.say("MISSION_CURRENT", seq=2, total=3, mission_state=3)

    words = replay(say, there=True).vehicles["mavlink:1"]
    assert words["plan"] == "3 points, next 2"
    assert words["flight plan"] == "2 waypoints, landing"
    assert words["mission"] == "active"


def plan_file(folder: Path) -> Path:
    items = [
        {
            "type": "SimpleItem",
            "command": command,
            "frame": 3,
            "params": [0, 0, 0, 0, x / 1e7, y / 1e7, z],
            "doJumpId": n,
        }
        for n, (command, x, y, z) in enumerate(ITEMS, 1)
    ]
    mission = {"items": items, "plannedHomePosition": [31.0, 104.0, 535.0], "firmwareType": 3, "vehicleType": 1}
    path = folder / "mission.plan"
    path.write_text(json.dumps({"fileType": "Plan", "version": 1, "mission": mission}), encoding="utf-8")
    return path


def waypoint_file(folder: Path) -> Path:
    rows = [(16, PLACE["lat"], PLACE["lon"], 535.0), *ITEMS]
    lines = [
        "\t".join(map(str, (n, 0, 3 if n else 0, command, 0, 0, 0, 0, x / 1e7, y / 1e7, z, 1)))
        for n, (command, x, y, z) in enumerate(rows)
    ]
    path = folder / "mission.waypoints"
    path.write_text("\n".join(["QGC WPL 110", *lines]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("write", [plan_file, waypoint_file])
def test_a_mission_file_beside_the_recording(replay: Replay, tmp_path: Path, write: Callable[[Path], Path]) -> None:
    """It is the plan of the vehicle that is heard."""
    archive = replay(silent, write(tmp_path), there=True)
    assert archive.vehicles["mavlink:1"]["flight plan"] == "home, 2 waypoints, landing"
