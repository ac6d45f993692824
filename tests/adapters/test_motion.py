"""Attitudes and inertial samples, in SI along the body's axes."""

import math
from typing import Any

import pytest

from gateway.observation import AirData, Attitude, ImuSample

G = 9.80665
RAW = {
    "xacc": 100,
    "yacc": -50,
    "zacc": -1000,
    "xgyro": 10,
    "ygyro": -20,
    "zgyro": 30,
    "xmag": 222,
    "ymag": 85,
    "zmag": -528,
}
SI = {
    "xacc": 0.5, "yacc": -0.25, "zacc": -9.75, "xgyro": 0.125, "ygyro": -0.25, "zgyro": 0.5, "xmag": 0.25, "ymag": 0.125,
    "zmag": -0.5, "abs_pressure": 950.0, "diff_pressure": 2.5,
}  # fmt: skip


def _quaternion(plane: Any, *q: float, **values: Any) -> tuple[Any, ...]:
    plane.second += 0.1
    named = dict(zip(("q1", "q2", "q3", "q4"), q, strict=True))
    found: tuple[Any, ...] = plane.say("ATTITUDE_QUATERNION", time_boot_ms=plane.boot_ms, **named, **values)
    return found


@pytest.mark.parametrize(
    ("q", "angles"),
    [
        ((1, 0, 0, 0), (0, 0, 0)),
        ((math.cos(0.2), math.sin(0.2), 0, 0), (0.4, 0, 0)),
        ((math.cos(0.15), 0, math.sin(0.15), 0), (0, 0.3, 0)),
        ((math.cos(0.5), 0, 0, math.sin(0.5)), (0, 0, 1.0)),
        ((-math.cos(0.5), 0, 0, -math.sin(0.5)), (0, 0, 1.0)),
    ],
    ids=["level", "roll", "pitch", "yaw", "the other sign"],
)
def test_a_quaternion_is_an_attitude(plane: Any, q: tuple[float, ...], angles: tuple[float, ...]) -> None:
    (attitude,) = _quaternion(plane, *q)
    assert isinstance(attitude, Attitude)
    assert (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad) == pytest.approx(angles, abs=1e-6)


def test_all_three_angles_come_back_from_a_quaternion(plane: Any) -> None:
    """Roll 0.3, pitch -0.4, yaw 2.0, by the half angles of yaw, then pitch, then roll."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(half), math.sin(half)) for half in (0.15, -0.2, 1.0))
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    (attitude,) = _quaternion(plane, w, x, y, z)
    assert (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad) == pytest.approx((0.3, -0.4, 2.0), abs=1e-6)


def test_a_tailsitters_offset_is_turned_by_last(plane: Any) -> None:
    """90 degrees less 0.2 nose down, then an offset of 90 degrees nose up: 0.2 nose up."""
    half = (math.pi / 2 - 0.2) / 2
    (attitude,) = _quaternion(
        plane, math.cos(-half), 0, math.sin(-half), 0, repr_offset_q=[math.sqrt(0.5), 0, math.sqrt(0.5), 0]
    )
    assert attitude.pitch_rad == pytest.approx(0.2, abs=1e-6)
    assert attitude.roll_rad == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (2, 0, 0, 0), (math.nan, 0, 0, 0), (math.inf, 0, 0, 0)])
def test_what_is_no_rotation_is_refused(plane: Any, q: tuple[float, ...]) -> None:
    assert _quaternion(plane, *q) == ()
    assert plane.counter("not a rotation") == 1


def test_an_attitude_told_by_both_messages_counts_once(plane: Any) -> None:
    assert _quaternion(plane, 1, 0, 0, 0)
    assert plane.say("ATTITUDE", time_boot_ms=plane.boot_ms) == ()
    assert plane.counter("attitude told twice") == 1


@pytest.mark.parametrize(
    ("name", "sensor"), [("RAW_IMU", 1), ("SCALED_IMU", 1), ("SCALED_IMU2", 2), ("SCALED_IMU3", 3)]
)
def test_milligauss_and_thousandths_become_si(plane: Any, name: str, sensor: int) -> None:
    time = {"time_usec": plane.boot_ms * 1000} if name == "RAW_IMU" else {"time_boot_ms": plane.boot_ms}
    sample = plane.one(name, **RAW, **time)
    assert isinstance(sample, ImuSample)
    assert sample.sensor == sensor
    assert sample.acceleration_mps2 == pytest.approx((0.1 * G, -0.05 * G, -G))
    assert sample.angular_rate_radps == pytest.approx((0.01, -0.02, 0.03))
    assert sample.magnetic_field_gauss == pytest.approx((0.222, 0.085, -0.528))
    assert abs(sample.valid_at - sample.received_at) < 2_000_000
    which = "" if sensor == 1 else f" of sensor {sensor}"
    assert plane.health().readings[f"acceleration{which}, m/s2"] == pytest.approx(G * math.hypot(0.1, 0.05, 1.0))


def test_raw_units_are_known_of_ardupilot_only(speaker: Any) -> None:
    px4 = speaker()
    px4.heartbeat(autopilot=12)
    assert px4.say("RAW_IMU", **RAW) == ()
    assert px4.counter("raw units unknown") == 1


def test_a_raw_sensors_number_counts_from_one(plane: Any) -> None:
    assert plane.one("RAW_IMU", **RAW, id=2).sensor == 3


def test_an_inertial_time_that_is_not_of_this_boot_gives_way_to_the_time_of_receipt(plane: Any) -> None:
    for usec in (0, 10**12, 10**15 + 5):
        sample = plane.one("RAW_IMU", **RAW, time_usec=usec)
        assert abs(sample.valid_at - sample.received_at) < 2_000_000


def test_sensors_that_are_not_there_are_none(plane: Any) -> None:
    """Nothing pulls with (0, 0, 0), and there is no place without a magnetic field."""
    sample = plane.one("SCALED_IMU", **RAW | {"xmag": 0, "ymag": 0, "zmag": 0})
    assert sample.magnetic_field_gauss is None
    assert sample.acceleration_mps2 is not None
    assert plane.say("SCALED_IMU2") == ()
    assert plane.counter("inertial unit without data") == 1
    compass = plane.one("SCALED_IMU2", xmag=222)
    assert compass.acceleration_mps2 is compass.angular_rate_radps is None


@pytest.mark.parametrize(("axis", "field"), [("yacc", "acceleration_mps2"), ("zgyro", "angular_rate_radps")])
@pytest.mark.parametrize("end", [32767, -32768])
def test_a_value_at_the_end_of_its_range_is_cut_off(plane: Any, axis: str, field: str, end: int) -> None:
    sample = plane.one("SCALED_IMU", **RAW | {axis: end})
    assert {name for name in ("acceleration_mps2", "angular_rate_radps", "magnetic_field_gauss")
            if getattr(sample, name) is None} == {field}  # fmt: skip
    assert plane.counter("inertial out of range") == 1


def test_a_highres_sample_is_si_already_and_brings_its_pressures(plane: Any) -> None:
    sample, air = plane.say("HIGHRES_IMU", **SI, time_usec=plane.boot_ms * 1000, fields_updated=0x1FFF, id=1)
    assert isinstance(sample, ImuSample)
    assert isinstance(air, AirData)
    assert sample.sensor == 2
    assert sample.acceleration_mps2 == (0.5, -0.25, -9.75)
    assert sample.angular_rate_radps == (0.125, -0.25, 0.5)
    assert sample.magnetic_field_gauss == (0.25, 0.125, -0.5)
    assert (air.static_pressure_pa, air.differential_pressure_pa) == (95_000.0, 250.0)
    assert air.temperature_k is None, "it is the sensor's"


@pytest.mark.parametrize(
    ("updated", "fields"),
    [(0x7, {"acceleration_mps2"}), (0x38, {"angular_rate_radps"}), (0x1C0, {"magnetic_field_gauss"}), (0x3, set())],
)
def test_only_what_was_updated_is_told(plane: Any, updated: int, fields: set[str]) -> None:
    found = plane.say("HIGHRES_IMU", **SI, fields_updated=updated)
    names = ("acceleration_mps2", "angular_rate_radps", "magnetic_field_gauss")
    assert {name for one in found for name in names if getattr(one, name) is not None} == fields


def test_a_highres_value_that_is_no_number_is_refused_and_the_rest_is_good(plane: Any) -> None:
    (sample,) = plane.say("HIGHRES_IMU", **SI | {"xacc": math.nan, "zgyro": math.inf}, fields_updated=0x1FF)
    assert sample.acceleration_mps2 is sample.angular_rate_radps is None
    assert sample.magnetic_field_gauss == (0.25, 0.125, -0.5)
    assert (plane.counter("not a number"), plane.counter("inertial out of range")) == (1, 1)


def test_a_pressure_of_nothing_is_refused(plane: Any) -> None:
    (air,) = plane.say("HIGHRES_IMU", **SI | {"abs_pressure": 0.0}, fields_updated=0x600)
    assert (air.static_pressure_pa, air.differential_pressure_pa) == (None, 250.0)
    assert plane.counter("pressure out of range") == 1
