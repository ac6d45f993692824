"""Flight plans overheard: mission items that a vehicle tells or is told, and its home, become one plan.

    MISSION_COUNT (44)           a transfer begins: so many items; 0 = there is no mission
    MISSION_ITEM (39)            x, y in degrees; MISSION_ITEM_INT (73): degE7; z in m, above what `frame` says:
                                 0, 5 mean sea level; 3, 6 home; 10, 11 the terrain
    MISSION_ACK (47)             a vehicle that refuses what it was sent keeps the plan it had
    MISSION_CLEAR_ALL (45)       no mission any more

Mission altitudes above home stay so; terrain altitudes are left out. Items without a position, and those that are no place
to pass (commands to be done, a region of interest), are no points of a plan. Item 0 of ArduPilot is a copy of home; of
PX4 it is the first point. An item that is marked 2 or 3 is a guided target or a change of altitude and no item.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from adapters.mavlink_frames import fields
from gateway.observation import PlanPoint

_PARAMETERS = ("param1", "param2", "param3")
_ITEM = ("seq", "command", "frame", "x", "y", "z", "target_system", "mission_type", "current")
MISSION_COUNT, _read_count = fields("MISSION_COUNT", "count", "target_system", "mission_type")
MISSION_ITEM, _read_item = fields("MISSION_ITEM", *_ITEM, *_PARAMETERS)
MISSION_ITEM_INT, _read_item_int = fields("MISSION_ITEM_INT", *_ITEM, *_PARAMETERS)
MISSION_ACK, _read_ack = fields("MISSION_ACK", "type", "target_system", "mission_type")
MISSION_CLEAR_ALL, _read_clear = fields("MISSION_CLEAR_ALL", "target_system", "mission_type")
MISSION_MESSAGES = frozenset((MISSION_COUNT, MISSION_ITEM, MISSION_ITEM_INT, MISSION_ACK, MISSION_CLEAR_ALL))

_KINDS = {16: "waypoint", 82: "waypoint", 22: "take-off", 84: "take-off", 24: "take-off", 21: "landing", 85: "landing"}
_KINDS |= dict.fromkeys((17, 18, 19, 31), "loiter")
_LOITER_TURNS = 18
_RADII = {17: 2, 18: 2, 19: 2, 31: 1}  # which parameter, from 0, is the radius
_LAST_NAVIGATION, _REGION_OF_INTEREST = 95, 80
_MSL_FRAMES, _HOME_FRAMES, _TERRAIN_FRAMES = (0, 5), (3, 6), (10, 11)
_ALL_TYPES = 255
_HIGHEST_M = 100_000.0
RETURN_RADIUS, LOITER_RADIUS = "RTL_RADIUS", "WP_LOITER_RAD"
RETURN_HEIGHT, RETURN_HEIGHT_CM = "RTL_ALTITUDE", "ALT_HOLD_RTL"
RETURN_PARAMETERS = frozenset((RETURN_RADIUS, LOITER_RADIUS, RETURN_HEIGHT, RETURN_HEIGHT_CM))


def plan_point(
    sequence: int,
    command: int,
    frame: int,
    latitude_deg: float,
    longitude_deg: float,
    altitude_m: float,
    parameters: tuple[float, float, float] = (math.nan, math.nan, math.nan),
) -> PlanPoint | None:
    """A mission item as a point of a plan; None where it is no place that the vehicle will pass.

    `command` and `frame` are MAV_CMD and MAV_FRAME; the altitude is above what the frame says, NaN where it says none, as
    100 km and more do. `parameters` are the item's first three: of a point that is flown round the turns, and the radius,
    positive to the right, 0 = the vehicle's own.
    """
    if command > _LAST_NAVIGATION or command == _REGION_OF_INTEREST or not _is_place(latitude_deg, longitude_deg):
        return None
    if frame not in (*_MSL_FRAMES, *_HOME_FRAMES, *_TERRAIN_FRAMES):
        return None
    altitude = altitude_m if abs(altitude_m) < _HIGHEST_M else None
    return PlanPoint(
        sequence,
        _KINDS.get(command, "other"),
        math.radians(latitude_deg),
        math.radians(longitude_deg),
        altitude_msl_m=altitude if frame in _MSL_FRAMES else None,
        altitude_above_home_m=altitude if frame in _HOME_FRAMES else None,
        radius_m=_told(parameters[_RADII[command]], 1.0) if command in _RADII else None,
        turns=_told(parameters[0], 0.0) if command == _LOITER_TURNS else None,
    )


def _told(value: float, least: float) -> float | None:
    """A parameter that says something: a finite number of at least so much, whichever its sign."""
    return value if least <= abs(value) <= _HIGHEST_M else None


class Overheard(NamedTuple):
    """One message of a mission transfer."""

    target_system: int
    act: str  # "count", "item", "acknowledge", "clear"; "" = about a fence, rally points or a guided target
    number: int = 0  # of items, of the item, or what the acknowledgement says (0 = accepted)
    point: PlanPoint | None = None


def overheard(message: int, payload: bytes) -> Overheard:
    """What one of `MISSION_MESSAGES` says."""
    if message == MISSION_COUNT:
        count, target, mission = _read_count(payload)
        return Overheard(target, "" if mission else "count", count)
    if message == MISSION_ACK:
        result, target, mission = _read_ack(payload)
        return Overheard(target, "" if mission else "acknowledge", result)
    if message == MISSION_CLEAR_ALL:
        target, mission = _read_clear(payload)
        return Overheard(target, "" if mission not in (0, _ALL_TYPES) else "clear")
    read = _read_item_int if message == MISSION_ITEM_INT else _read_item
    sequence, command, frame, x, y, altitude_m, target, mission, current, *given = read(payload)
    if mission or current > 1:
        return Overheard(target, "")
    place = (x / 1e7, y / 1e7) if message == MISSION_ITEM_INT else (x, y)
    point = plan_point(sequence, command, frame, *place, altitude_m, (given[0], given[1], given[2]))
    return Overheard(target, "item", sequence, point)


@dataclass(slots=True)
class PlanBook:
    """What is known of one vehicle's plan so far."""

    next_item: int | None = None  # where it says that it goes
    _home: PlanPoint | None = None
    _points: dict[int, PlanPoint] = field(default_factory=dict)
    _returns: dict[str, float] = field(default_factory=dict)  # parameters of the way home
    _heard: set[int] = field(default_factory=set)
    _expected: int | None = None
    _before: dict[int, PlanPoint] | None = None  # what it had when a station began to send it another
    _told: tuple[PlanPoint, ...] = ()
    _intents: dict[str, tuple[float | None, ...]] = field(default_factory=dict)

    def hear(self, told: Overheard, *, by_vehicle: bool, begins_with_home: bool = True) -> bool:
        """One message of a transfer; whether the plan has changed and is whole (as far as its length is known)."""
        if told.act == "item":
            self._hear_item(told.number, None if told.number == 0 and begins_with_home else told.point)
        elif told.act in ("count", "clear"):
            self._begin(told.number, by_vehicle)
        elif told.act == "acknowledge" and by_vehicle:
            self._end(accepted=told.number == 0)
        whole = self._expected is None or len(self._heard) >= self._expected
        return whole and self._is_news()

    def hear_home(self, latitude_deg: float, longitude_deg: float, altitude_msl_m: float) -> bool:
        """The vehicle's home; whether the plan has changed."""
        if not _is_place(latitude_deg, longitude_deg):
            return False
        place = (math.radians(latitude_deg), math.radians(longitude_deg))
        home = PlanPoint(0, "home", *place, altitude_msl_m=altitude_msl_m)
        if home == self._home:
            return False
        self._home = home
        return self._is_news()

    def hear_return(self, name: str, value: float) -> bool:
        """One of `RETURN_PARAMETERS`; whether the plan has changed."""
        if not abs(value) <= _HIGHEST_M:  # false for NaN too
            return False
        self._returns[name] = value
        return self._is_news()

    def points(self) -> tuple[PlanPoint, ...]:
        """The plan, home first, in the order of the sequence numbers."""
        home = () if self._home is None else (self._with_return(self._home),)
        return (*home, *(self._points[number] for number in sorted(self._points)))

    def point(self, sequence: int) -> PlanPoint | None:
        """The point of this item; None where it is not known or no point."""
        return self._points.get(sequence)

    def altitude_msl_m(self, point: PlanPoint) -> float | None:
        """A point's altitude above mean sea level, by home's where it is told above home; None where that is not known."""
        above = point.altitude_above_home_m
        if above is None or self._home is None or self._home.altitude_msl_m is None:
            return point.altitude_msl_m
        return self._home.altitude_msl_m + above

    def is_new_intent(self, told_by: str, goal: tuple[float | None, ...]) -> bool:
        """Take in where the vehicle says that it goes; whether that differs from what it said last."""
        if self._intents.get(told_by) == goal:
            return False
        self._intents[told_by] = goal
        return True

    def is_withdrawn(self, told_by: str) -> bool:
        """Take in that the vehicle does not say any more where it goes; whether it had."""
        return self._intents.pop(told_by, None) is not None

    def summary(self) -> str:
        """The plan in a few words, for people."""
        number = len(self._points)
        if not number and self.next_item is None:
            return "none known"
        text = f"{number} point{'' if number == 1 else 's'}"
        return text if self.next_item is None else f"{text}, next {self.next_item}"

    def _with_return(self, home: PlanPoint) -> PlanPoint:
        """Home, and how wide and how high it is circled there; a radius of 0 is none, a height below 0 that which it has."""
        told = self._returns
        height = told.get(RETURN_HEIGHT, told.get(RETURN_HEIGHT_CM, -1.0) / 100.0)
        radius = told.get(RETURN_RADIUS) or told.get(LOITER_RADIUS) or None
        return replace(home, radius_m=radius, altitude_above_home_m=height if height >= 0.0 else None)

    def _hear_item(self, sequence: int, point: PlanPoint | None) -> None:
        if point is None:
            self._points.pop(sequence, None)
        else:
            self._points[sequence] = point
        self._heard.add(sequence)
        if self._expected is not None and len(self._heard) >= self._expected:
            for surplus in [number for number in self._points if number >= self._expected]:
                del self._points[surplus]

    def _begin(self, count: int, by_vehicle: bool) -> None:
        """A transfer of so many items begins; of none: the plan is empty."""
        self._before = None if by_vehicle else dict(self._points)
        self._expected = count
        self._heard.clear()
        if count == 0:
            self._points.clear()
            self.next_item = None

    def _end(self, *, accepted: bool) -> None:
        """The vehicle has taken what it was sent, or has not."""
        if self._before is not None and not accepted:
            self._points, self._expected = self._before, None
        self._before = None

    def _is_news(self) -> bool:
        points = self.points()
        if points == self._told:
            return False
        self._told = points
        return True


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    inside = abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0  # false for NaN too
    return inside and (latitude_deg != 0.0 or longitude_deg != 0.0)
