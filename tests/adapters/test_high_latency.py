"""HIGH_LATENCY2: one message that says a little of everything."""

import math
from typing import Any

import pytest

from gateway.observation import AirData, GpsReport, Intent, VehicleStatus

ARDUPILOT, PX4 = 3, 12
MESSAGE = {
    "type": 1, "autopilot": ARDUPILOT, "custom_mode": 10, "latitude": 310_000_000, "longitude": 1_040_000_000,
    "altitude": 523, "heading": 45, "airspeed": 110, "groundspeed": 120, "windspeed": 25, "wind_heading": 45,
    "eph": 14, "epv": 21, "temperature_air": -5, "climb_rate": 20, "battery": 80, "wp_num": 3, "custom0": -128,
}  # fmt: skip


def _say(plane: Any, **values: Any) -> dict[type, Any]:
    plane.second += 5.0
    found = plane.say("HIGH_LATENCY2", **(MESSAGE | {"timestamp": plane.boot_ms} | values))
    return {type(one): one for one in found}


def test_it_tells_position_air_status_and_goal(plane: Any) -> None:
    found = _say(plane)
    report, air, status, intent = (found[kind] for kind in (GpsReport, AirData, VehicleStatus, Intent))
    assert (report.altitude_msl_m, report.height_m) == (523.0, None)
    assert report.compass_heading_rad == pytest.approx(math.radians(90))
    assert (report.horizontal_sigma_m, report.vertical_sigma_m) == (1.4, 2.1)
    assert abs(report.valid_at - report.received_at) < 2_000_000
    assert (air.airspeed_mps, air.groundspeed_mps, air.temperature_k) == (22.0, 24.0, 268.15)
    assert (status.armed, status.custom_mode, status.vehicle_type) == (True, 10, 1)
    assert (intent.told_by, intent.sequence, intent.latitude_rad) == ("high latency", 3, None)
    assert plane.health().words["failures"] == "none"


def test_a_heading_and_a_speed_make_no_velocity(plane: Any) -> None:
    """The heading is where the nose points, and the climb rate has no sign."""
    report = _say(plane)[GpsReport]
    assert report.velocity_east_mps is report.velocity_north_mps is report.velocity_up_mps is None


@pytest.mark.parametrize(("autopilot", "east", "north"), [(ARDUPILOT, -5.0, 0.0), (PX4, 5.0, 0.0), (4, None, None)])
def test_its_wind_comes_from_there_with_ardupilot_and_goes_there_with_px4(
    plane: Any, autopilot: int, east: float | None, north: float | None
) -> None:
    """Wind heading 90 degrees, 5 m/s."""
    air = _say(plane, autopilot=autopilot)[AirData]
    if east is None:
        assert air.wind_east_mps is air.wind_north_mps is None
        assert plane.counter("wind direction undefined") == 1
    else:
        assert (air.wind_east_mps, air.wind_north_mps) == (pytest.approx(east), pytest.approx(north, abs=1e-9))


@pytest.mark.parametrize("error", [0, 255])
def test_an_error_that_is_not_given_is_none(plane: Any, error: int) -> None:
    report = _say(plane, eph=error, epv=error)[GpsReport]
    assert report.horizontal_sigma_m is report.vertical_sigma_m is None


def test_what_is_not_measured_makes_no_air_data(plane: Any) -> None:
    silent = {"airspeed": 0, "groundspeed": 0, "windspeed": 0, "temperature_air": -128}
    assert AirData not in _say(plane, **silent)
    assert AirData not in _say(plane, **silent | {"airspeed": 255, "groundspeed": 255})


def test_px4_does_not_say_whether_it_is_armed(plane: Any) -> None:
    assert VehicleStatus not in _say(plane, autopilot=PX4)


@pytest.mark.parametrize(("waypoint", "autopilot"), [(65535, PX4), (0, ARDUPILOT)])
def test_no_waypoint_is_no_goal(plane: Any, waypoint: int, autopilot: int) -> None:
    assert Intent not in _say(plane, wp_num=waypoint, autopilot=autopilot)


def test_a_goal_is_told_when_it_changes(plane: Any) -> None:
    assert [Intent in _say(plane, wp_num=number) for number in (3, 3, 4)] == [True, False, True]


def test_with_a_gps_failure_there_is_no_position_and_the_failure_is_shown(plane: Any) -> None:
    assert GpsReport not in _say(plane, failure_flags=1 | 4096)
    assert plane.counter("no fix") == 1
    assert plane.health().words["failures"] == "GPS, estimator"


def test_before_it_has_a_position_there_is_no_report(plane: Any) -> None:
    assert GpsReport not in _say(plane, latitude=0, longitude=0)
    assert plane.counter("no position yet") == 1


def test_a_message_that_comes_twice_reports_once(plane: Any) -> None:
    _say(plane)
    boot_ms = plane.boot_ms
    assert GpsReport not in _say(plane, timestamp=boot_ms)


def test_it_makes_a_vehicle_of_who_sends_no_heartbeat(speaker: Any) -> None:
    assert GpsReport in _say(speaker(system=4, component=25))
    assert GpsReport not in _say(speaker(system=4, component=25), autopilot=8)
