"""Flight plans overheard: mission items that a vehicle tells or is told, and its home, become one plan.

Mission altitudes above home stay so; terrain altitudes are left out. Points without a position are no points of a plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from gateway.observation import PlanPoint

_KINDS = {16: "waypoint", 82: "waypoint", 22: "take-off", 84: "take-off", 24: "take-off", 21: "landing", 85: "landing"}
_KINDS |= dict.fromkeys((17, 18, 19, 31), "loiter")
_MSL_FRAMES, _HOME_FRAMES, _TERRAIN_FRAMES = (0, 5), (3, 6), (10, 11)


@dataclass(slots=True)
class PlanBook:
    """What is known of one vehicle's plan so far."""

    _home: PlanPoint | None = None
    _points: dict[int, PlanPoint] = field(default_factory=dict)
    _heard: set[int] = field(default_factory=set)
    _expected: int | None = None

    def begin(self, count: int) -> None:
        """A transfer of so many items begins (MISSION_COUNT)."""
        self._expected = count
        self._heard.clear()

    def hear_home(self, latitude_deg: float, longitude_deg: float, altitude_msl_m: float) -> bool:
        """The vehicle's home; whether the plan has changed."""
        home = PlanPoint(
            0, "home", math.radians(latitude_deg), math.radians(longitude_deg), altitude_msl_m=altitude_msl_m
        )
        if not _is_place(latitude_deg, longitude_deg) or home == self._home:
            return False
        self._home = home
        return True

    def hear_item(
        self, sequence: int, command: int, frame: int, place_deg: tuple[float, float], altitude_m: float
    ) -> bool:
        """One mission item; whether the plan has changed and is whole (as far as its length is known)."""
        point = None if sequence == 0 else _point(sequence, command, frame, place_deg, altitude_m)  # 0 is home's copy
        known = self._points.get(sequence)
        first = sequence not in self._heard
        if point is None:
            self._points.pop(sequence, None)
        else:
            self._points[sequence] = point
        self._heard.add(sequence)
        if self._expected is None:
            return point is not None and point != known
        whole = len(self._heard) >= self._expected
        if whole and first:
            for surplus in [number for number in self._points if number >= self._expected]:
                del self._points[surplus]
        return whole and (first or point != known)

    def points(self) -> tuple[PlanPoint, ...]:
        """The plan, home first, in the order of the sequence numbers."""
        home = () if self._home is None else (self._home,)
        return (*home, *(self._points[number] for number in sorted(self._points)))


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    inside = abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0  # false for NaN too
    return inside and (latitude_deg != 0.0 or longitude_deg != 0.0)


def _point(
    sequence: int, command: int, frame: int, place_deg: tuple[float, float], altitude_m: float
) -> PlanPoint | None:
    if frame not in (*_MSL_FRAMES, *_HOME_FRAMES, *_TERRAIN_FRAMES) or not _is_place(*place_deg):
        return None
    latitude_rad, longitude_rad = math.radians(place_deg[0]), math.radians(place_deg[1])
    given = math.isfinite(altitude_m)
    return PlanPoint(
        sequence,
        _KINDS.get(command, "other"),
        latitude_rad,
        longitude_rad,
        altitude_msl_m=altitude_m if given and frame in _MSL_FRAMES else None,
        altitude_above_home_m=altitude_m if given and frame in _HOME_FRAMES else None,
    )
