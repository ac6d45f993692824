"""Flight plans overheard: mission items that a vehicle tells or is told, and its home, become one plan.

Mission altitudes above home stay so; terrain altitudes are left out. Points without a position are no points of a plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from adapters.mavlink_frames import fields
from gateway.observation import PlanPoint

_ITEM = ("seq", "command", "frame", "x", "y", "z", "target_system", "mission_type")
MISSION_COUNT, _read_count = fields("MISSION_COUNT", "count", "target_system", "mission_type")
MISSION_ITEM, _read_item = fields("MISSION_ITEM", *_ITEM)
MISSION_ITEM_INT, _read_item_int = fields("MISSION_ITEM_INT", *_ITEM)
MISSION_MESSAGES = frozenset((MISSION_COUNT, MISSION_ITEM, MISSION_ITEM_INT))

_KINDS = {16: "waypoint", 82: "waypoint", 22: "take-off", 84: "take-off", 24: "take-off", 21: "landing", 85: "landing"}
_KINDS |= dict.fromkeys((17, 18, 19, 31), "loiter")
_MSL_FRAMES, _HOME_FRAMES, _TERRAIN_FRAMES = (0, 5), (3, 6), (10, 11)


@dataclass(frozen=True, slots=True)
class Overheard:
    """One message of a mission transfer: how many items are to come, or one of them."""

    target_system: int
    is_flight_plan: bool  # and no fence or rally points
    count: int | None = None
    sequence: int = 0
    command: int = 0
    frame: int = 0
    place_deg: tuple[float, float] = (0.0, 0.0)
    altitude_m: float = math.nan


def overheard(message: int, payload: bytes) -> Overheard:
    """What one of `MISSION_MESSAGES` says."""
    if message == MISSION_COUNT:
        count, target, mission = _read_count(payload)
        return Overheard(target, mission == 0, count)
    read = _read_item_int if message == MISSION_ITEM_INT else _read_item
    sequence, command, frame, x, y, altitude_m, target, mission = read(payload)
    place_deg = (x / 1e7, y / 1e7) if message == MISSION_ITEM_INT else (x, y)
    return Overheard(target, mission == 0, None, sequence, command, frame, place_deg, altitude_m)


@dataclass(slots=True)
class PlanBook:
    """What is known of one vehicle's plan so far."""

    _home: PlanPoint | None = None
    _points: dict[int, PlanPoint] = field(default_factory=dict)
    _heard: set[int] = field(default_factory=set)
    _expected: int | None = None

    def hear(self, told: Overheard) -> bool:
        """One message of a transfer; whether the plan has changed and is whole (as far as its length is known)."""
        if told.count is not None:
            self._expected = told.count
            self._heard.clear()
            return False
        sequence = told.sequence
        point = None if sequence == 0 else _point(told)  # 0 is a copy of home
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

    def hear_home(self, latitude_deg: float, longitude_deg: float, altitude_msl_m: float) -> bool:
        """The vehicle's home; whether the plan has changed."""
        home = PlanPoint(
            0, "home", math.radians(latitude_deg), math.radians(longitude_deg), altitude_msl_m=altitude_msl_m
        )
        if not _is_place(latitude_deg, longitude_deg) or home == self._home:
            return False
        self._home = home
        return True

    def points(self) -> tuple[PlanPoint, ...]:
        """The plan, home first, in the order of the sequence numbers."""
        home = () if self._home is None else (self._home,)
        return (*home, *(self._points[number] for number in sorted(self._points)))


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    inside = abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0  # false for NaN too
    return inside and (latitude_deg != 0.0 or longitude_deg != 0.0)


def _point(told: Overheard) -> PlanPoint | None:
    if told.frame not in (*_MSL_FRAMES, *_HOME_FRAMES, *_TERRAIN_FRAMES) or not _is_place(*told.place_deg):
        return None
    altitude_m = told.altitude_m if math.isfinite(told.altitude_m) else None
    return PlanPoint(
        told.sequence,
        _KINDS.get(told.command, "other"),
        math.radians(told.place_deg[0]),
        math.radians(told.place_deg[1]),
        altitude_msl_m=altitude_m if told.frame in _MSL_FRAMES else None,
        altitude_above_home_m=altitude_m if told.frame in _HOME_FRAMES else None,
    )
