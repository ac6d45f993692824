"""Which of a vehicle's positions are positions at all, how good its fix is, and which of its messages to believe.

The autopilot's estimates (GLOBAL_POSITION_INT and its like) carry no accuracy, are near (0, 0) before the estimator has an
origin (their altitude stays near 0 until home is set), and go on by dead reckoning when GPS is lost without saying so.
GPS_RAW_INT tells the rest: fix type, accuracies, and the height above the ellipsoid; while GPS is lost its positions may
go on moving with a frozen time.

A vehicle that tells its position by several kinds of message is heard by the best of them, so that nothing counts twice:
the kinds of `KINDS`, best first. A lower one is used when no better one has come for 12 s.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

KINDS = (
    "GLOBAL_POSITION_INT_COV",
    "GLOBAL_POSITION_INT",
    "UTM_GLOBAL_POSITION",
    "OPEN_DRONE_ID_LOCATION",
    "HIGH_LATENCY2",
    "GPS_RAW_INT",
)
COVARIANCE, ESTIMATE, UTM, DRONE_ID, HIGH_LATENCY, RECEIVER = range(len(KINDS))

SECOND = 10**9
_SLOWEST_POSITION_NS = 12 * SECOND  # a vehicle that sends no position for this long sends none
_FROZEN_NS = 2 * SECOND
_STALE_NS = 5 * SECOND
_NEAR_ZERO = 10**7  # 1 degree about (0, 0)
_LARGEST_SEPARATION_MM = 150_000
_NO_ORIGIN_MM = 100_000  # estimate and receiver further apart in altitude: the estimator has no origin yet
_NO_HOME_MM = 15_000  # and also when nearer, where the altitude above home is the altitude itself
_REMEMBERED = 64
_STILL_COMES = (
    "",
    "repeated",
    "no fix",
)  # refused so, a kind is still the one to wait for; so is an estimate in any case

Sigmas = tuple[float | None, float | None, float | None]


@dataclass(frozen=True, slots=True)
class Fix:
    """What one GPS_RAW_INT says. Places in degE7, altitudes and accuracies in mm, mm/s; 0 = not given."""

    usec: int
    fix_type: int
    place: tuple[int, int]
    altitude_mm: int
    ellipsoid_mm: int
    accuracies_mm: tuple[int, int, int]  # horizontal, vertical, velocity


@dataclass(slots=True)
class Fixes:
    """One vehicle's positions. `at` is the vehicle's time since boot, `now` the session's time of receipt, both ns."""

    counters: Counter[str]
    reason: str = ""  # why the last position was refused
    last_report: int | None = None  # session time
    _fix: Fix | None = None
    _moved: int = 0  # `at`, when the fix's own time last changed
    _heard: int = 0
    _usec: int = 0
    _ellipsoid_given: bool = False
    _has_origin: bool = False
    _best: int = len(KINDS)  # the best kind of position that has lately come
    _best_came: int = 0  # `now`, when it last did
    _newest: list[tuple[int, ...]] = field(default_factory=lambda: [()] * len(KINDS))
    _recent: list[deque[tuple[int, ...]]] = field(
        default_factory=lambda: [deque(maxlen=_REMEMBERED) for _ in KINDS],
    )

    def hear_fix(self, fix: Fix, at: int) -> bool:
        """Take a GPS_RAW_INT in; whether it holds a fix that was not heard before."""
        fresh = fix.usec != self._usec
        if fresh or fix.usec == 0 or at < self._moved:
            self._usec, self._moved = fix.usec, at
        self._fix, self._heard = fix, at
        separation = fix.ellipsoid_mm - fix.altitude_mm
        if fix.fix_type >= 3 and fix.ellipsoid_mm != 0 and 0 < abs(separation) <= _LARGEST_SEPARATION_MM:
            self._ellipsoid_given = True
        return fresh and fix.fix_type >= 3

    def has_fix(self) -> bool:
        """Whether the last GPS_RAW_INT told of a fix that is alive; true as long as there is none to ask."""
        if self._fix is None:
            return True
        return self._fix.fix_type >= 3 and self._heard - self._moved <= _FROZEN_NS

    def yields(self, kind: int, now: int) -> bool:
        """Whether a better kind of position has lately come."""
        return kind > self._best and abs(now - self._best_came) < _SLOWEST_POSITION_NS

    def refuses(
        self,
        kind: int,
        key: tuple[int, ...],
        place: tuple[int, int],
        now: int,
        *,
        needs_fix: bool = True,
        altitudes_mm: tuple[int, int] | None = None,
    ) -> bool:
        """Whether this is no position to report: the reason is counted.

        `key` is the same for a position that is told again; `place` in degE7; `altitudes_mm`, where an estimator tells
        both: above mean sea level and above home.
        """
        if self.yields(kind, now):
            self.counters["better position kind is used"] += 1
            return True
        reason = self._refusal(kind, key, place, needs_fix, altitudes_mm)
        if kind == ESTIMATE or reason in _STILL_COMES:
            self._best, self._best_came = kind, now
        if not reason:
            self.last_report, self.reason = now, ""
            return False
        if reason != "repeated":
            self.reason = reason
        self.counters[reason] += 1
        return True

    def height_m(self, altitude_mm: int) -> float | None:
        """Above the ellipsoid, where the receiver gives a height of its own and does not merely repeat the altitude."""
        if not self._ellipsoid_given or self._fix is None:
            return None
        return (altitude_mm + self._fix.ellipsoid_mm - self._fix.altitude_mm) / 1000

    def sigmas(self, at: int) -> Sigmas:
        """Horizontal and vertical (m) and of the velocity (m/s), as the receiver gives them; None = it does not."""
        if self._fix is None or at - self._heard > _STALE_NS:
            return None, None, None
        horizontal, vertical, velocity = self._fix.accuracies_mm
        return horizontal / 1000 or None, vertical / 1000 or None, velocity / 1000 or None

    def reboot(self) -> None:
        """The vehicle has started anew: its estimator has no origin, its times repeat."""
        self._has_origin, self._fix = False, None
        self._best = len(KINDS)
        self._newest = [()] * len(KINDS)
        for recent in self._recent:
            recent.clear()

    def _refusal(
        self,
        kind: int,
        key: tuple[int, ...],
        place: tuple[int, int],
        needs_fix: bool,
        altitudes_mm: tuple[int, int] | None,
    ) -> str:
        """Why this is no position; empty when it is one."""
        latitude, longitude = place
        if key == self._newest[kind] or (key < self._newest[kind] and key in self._recent[kind]):
            return "repeated"
        self._newest[kind] = key
        self._recent[kind].append(key)
        if not is_place(latitude, longitude):
            return "position out of range"
        if needs_fix and not self.has_fix():
            return "no fix"
        if abs(latitude) < _NEAR_ZERO and abs(longitude) < _NEAR_ZERO:
            fix = self._fix
            there = fix is not None and fix.fix_type >= 3 and max(abs(one) for one in fix.place) < _NEAR_ZERO
            if not there or latitude == longitude == 0:
                return "no position yet"
        return "" if altitudes_mm is None or self._knows_altitude(*altitudes_mm) else "no altitude yet"

    def _knows_altitude(self, altitude_mm: int, above_home_mm: int) -> bool:
        """Whether the estimator has an origin: its altitude has once agreed with the receiver's."""
        if not self._has_origin and self._fix is not None:
            limit = _NO_HOME_MM if abs(altitude_mm - above_home_mm) < 100 else _NO_ORIGIN_MM
            self._has_origin = abs(altitude_mm - self._fix.altitude_mm) <= limit
        return self._has_origin or self._fix is None


def is_place(latitude: int, longitude: int) -> bool:
    """Whether this is a place on the globe, in degE7."""
    return abs(latitude) <= 900_000_000 and abs(longitude) <= 1_800_000_000
