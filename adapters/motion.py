"""How a vehicle lies, turns and is accelerated.

    ATTITUDE (30)              roll, pitch, yaw rad
    ATTITUDE_QUATERNION (31)   q1..q4 = w, x, y, z; repr_offset_q, where it is given, is turned by last (tailsitters)
    RAW_IMU (27)               mG, mrad/s, mgauss only with ArduPilot: elsewhere the units are the sensor's own
    SCALED_IMU (26), SCALED_IMU2 (116), SCALED_IMU3 (129)   mG, mrad/s, mgauss of sensors 1, 2, 3
    HIGHRES_IMU (105)          m/s2, rad/s, gauss; fields_updated: bits 0..2 acceleration, 3..5 rates, 6..8 field;
                               also 9 abs_pressure, 10 diff_pressure, hPa: AirData

A magnetic field, or an acceleration, of exactly (0, 0, 0) is that of no sensor: not measured. An integer at the end of its
range is cut off: not measured, and counted. RAW_IMU and HIGHRES_IMU number sensors from 0, we from 1.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any

from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations, Reader
from adapters.roles import ARDUPILOT
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import AirData, Attitude, ImuSample, Observation

ATTITUDE, _read_attitude = fields("ATTITUDE", "time_boot_ms", "roll", "pitch", "yaw")
_OFFSET = tuple(f"repr_offset_q[{index}]" for index in range(4))
ATTITUDE_QUATERNION, _read_quaternion = fields("ATTITUDE_QUATERNION", "time_boot_ms", "q1", "q2", "q3", "q4", *_OFFSET)
AXES = ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag")
RAW_IMU, _read_raw = fields("RAW_IMU", *AXES, "time_usec", "id")
SCALED_IMU, _read_scaled = fields("SCALED_IMU", *AXES, "time_boot_ms")
SCALED_IMU2, _read_scaled_2 = fields("SCALED_IMU2", *AXES, "time_boot_ms")
SCALED_IMU3, _read_scaled_3 = fields("SCALED_IMU3", *AXES, "time_boot_ms")
HIGHRES_IMU, _read_highres = fields(
    "HIGHRES_IMU", *AXES, "time_usec", "id", "fields_updated", "abs_pressure", "diff_pressure"
)

MILLI_G = 9.80665e-3
CUT_OFF = 32767
_ACCELERATION, _RATE, _FIELD, _ABSOLUTE, _DIFFERENTIAL = 0x7, 0x38, 0x1C0, 0x200, 0x400
_GREATEST = 1e6  # no sensor's acceleration, rate or field

_NAMES = tuple(  # of what people are shown, by sensor
    tuple(
        f"{name}{which}, {unit}"
        for name, unit in (("acceleration", "m/s2"), ("turn rate", "rad/s"), ("field", "gauss"))
    )
    for which in ("", *(f" of sensor {number}" for number in range(2, 9)), " of sensor 9 or more")
)

Vector = tuple[float, float, float]
_NOTHING: Vector = (0.0, 0.0, 0.0)


def attitude(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """ATTITUDE."""
    boot_ms, roll, pitch, yaw = _read_attitude(payload)
    boot_ns = moments.boot(component, vehicle, boot_ms, received_at, counters)
    if boot_ns is None:
        return ()
    if not math.isfinite(roll + pitch + yaw):
        counters["not a number"] += 1
        return ()
    return _attitude(moments, component, vehicle, boot_ns, received_at, (roll, pitch, yaw), counters)


def quaternion(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """ATTITUDE_QUATERNION."""
    boot_ms, w, x, y, z, *offset = _read_quaternion(payload)
    boot_ns = moments.boot(component, vehicle, boot_ms, received_at, counters)
    if boot_ns is None:
        return ()
    norm = math.hypot(w, x, y, z)
    if not 0.9 < norm < 1.1:  # false for what is no number, too
        counters["not a rotation"] += 1
        return ()
    if 0.9 < math.hypot(*offset) < 1.1:
        w, x, y, z = _product((w, x, y, z), offset)
        norm = math.hypot(w, x, y, z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return _attitude(moments, component, vehicle, boot_ns, received_at, (roll, pitch, yaw), counters)


def _attitude(
    moments: Moments,
    component: Component,
    vehicle: Vehicle,
    boot_ns: int,
    received_at: int,
    angles: Vector,
    counters: Counter[str],
) -> Observations:
    """An attitude, unless the other message has told that of this instant already."""
    if boot_ns == vehicle.last_attitude:
        counters["attitude told twice"] += 1
        return ()
    vehicle.last_attitude, vehicle.attitude_rad = boot_ns, angles
    valid_at, _ = moments.when(component, boot_ns, received_at)
    return (Attitude(vehicle.name, valid_at, received_at, *angles),)


def _product(one: tuple[float, float, float, float], other: list[float]) -> tuple[float, float, float, float]:
    """The rotation `other`, then `one`; both as w, x, y, z."""
    a, b, c, d = one
    w, x, y, z = other
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def raw_imu(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """RAW_IMU."""
    if vehicle.status is None or vehicle.status.autopilot != ARDUPILOT:
        counters["raw units unknown"] += 1
        return ()
    *axes, usec, number = _read_raw(payload)
    valid_at = moments.shown_near(component, usec, received_at)
    return _scaled(vehicle, number + 1, axes, valid_at, received_at, counters)


def _scaled_sensor(read: Callable[[bytes], tuple[Any, ...]], sensor: int) -> Reader:
    """The reader of a sensor with a message of its own."""

    def hear(
        moments: Moments,
        component: Component,
        vehicle: Vehicle,
        payload: bytes,
        received_at: int,
        counters: Counter[str],
    ) -> Observations:
        *axes, boot_ms = read(payload)
        valid_at = moments.shown_near(component, boot_ms * 1000, received_at)
        return _scaled(vehicle, sensor, axes, valid_at, received_at, counters)

    return hear


scaled_imu = _scaled_sensor(_read_scaled, 1)
scaled_imu_2 = _scaled_sensor(_read_scaled_2, 2)
scaled_imu_3 = _scaled_sensor(_read_scaled_3, 3)


def highres_imu(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """HIGHRES_IMU: what it says was updated."""
    *axes, usec, number, updated, absolute, differential = _read_highres(payload)
    valid_at = moments.shown_near(component, usec, received_at)
    vectors = [
        _vector(axes[first : first + 3], counters) if updated & bits == bits else None
        for first, bits in ((0, _ACCELERATION), (3, _RATE), (6, _FIELD))
    ]
    found: list[Observation] = []
    if any(one is not None for one in vectors):
        found.append(_sample(vehicle, number + 1, vectors, valid_at, received_at))
    pressures = (absolute if updated & _ABSOLUTE else math.nan, differential if updated & _DIFFERENTIAL else math.nan)
    static, pitot = (None if not math.isfinite(one) else one * 100 for one in pressures)
    if static is not None and static <= 0:
        counters["pressure out of range"] += 1
        static = None
    if static is not None:
        vehicle.readings["static pressure, hPa"] = static / 100
    if static is not None or pitot is not None:
        air = AirData(vehicle.name, valid_at, received_at, static_pressure_pa=static, differential_pressure_pa=pitot)
        found.append(air)
    return tuple(found)


def _vector(axes: list[float], counters: Counter[str]) -> Vector | None:
    x, y, z = axes
    if not abs(x) + abs(y) + abs(z) < _GREATEST:  # false for NaN, too
        counters["not a number" if math.isnan(x + y + z) else "inertial out of range"] += 1
        return None
    return x, y, z


def _scaled(
    vehicle: Vehicle, sensor: int, axes: list[int], valid_at: int, received_at: int, counters: Counter[str]
) -> Observations:
    """A sample in mG, mrad/s and mgauss."""
    ax, ay, az, gx, gy, gz, mx, my, mz = axes
    acceleration: Vector | None = (ax * MILLI_G, ay * MILLI_G, az * MILLI_G)
    rate: Vector | None = (gx / 1000, gy / 1000, gz / 1000)
    magnetic: Vector | None = (mx / 1000, my / 1000, mz / 1000)
    if max(axes) >= CUT_OFF or min(axes) <= -CUT_OFF:
        counters["inertial out of range"] += 1
        cut = [max(map(abs, axes[first : first + 3])) >= CUT_OFF for first in (0, 3, 6)]
        acceleration, rate, magnetic = (
            None if is_cut else told for is_cut, told in zip(cut, (acceleration, rate, magnetic), strict=True)
        )
    if acceleration == _NOTHING:
        acceleration, rate = None, None if rate == _NOTHING else rate
    if magnetic == _NOTHING:
        magnetic = None
    if acceleration is None and rate is None and magnetic is None:
        counters["inertial unit without data"] += 1
        return ()
    return (_sample(vehicle, sensor, [acceleration, rate, magnetic], valid_at, received_at),)


def _sample(vehicle: Vehicle, sensor: int, vectors: list[Vector | None], valid_at: int, received_at: int) -> ImuSample:
    acceleration, rate, magnetic = vectors
    latest = vehicle.inertial
    if acceleration is not None:
        latest[sensor, 0] = acceleration
    if rate is not None:
        latest[sensor, 1] = rate
    if magnetic is not None:
        latest[sensor, 2] = magnetic
    return ImuSample(vehicle.name, valid_at, received_at, sensor, acceleration, rate, magnetic)


def readings(vehicle: Vehicle) -> dict[str, float]:
    """What people are shown of how a vehicle lies and is accelerated; made when it is asked for, not with each frame."""
    shown = {}
    if vehicle.attitude_rad is not None:
        roll, pitch, yaw = map(math.degrees, vehicle.attitude_rad)
        shown = {"roll, degrees": roll, "pitch, degrees": pitch, "heading, degrees": yaw % 360.0}
    for (sensor, which), vector in sorted(vehicle.inertial.items()):
        shown[_NAMES[min(sensor, len(_NAMES)) - 1][which]] = math.hypot(*vector)
    return shown
