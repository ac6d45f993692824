"""What autopilots say of where they are, as GpsReports.

    GLOBAL_POSITION_INT (33)      lat, lon degE7; alt mm above mean sea level; vx, vy, vz cm/s north, east, DOWN;
                                  hdg cdeg = yaw, not course, 65535 = unknown; accuracy from GPS_RAW_INT
    GLOBAL_POSITION_INT_COV (63)  the same with vx, vy, vz in m/s and covariance[36]: m2 and m2/s2 of north, east, up and
                                  the velocities, row-major; NaN first = unknown. It does not say which way vz points: down,
                                  as in 33. A naive estimator's covariance means nothing
    GPS_RAW_INT (24)              alt mm above mean sea level, alt_ellipsoid mm; h_acc, v_acc mm, vel_acc mm/s, 0 = not
                                  given; vel cm/s, 65535 = unknown; cog cdeg. eph and epv are dilutions, not metres

A value out of its range is left out and counted, where the rest is good.
"""

from __future__ import annotations

import math
from collections import Counter

from adapters.fixes import COVARIANCE, ESTIMATE, KINDS, RECEIVER, Fix, Fixes
from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import GpsReport

_PLACE = ("lat", "lon", "alt", "relative_alt", "vx", "vy", "vz")
GLOBAL_POSITION_INT, _read_estimate = fields("GLOBAL_POSITION_INT", "time_boot_ms", *_PLACE, "hdg")
_DIAGONAL = tuple(f"covariance[{place}]" for place in (0, 7, 14, 21, 28, 35))
GLOBAL_POSITION_INT_COV, _read_covariance = fields(
    "GLOBAL_POSITION_INT_COV", "time_usec", "estimator_type", *_PLACE, *_DIAGONAL
)
_FIX = ("time_usec", "fix_type", "lat", "lon", "alt", "alt_ellipsoid", "h_acc", "v_acc", "vel_acc", "vel", "cog")
GPS_RAW_INT, _read_fix = fields("GPS_RAW_INT", *_FIX)

DEGE7 = math.pi / 180.0 / 1e7
_LOWEST_MM, _HIGHEST_MM = -10_000_000, 100_000_000
_FASTEST_MPS = 1000.0
_GREATEST_VARIANCE = 1e12
_NAIVE = 1
_WITHOUT_GPS = frozenset((2, 3, 6, 7))  # vision, vision with inertial unit, motion capture, lidar
_ESTIMATORS = ("unknown", "naive", "vision", "vision and inertial unit", "GPS", "GPS and inertial unit",
               "motion capture", "lidar", "autopilot")  # fmt: skip
_FIX_NOTES = 6  # a fix that comes and goes is told so often and no more
_FIX_WORDS = ("no GPS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK fixed", "static", "PPP")


def estimate(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """GLOBAL_POSITION_INT."""
    boot_ms, latitude, longitude, altitude, above_home, north, east, down, heading = _read_estimate(payload)
    boot_ns = moments.boot(component, vehicle, boot_ms, received_at, counters)
    if boot_ns is None:
        return ()
    fixes, now = vehicle.fixes, moments.epoch.session_time(received_at)
    if fixes.refuses(ESTIMATE, (boot_ms,), (latitude, longitude), now, altitudes_mm=(altitude, above_home)):
        return ()
    valid_at, timing = moments.when(component, boot_ns, received_at)
    moving = max(abs(north), abs(east), abs(down)) < 32767
    if not moving:
        counters["velocity out of range"] += 1
    horizontal, vertical, velocity = fixes.sigmas(boot_ns)
    show(vehicle, ESTIMATE, horizontal)
    return (
        GpsReport(
            vehicle.name,
            valid_at,
            received_at,
            *_place(fixes, latitude, longitude, altitude, counters),
            east / 100 if moving else None,
            north / 100 if moving else None,
            -down / 100 if moving else None,
            horizontal,
            vertical,
            velocity,
            math.radians(heading / 100) if heading <= 36000 else None,
            timing,
        ),
    )


def estimate_with_covariance(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """GLOBAL_POSITION_INT_COV."""
    usec, estimator, latitude, longitude, altitude, above_home, *rest = _read_covariance(payload)
    when = moments.told(component, vehicle, usec, received_at, counters)
    if when is None:
        return ()
    fixes, now = vehicle.fixes, moments.epoch.session_time(received_at)
    by_gps = estimator not in _WITHOUT_GPS
    both = (altitude, above_home) if by_gps else None
    if fixes.refuses(COVARIANCE, (usec,), (latitude, longitude), now, needs_fix=by_gps, altitudes_mm=both):
        return ()
    moving = all(math.isfinite(one) and abs(one) < _FASTEST_MPS for one in rest[:3])
    if not moving:
        counters["velocity out of range"] += 1
    north, east, down = rest[:3]
    told = (None, None, None) if estimator == _NAIVE else _sigmas(rest[3:], counters)
    receiver = fixes.sigmas(moments.now(component, received_at)) if by_gps else (None, None, None)
    horizontal, vertical, velocity = (own or other for own, other in zip(told, receiver, strict=True))
    show(vehicle, COVARIANCE, horizontal)
    vehicle.words["estimator"] = _ESTIMATORS[estimator] if estimator < len(_ESTIMATORS) else str(estimator)
    return (
        GpsReport(
            vehicle.name,
            when[0],
            received_at,
            *_place(fixes, latitude, longitude, altitude, counters),
            east if moving else None,
            north if moving else None,
            -down if moving else None,
            horizontal,
            vertical,
            velocity,
            timing=when[1],
        ),
    )


def receiver_fix(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """GPS_RAW_INT: tells of the fix; a report where no better position comes."""
    usec, fix_type, latitude, longitude, altitude, ellipsoid, h_acc, v_acc, vel_acc, speed, course = _read_fix(payload)
    clock, fixes, at = component.clock, vehicle.fixes, moments.now(component, received_at)
    fix = Fix(usec, fix_type, (latitude, longitude), altitude, ellipsoid, (h_acc, v_acc, vel_acc))
    fresh = fixes.hear_fix(fix, at)
    vehicle.words["GPS fix"] = _FIX_WORDS[fix_type] if fix_type < len(_FIX_WORDS) else str(fix_type)
    _say_fix(moments, vehicle)
    if not fresh or not clock.has_been_heard() or not clock.is_settled(received_at):
        return ()
    now = moments.epoch.session_time(received_at)
    if fixes.yields(RECEIVER, now) or fixes.refuses(RECEIVER, (usec,), (latitude, longitude), now):
        return ()
    told = moments.since_boot(component, usec, received_at)
    valid_at, timing = moments.when(component, at if told is None or told > at else told, received_at)
    moving = speed != 65535 and course <= 36000
    angle = math.radians(course / 100)
    horizontal, vertical, velocity = fixes.sigmas(at)
    show(vehicle, RECEIVER, horizontal)
    return (
        GpsReport(
            vehicle.name,
            valid_at,
            received_at,
            *_place(fixes, latitude, longitude, altitude, counters),
            speed / 100 * math.sin(angle) if moving else None,
            speed / 100 * math.cos(angle) if moving else None,
            None,
            horizontal,
            vertical,
            velocity,
            timing=timing,
        ),
    )


def _place(
    fixes: Fixes, latitude: int, longitude: int, altitude_mm: int, counters: Counter[str]
) -> tuple[float, float, float | None, float | None]:
    """Latitude and longitude (rad), altitude above mean sea level and height above the ellipsoid (m), as reports hold them."""
    given = is_altitude(altitude_mm, counters)
    altitude_m, height_m = (altitude_mm / 1000, fixes.height_m(altitude_mm)) if given else (None, None)
    return latitude * DEGE7, longitude * DEGE7, altitude_m, height_m


def is_altitude(altitude_mm: int, counters: Counter[str]) -> bool:
    """Whether this is an altitude that something flies at; counted where it is not."""
    if _LOWEST_MM < altitude_mm < _HIGHEST_MM:
        return True
    counters["altitude out of range"] += 1
    return False


def show(vehicle: Vehicle, kind: int, horizontal_sigma_m: float | None) -> None:
    """Keep for people which message the vehicle's position comes from, and how good it is."""
    vehicle.words["position"] = KINDS[kind]
    if horizontal_sigma_m is None:
        vehicle.readings.pop("horizontal sigma, m", None)
    else:
        vehicle.readings["horizontal sigma, m"] = horizontal_sigma_m


def _sigmas(variances: list[float], counters: Counter[str]) -> tuple[float | None, float | None, float | None]:
    """Of the diagonal of a covariance: each the root of a mean variance, None where it is not given."""
    if math.isnan(variances[0]):
        return None, None, None
    return _sigma(variances[:2], counters), _sigma(variances[2:3], counters), _sigma(variances[3:], counters)


def _sigma(variances: list[float], counters: Counter[str]) -> float | None:
    if any(math.isnan(one) for one in variances) or not any(variances):
        return None
    if not all(0.0 < one < _GREATEST_VARIANCE for one in variances):
        counters["covariance out of range"] += 1
        return None
    return math.sqrt(sum(variances) / len(variances))


def _say_fix(moments: Moments, vehicle: Vehicle) -> None:
    has_fix = vehicle.fixes.has_fix()
    if has_fix == vehicle.had_fix:
        return
    vehicle.had_fix = has_fix
    vehicle.fix_notes += 1
    if vehicle.fix_notes > _FIX_NOTES:
        return
    if has_fix:
        moments.notes.append(("info", f"{vehicle.name} has a GPS fix."))
    else:
        text = f"{vehicle.name} has lost its GPS fix: what it says of its position is not used."
        moments.notes.append(("warning", text))
