"""OPEN_DRONE_ID_LOCATION (12901): remote identification, of the sending system itself or of a drone it has heard.

    id_or_mac             20 bytes, all zero = the sender itself ("mavlink:N"); else another's: "odid:" and its bytes in
                          hexadecimal, without the zeros behind them
    latitude, longitude   degE7, both 0 = unknown
    altitude_geodetic     m above the ellipsoid; altitude_barometric m above the 1013.25 hPa surface; -1000 = unknown
    direction             cdeg over ground, 36100 = unknown
    speed_horizontal      cm/s, 25500 = unknown, 25425 = that or faster
    speed_vertical        cm/s UP, 6300 = unknown, +-6200 = that or faster
    ..._accuracy          classes: the error is smaller than a limit, in 95 of 100 cases; 0 = unknown
    timestamp             s after the full hour UTC, 65535 = unknown
    status                1 on ground, 2 in the air, 3 emergency, 4 the system fails

A class's limit is believed: a sigma is the limit over 2.45 horizontally (the radius that 95 % of a plane's errors are within),
over 1.96 along one axis and for speeds and times. `height` (above what differs) is not used.
"""

from __future__ import annotations

import math
from collections import Counter

from adapters.condition import say_emergency, set_landed
from adapters.fixes import DRONE_ID, is_place
from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations, When
from adapters.positions import DEGE7, show
from adapters.traffic import Traffic
from adapters.vehicle import Vehicle
from gateway.observation import GpsReport

_PLACE = ("latitude", "longitude", "altitude_barometric", "altitude_geodetic", "timestamp", "status")
_MOTION = ("direction", "speed_horizontal", "speed_vertical")
_ACCURACY = ("horizontal_accuracy", "vertical_accuracy", "speed_accuracy", "timestamp_accuracy")
OPEN_DRONE_ID_LOCATION, _read_place = fields("OPEN_DRONE_ID_LOCATION", *_PLACE)
_, _read_motion = fields("OPEN_DRONE_ID_LOCATION", *_MOTION)
_, _read_accuracy = fields("OPEN_DRONE_ID_LOCATION", *_ACCURACY)
_, _read_identity = fields("OPEN_DRONE_ID_LOCATION", *(f"id_or_mac[{index}]" for index in range(20)))

_MILE_M = 1852.0
_HORIZONTAL_M = (
    None, *(miles * _MILE_M for miles in (10, 4, 2, 1, 0.5, 0.3, 0.1, 0.05)), 30.0, 10.0, 3.0, 1.0,
)  # fmt: skip
_VERTICAL_M = (None, 150.0, 45.0, 25.0, 10.0, 3.0, 1.0)
_SPEED_MPS = (None, 10.0, 3.0, 1.0, 0.3)
_TIME_S = (None, *(tenths / 10 for tenths in range(1, 16)))
_IN_PLANE = math.sqrt(-2 * math.log(0.05))  # 2.448
_ON_AXIS = 1.96
_UNKNOWN_ALTITUDE_M, _HIGHEST_M = -1000.0, 31_767.0
_NO_DIRECTION, _FASTEST, _NO_SPEED, _STEEPEST, _NO_CLIMB = 36_000, 25_425, 25_500, 6200, 6300
_HOUR_S = 3600.0
_LANDED = {1: "on ground", 2: "in air"}
_EMERGENCIES = {3: "emergency", 4: "remote identification fails"}
_MOVING_CMS = 100


def identity(payload: bytes) -> str:
    """Whose location this is: "odid:..." of another; empty for the sender's own."""
    marks = bytes(_read_identity(payload)).rstrip(b"\0")
    return f"odid:{marks.hex()}" if marks else ""


def own_location(
    moments: Moments, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """The sender's own."""
    latitude, longitude, _, _, seconds, status = _read_place(payload)
    set_landed(vehicle, _LANDED.get(status))
    say_emergency(moments, vehicle, _EMERGENCIES.get(status, ""))
    key = (_milliseconds(seconds), latitude, longitude)
    if vehicle.fixes.refuses(DRONE_ID, key, (latitude, longitude), moments.epoch.session_time(received_at)):
        return ()
    report = _report(moments, vehicle.name, payload, received_at, counters)
    show(vehicle, DRONE_ID, report.horizontal_sigma_m)
    return (report,)


def heard_location(
    moments: Moments, traffic: Traffic, name: str, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """Another drone's, heard by the sender."""
    latitude, longitude, _, _, seconds, _ = _read_place(payload)
    if not is_place(latitude, longitude):
        counters["position out of range"] += 1
        return ()
    if latitude == longitude == 0:
        counters["no position yet"] += 1
        return ()
    report = _report(moments, name, payload, received_at, counters)
    _, speed, _ = _read_motion(payload)
    content = (_milliseconds(seconds), latitude, longitude)
    moving = _has_time(seconds) or _MOVING_CMS <= speed < _NO_SPEED
    if traffic.of(name).is_repeat(content, report.valid_at, moving=moving):
        counters["repeated"] += 1
        return ()
    return (report,)


def _report(moments: Moments, name: str, payload: bytes, received_at: int, counters: Counter[str]) -> GpsReport:
    latitude, longitude, barometric, geodetic, seconds, _ = _read_place(payload)
    horizontal, vertical, speed, time = _read_accuracy(payload)
    valid_at, timing = _when(moments, name, seconds, received_at)
    east, north, up = _velocity(payload, counters)
    return GpsReport(
        name,
        valid_at,
        received_at,
        latitude * DEGE7,
        longitude * DEGE7,
        height_m=_altitude(geodetic, counters),
        velocity_east_mps=east,
        velocity_north_mps=north,
        velocity_up_mps=up,
        horizontal_sigma_m=_sigma(_HORIZONTAL_M, horizontal, _IN_PLANE, counters),
        vertical_sigma_m=_sigma(_VERTICAL_M, vertical, _ON_AXIS, counters),
        velocity_sigma_mps=_sigma(_SPEED_MPS, speed, _ON_AXIS, counters),
        timing=timing,
        pressure_altitude_m=_altitude(barometric, counters),
        timing_sigma_s=_sigma(_TIME_S, time, _ON_AXIS, counters) or 0.0,
    )


def _when(moments: Moments, name: str, seconds: float, received_at: int) -> When:
    if not _has_time(seconds):
        return moments.of_traffic(received_at)
    return moments.of_hour(seconds, name, received_at)


def _has_time(seconds: float) -> bool:
    return 0.0 <= seconds <= _HOUR_S  # false for NaN, too


def _milliseconds(seconds: float) -> int:
    return round(seconds * 1000) if _has_time(seconds) else -1


def _altitude(metres: float, counters: Counter[str]) -> float | None:
    if metres == _UNKNOWN_ALTITUDE_M:
        return None
    if _UNKNOWN_ALTITUDE_M < metres <= _HIGHEST_M:
        return metres
    counters["not a number" if math.isnan(metres) else "altitude out of range"] += 1
    return None


def _velocity(payload: bytes, counters: Counter[str]) -> tuple[float | None, float | None, float | None]:
    """East, north, up, m/s."""
    direction, speed, climb = _read_motion(payload)
    if speed == _FASTEST or abs(climb) == _STEEPEST or speed > _NO_SPEED or abs(climb) > _NO_CLIMB:
        counters["velocity out of range"] += 1
    up = climb / 100 if abs(climb) < _STEEPEST else None
    if speed >= _FASTEST or (direction >= _NO_DIRECTION and speed > 0):
        return None, None, up
    angle = math.radians(direction / 100)
    return speed / 100 * math.sin(angle), speed / 100 * math.cos(angle), up


def _sigma(limits: tuple[float | None, ...], accuracy: int, factor: float, counters: Counter[str]) -> float | None:
    """Of an accuracy class; None where it is unknown."""
    if accuracy >= len(limits):
        counters["accuracy class unknown"] += 1
        return None
    limit = limits[accuracy]
    return None if limit is None else limit / factor
