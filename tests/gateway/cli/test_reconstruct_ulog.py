"""`talkdown reconstruct` on a flight log of PX4."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.app import run

BEGAN_US = 1_700_000_000_000_000
SPEED_MPS, WIND_MPS = 25.0, 5.0
LATITUDE_DEG, LONGITUDE_DEG = 47.0, 8.0
NORTH_M = 6_369_500.0  # the earth's radii of curvature there, to the north and to the east times the cosine
EAST_M = 6_389_600.0 * math.cos(math.radians(LATITUDE_DEG))
FORMATS = {
    "vehicle_status": "uint64_t timestamp;uint8_t system_type;uint8_t arming_state;uint8_t nav_state",
    "vehicle_gps_position": "uint64_t timestamp;uint64_t time_utc_usec;"
    "int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid;uint8_t fix_type",
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt",
    "vehicle_attitude": "uint64_t timestamp;float[4] q",
    "vehicle_air_data": "uint64_t timestamp;float baro_pressure_pa",
    "airspeed_validated": "uint64_t timestamp;float calibrated_airspeed_m_s;float true_airspeed_m_s",
}
PACKED = {"vehicle_status": "<QBBB", "vehicle_gps_position": "<QQiiiiB", "vehicle_global_position": "<Qddf"} | {
    "vehicle_attitude": "<Qffff",
    "vehicle_air_data": "<Qf",
    "airspeed_validated": "<Qff",
}


class Log:
    """A .ulg in the making: https://docs.px4.io/main/en/dev_log/ulog_file_format."""

    def __init__(self) -> None:
        self.content = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
        for name, fields in FORMATS.items():
            self._add(b"F", f"{name}:{fields};".encode())
        for number, name in enumerate(FORMATS):
            self._add(b"A", struct.pack("<BH", 0, number) + name.encode())

    def say(self, second: float, name: str, *values: float) -> None:
        """An entry of a topic."""
        at = round(1e6 * second) + 1_000_000
        self._add(b"D", struct.pack("<H", list(FORMATS).index(name)) + struct.pack(PACKED[name], at, *values))

    def _add(self, kind: bytes, content: bytes) -> None:
        self.content += struct.pack("<Hc", len(content), kind) + content


def test_a_px4_log_of_a_flight_closes_on_where_it_touched_down(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A circle of six minutes in a wind of 5 m/s: open it ends 1.8 km off, closed it is where it was, with that wind."""
    time = np.arange(440.0)
    flies = (time >= 40.0) & (time < 400.0)
    flown_s = np.clip(time - 40.0, 0.0, 360.0)
    compass = np.radians(flown_s)
    speed = np.where(flies, SPEED_MPS, 0.0)
    east = SPEED_MPS * np.degrees(1.0 - np.cos(compass)) + WIND_MPS * flown_s
    north = SPEED_MPS * np.degrees(np.sin(compass))
    latitude = LATITUDE_DEG + np.degrees(north / NORTH_M)
    longitude = LONGITUDE_DEG + np.degrees(east / EAST_M)
    log = Log()
    for row, second in enumerate(time.tolist()):
        where = float(latitude[row]), float(longitude[row])
        half = 0.5 * float(compass[row])
        log.say(second, "vehicle_status", 1, 2, 3)
        log.say(second, "vehicle_air_data", 101325.0)
        log.say(second, "vehicle_attitude", math.cos(half), 0.0, 0.0, math.sin(half))
        log.say(second, "airspeed_validated", float(speed[row]), float(speed[row]))
        fix = round(where[0] * 1e7), round(where[1] * 1e7), 0, 0
        log.say(second, "vehicle_gps_position", BEGAN_US + round(1e6 * second), *fix, 3)
        log.say(second, "vehicle_global_position", *where, 0.0)
    path = tmp_path / "flight.ulg"
    path.write_bytes(log.content)
    closed_on = f"{latitude[-1]},{longitude[-1]}"
    assert run(["reconstruct", str(path), "--close-on", closed_on, "--json"]) == 0
    (sortie,) = json.loads(capsys.readouterr().out)["mavlink:1"]
    assert sortie["took_off"]
    assert sortie["landed"]
    assert sortie["end_error_m"] == pytest.approx(360.0 * WIND_MPS, rel=0.03)
    assert sortie["wind_east_mps"] == pytest.approx(WIND_MPS, abs=0.15)
    assert sortie["wind_north_mps"] == pytest.approx(0.0, abs=0.15)
    beside = sortie["beside_positions"]
    assert beside["rmse_m"] < 20.0 < beside["open_rmse_m"]
