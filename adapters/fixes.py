"""GLOBAL_POSITION_INT and GPS_RAW_INT, paired: is there a fix, how good is it, and is this a position at all?

GLOBAL_POSITION_INT is the autopilot's estimate: it carries no accuracy, is near (0, 0) before the estimator has an origin
(its altitude stays near 0 until home is set), and goes on by dead reckoning when GPS is lost without saying so.
GPS_RAW_INT tells the rest: fix type, accuracies, and the height above the ellipsoid; while GPS is lost its positions may
go on moving with a frozen time.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field

from adapters.mavlink_frames import fields
from gateway.observation import GpsReport, Timing

GLOBAL_POSITION_INT, read_position = fields(
    "GLOBAL_POSITION_INT", "time_boot_ms", "lat", "lon", "alt", "relative_alt", "vx", "vy", "vz", "hdg"
)
GPS_RAW_INT, read_fix = fields(
    "GPS_RAW_INT",
    "time_usec",
    "lat",
    "lon",
    "alt",
    "fix_type",
    "alt_ellipsoid",
    "h_acc",
    "v_acc",
    "vel_acc",
    "vel",
    "cog",
)
SECOND = 10**9
_LEAST_UNIX_USEC = 10**15
_FROZEN_NS = 2 * SECOND
_STALE_NS = 5 * SECOND
_NEAR_ZERO = 10**7  # 1 degree about (0, 0)
_LARGEST_SEPARATION_MM = 150_000
_LOWEST_MM, _HIGHEST_MM = -10_000_000, 100_000_000
_NO_ORIGIN_MM = 100_000  # estimate and receiver further apart in altitude: the estimator has no origin yet
_NO_HOME_MM = 15_000  # and also when nearer, where the altitude above home is the altitude itself
_DEGE7 = math.pi / 180.0 / 1e7


@dataclass(slots=True)
class Fixes:
    """One vehicle's GPS. `at` is the vehicle's time since boot, ns."""

    counters: Counter[str]
    reason: str = ""  # why the last position was refused
    last_report: int | None = None
    last_position: int | None = None
    _fix_type: int | None = None
    _place: tuple[int, int] = (0, 0)
    _altitude_mm: int = 0
    _has_origin: bool = False
    _usec: int = 0
    _heard: int = 0
    _moved: int = 0
    _accuracies_mm: tuple[int, int, int] = (0, 0, 0)
    _separation_mm: int = 0
    _ellipsoid_given: bool = False
    _last_boot_ms: int = -1
    _recent: deque[int] = field(default_factory=lambda: deque(maxlen=64))

    def hear_fix(self, payload: bytes, at: int) -> bool:
        """Take a GPS_RAW_INT in; whether it holds a fix that was not heard before."""
        usec, latitude, longitude, altitude, fix_type, ellipsoid, *accuracies, _, _ = read_fix(payload)
        fresh: bool = usec != self._usec
        if fresh or usec == 0 or at < self._moved:
            self._usec, self._moved = usec, at
        self._fix_type, self._place, self._heard = fix_type, (latitude, longitude), at
        self._altitude_mm = altitude
        self._accuracies_mm = (accuracies[0], accuracies[1], accuracies[2])
        separation = ellipsoid - altitude
        if fix_type >= 3 and ellipsoid != 0 and separation != 0 and abs(separation) <= _LARGEST_SEPARATION_MM:
            self._ellipsoid_given = True
        self._separation_mm = separation
        return fresh and bool(fix_type >= 3)

    def has_fix(self) -> bool:
        """Whether the last GPS_RAW_INT told of a fix that is alive; true as long as there is none to ask."""
        if self._fix_type is None:
            return True
        return self._fix_type >= 3 and self._heard - self._moved <= _FROZEN_NS

    def report(
        self, payload: bytes, aircraft: str, when: tuple[int, Timing], received_at: int, at: int
    ) -> GpsReport | None:
        """A GLOBAL_POSITION_INT as a report, or None (and a reason counted) where it is none."""
        boot_ms, latitude, longitude, altitude, above_home, north, east, down, heading = read_position(payload)
        self.last_position = at
        reason = self._refusal(boot_ms, (latitude, longitude), (altitude, above_home))
        if reason:
            if reason != "repeated":
                self.reason = reason
            self.counters[reason] += 1
            return None
        self.last_report, self.reason = at, ""
        given = _LOWEST_MM < altitude < _HIGHEST_MM
        if not given:
            self.counters["altitude out of range"] += 1
        moving = max(abs(north), abs(east), abs(down)) < 32767
        if not moving:
            self.counters["velocity out of range"] += 1
        horizontal, vertical, velocity = self._sigmas(at)
        return GpsReport(
            aircraft,
            when[0],
            received_at,
            latitude * _DEGE7,
            longitude * _DEGE7,
            altitude / 1000 if given else None,
            self._height(altitude) if given else None,
            east / 100 if moving else None,
            north / 100 if moving else None,
            -down / 100 if moving else None,
            horizontal,
            vertical,
            velocity,
            math.radians(heading / 100) if heading <= 36000 else None,
            when[1],
        )

    def raw_report(
        self, payload: bytes, aircraft: str, when: tuple[int, Timing], received_at: int, at: int
    ) -> GpsReport | None:
        """A GPS_RAW_INT as a report, for vehicles that send no GLOBAL_POSITION_INT; its altitude is the receiver's."""
        _, latitude, longitude, altitude, _, _, _, _, _, speed, course = read_fix(payload)
        if not self.has_fix() or not _is_place(latitude, longitude) or latitude == longitude == 0:
            self.counters["no fix"] += 1
            return None
        self.last_report, self.reason = at, ""
        moving = speed != 65535 and course <= 36000
        angle = math.radians(course / 100)
        horizontal, vertical, velocity = self._sigmas(at)
        return GpsReport(
            aircraft,
            when[0],
            received_at,
            latitude * _DEGE7,
            longitude * _DEGE7,
            altitude / 1000,
            self._height(altitude),
            speed / 100 * math.sin(angle) if moving else None,
            speed / 100 * math.cos(angle) if moving else None,
            None,
            horizontal,
            vertical,
            velocity,
            timing=when[1],
        )

    def reboot(self) -> None:
        """The vehicle has started anew: its estimator has no origin, its times repeat."""
        self._has_origin, self._last_boot_ms = False, -1
        self.last_position = self._fix_type = None
        self._recent.clear()

    def _refusal(self, boot_ms: int, place: tuple[int, int], altitudes_mm: tuple[int, int]) -> str:
        """Why this is no position; empty when it is one."""
        (latitude, longitude), (altitude, above_home) = place, altitudes_mm
        if boot_ms == self._last_boot_ms or (boot_ms < self._last_boot_ms and boot_ms in self._recent):
            return "repeated"
        self._last_boot_ms = boot_ms
        self._recent.append(boot_ms)
        if not _is_place(latitude, longitude):
            return "position out of range"
        if not self.has_fix():
            return "no fix"
        if abs(latitude) < _NEAR_ZERO and abs(longitude) < _NEAR_ZERO:
            there = (self._fix_type or 0) >= 3 and max(abs(self._place[0]), abs(self._place[1])) < _NEAR_ZERO
            if not there or latitude == longitude == 0:
                return "no position yet"
        if not self._has_origin and self._fix_type is not None:
            apart = abs(altitude - self._altitude_mm)
            limit = _NO_HOME_MM if abs(altitude - above_home) < 100 else _NO_ORIGIN_MM
            self._has_origin = apart <= limit
        return "" if self._has_origin or self._fix_type is None else "no altitude yet"

    def _height(self, altitude_mm: int) -> float | None:
        """Above the ellipsoid, where the receiver gives a height of its own and does not merely repeat the altitude."""
        return (altitude_mm + self._separation_mm) / 1000 if self._ellipsoid_given else None

    def _sigmas(self, at: int) -> tuple[float | None, float | None, float | None]:
        if self._fix_type is None or at - self._heard > _STALE_NS:
            return None, None, None
        horizontal, vertical, velocity = self._accuracies_mm
        return horizontal / 1000 or None, vertical / 1000 or None, velocity / 1000 or None


def fix_time(payload: bytes) -> int:
    """Time since boot (ns) that a GPS_RAW_INT tells by itself; 0 where it tells UTC (by magnitude)."""
    usec: int = read_fix(payload)[0]
    return usec * 1000 if usec < _LEAST_UNIX_USEC else 0


def _is_place(latitude: int, longitude: int) -> bool:
    return abs(latitude) <= 900_000_000 and abs(longitude) <= 1_800_000_000
