"""PX4's .ulg logs, told as MAVLink."""

import math
import sys
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from adapters.files import FileError, open_recording
from adapters.telling import Identity, Teller
from adapters.ulog_told import UlogTeller

RECORDING = Path(__file__).parents[3] / "shared" / "data" / "vtol-px4.ulg"
PLANE = Identity(3, 1, 22, 12, 1_600_000_000 * 10**6)


def said(*entries: tuple[int, str, dict[str, Any]]) -> tuple[dict[str, Any], Counter[str]]:
    """The last message of each kind that entries of topics make, decoded by pymavlink."""
    counters: Counter[str] = Counter()
    teller, link = UlogTeller(Teller(PLANE, counters)), dialect.MAVLink(None)
    frames = [frame for at_us, name, values in entries for _, frame in teller.hear(at_us, name, values)]
    messages = [link.decode(bytearray(frame)) for frame in frames]
    return {message.get_type(): message for message in messages}, counters


def test_status_and_landed_state_become_the_heartbeat_of_each_second() -> None:
    status = {"arming_state": 2, "nav_state": 3}
    messages, _ = said(
        (10**6, "vehicle_status", status), (1_500_000, "vehicle_land_detected", {"landed": 0}), (2 * 10**6, "x", {})
    )
    heartbeat = messages["HEARTBEAT"]
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.base_mode) == (22, 12, 129)
    assert heartbeat.custom_mode == 4 << 16 | 4 << 24  # a mission, flown by itself
    assert heartbeat.get_srcSystem() == 3
    assert messages["EXTENDED_SYS_STATE"].landed_state == 2
    assert messages["SYSTEM_TIME"].time_unix_usec == 1_600_000_002 * 10**6


@pytest.mark.parametrize(
    "place",
    [
        {"lat": 473977000, "lon": 85455000, "alt": 488100, "alt_ellipsoid": 535300},
        {"latitude_deg": 47.3977, "longitude_deg": 8.5455, "altitude_msl_m": 488.1, "altitude_ellipsoid_m": 535.3},
    ],
)
def test_a_fix_is_told_alike_from_old_and_new_logs(place: dict[str, Any]) -> None:
    accuracy = {"eph": 0.8, "epv": 1.2, "s_variance_m_s": 0.3, "hdop": 0.7, "vdop": 1.0}
    values = {**place, **accuracy, "fix_type": 3, "vel_m_s": 20.5, "cog_rad": -math.pi / 2, "satellites_used": 14}
    fix = said((10**6, "sensor_gps", values))[0]["GPS_RAW_INT"]
    assert (fix.lat, fix.lon, fix.alt, fix.alt_ellipsoid) == (473977000, 85455000, 488100, 535300)
    assert (fix.h_acc, fix.v_acc, fix.vel_acc, fix.eph, fix.epv) == (800, 1200, 300, 70, 100)
    assert (fix.vel, fix.cog, fix.fix_type, fix.satellites_visible) == (2050, 27000, 3, 14)


def test_a_position_has_its_velocity_from_the_local_position_while_that_is_fresh() -> None:
    local = {"vx": 3.0, "vy": -4.0, "vz": 0.5, "heading": -0.1}
    place = {"lat": 47.4, "lon": 8.5, "alt": 500.0}
    fresh = said((10**6, "vehicle_local_position", local), (1_100_000, "vehicle_global_position", place))[0]
    position = fresh["GLOBAL_POSITION_INT"]
    assert (position.vx, position.vy, position.vz) == (300, -400, 50)
    assert position.hdg == round(math.degrees(-0.1) % 360 * 100)
    old = said((10**6, "vehicle_local_position", local), (9 * 10**6, "vehicle_global_position", place))[0]
    assert old["GLOBAL_POSITION_INT"].vx == 32767
    assert old["GLOBAL_POSITION_INT"].hdg == 65535


def test_sensors_keep_their_units() -> None:
    sample = {f"accelerometer_m_s2[{n}]": value for n, value in enumerate((0.1, -0.2, -9.8))}
    sample |= {f"gyro_rad[{n}]": value for n, value in enumerate((0.01, 0.02, 0.03))}
    imu = said((10**6, "sensor_combined", sample))[0]["HIGHRES_IMU"]
    assert (round(imu.zacc, 5), round(imu.zgyro, 5), imu.fields_updated) == (-9.8, 0.03, 0x3F)
    pressure = said((10**6, "vehicle_air_data", {"baro_pressure_pa": 95000.0}))[0]["HIGHRES_IMU"]
    assert (pressure.abs_pressure, pressure.fields_updated) == (950.0, 0x200)
    wind = {"windspeed_north": 3.0, "windspeed_east": -2.0, "variance_north": 0.5, "variance_east": 0.5}
    told = said((10**6, "wind", wind))[0]["WIND_COV"]
    assert (told.wind_x, told.wind_y, told.var_horiz) == (3.0, -2.0, 0.5)


def test_a_wind_that_is_not_estimated_yet_is_not_told() -> None:
    nothing = dict.fromkeys(("windspeed_north", "windspeed_east", "variance_north", "variance_east"), 0.0)
    assert "WIND_COV" not in said((10**6, "wind_estimate", nothing))[0]


def test_an_entry_that_lacks_what_its_message_needs_is_counted() -> None:
    messages, counters = said(
        (10**6, "vehicle_global_position", {"lat": 47.4}), (10**6, "home_position", {"lat": math.nan})
    )
    assert "GLOBAL_POSITION_INT" not in messages
    assert counters["values not usable"] == 2


def test_without_pyulog_one_sentence_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.ulg"
    path.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(64))
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(FileError, match=r"pip install talkdown\[ulog\]") as refused:
        open_recording(path)
    assert "\n" not in str(refused.value)


def test_a_real_log_is_told_with_its_utc() -> None:
    """21 April 2021, by its receiver; 32 fixes in Norway, none damaged."""
    pytest.importorskip("pyulog", reason="the extra `ulog` is not installed")
    if not RECORDING.exists():
        pytest.skip("the recordings are not beside the project")
    recording = open_recording(RECORDING)
    arrivals = list(recording.arrivals())
    assert all(later.received_at > earlier.received_at for earlier, later in pairwise(arrivals))
    assert not recording.counters
    link = dialect.MAVLink(None)
    messages = [link.decode(bytearray(arrival.data)) for arrival in arrivals]
    kinds = Counter(message.get_type() for message in messages)
    assert kinds["GPS_RAW_INT"] == 32
    assert kinds["ATTITUDE_QUATERNION"] == 1298
    time = next(message for message in messages if message.get_type() == "SYSTEM_TIME")
    assert 1_618_986_000 < time.time_unix_usec / 1e6 < 1_618_990_000
