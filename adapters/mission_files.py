"""Mission files of ground stations: the points of a flight plan.

    .plan           QGroundControl, JSON: {"fileType": "Plan", "mission": {"items": [...], "plannedHomePosition": [...]}}
                    SimpleItem: command, frame, params 1 to 7 (5, 6, 7: latitude, longitude in degrees, altitude in m)
                    ComplexItem: a survey's own simple items, or a landing pattern's approach and landing point
    QGC WPL 110     text, a line an item: index, current, frame, command, parameters 1 to 4, latitude, longitude,
                    altitude, autocontinue; index 0 is home

Altitudes are above what the item's frame says, as on the wire.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from adapters.mission_writing import (
    ABOVE_HOME,
    ABOVE_SEA,
    LAND,
    LANDING_SEQUENCE,
    LOITER_TO_ALTITUDE,
    WAYPOINT,
    MissionItem,
)
from adapters.plans import plan_point
from adapters.reasons import reason_of
from gateway.observation import PlanPoint

MissionKind = Literal["plan", "waypoints"]

_WPL = b"QGC WPL "
_PLAN = re.compile(rb'"fileType"\s*:\s*"Plan"')
_VERSION = "110"
_COLUMNS = 12
_PX4 = 12  # numbers its items from 0, the others from 1: there 0 is home
_NOWHERE = (math.nan, math.nan, math.nan)
_UNTOLD = (math.nan, math.nan, math.nan, math.nan)
_LARGEST_BYTES = 16 << 20


class MissionFileError(ValueError):
    """A mission file that cannot be used; the message is one plain sentence."""


class _Item(NamedTuple):
    where: str  # for a person
    sequence: int
    item: MissionItem  # NaN where the file says nothing

    @property
    def point(self) -> PlanPoint | None:
        """As a point of a plan; None where it is no place to pass."""
        one = self.item
        place = (one.latitude_deg, one.longitude_deg, one.altitude_m)
        return plan_point(self.sequence, one.command, one.frame, *place, one.parameters[:3])


def mission_kind(beginning: bytes) -> MissionKind | None:
    """What kind of mission file begins so; None for what is none."""
    if beginning.startswith(_WPL):
        return "waypoints"
    return "plan" if beginning.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and _PLAN.search(beginning) else None


def read_mission(path: Path) -> tuple[PlanPoint, ...]:
    """The points of a mission file, home first where it has one.

    Raises MissionFileError, with the line or item, for what is wrong in it or when there is no point.
    """
    items, home = _read(path)
    points = [point for one in items if (point := one.point) is not None]
    if not points:
        raise MissionFileError(f"{path} holds no item that is a place to fly to.")
    return (*home, *points)


def read_items(path: Path) -> tuple[tuple[MissionItem, ...], PlanPoint | None]:
    """All items of a mission file as a vehicle takes them (no place is 0), without home; and home, where it has one.

    Raises MissionFileError, with the line or item, for what is wrong in it or when there is no item.
    """
    items, home = _read(path)
    if not items:
        raise MissionFileError(f"{path} holds no item.")
    read = []
    for _, _, item in items:
        place = (item.latitude_deg, item.longitude_deg, item.altitude_m)
        latitude, longitude, altitude = (0.0 if math.isnan(part) else part for part in place)
        read.append(replace(item, latitude_deg=latitude, longitude_deg=longitude, altitude_m=altitude))
    return tuple(read), next(iter(home), None)


def _read(path: Path) -> tuple[list[_Item], tuple[PlanPoint, ...]]:
    """The items, and home where it has one."""
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise MissionFileError(f"{path} is too large to be a mission.")
        content = path.read_bytes()
    except OSError as error:
        raise MissionFileError(f"{path} cannot be read ({reason_of(error)}).") from error
    kind = mission_kind(content)
    if kind is None:
        raise MissionFileError(f"{path} is no mission file: neither QGroundControl's .plan nor QGC WPL 110.")
    text = content.decode("utf-8-sig", "replace")
    return _of_plan(path, text) if kind == "plan" else _of_lines(path, text)


def _home(place: tuple[float, float, float]) -> tuple[PlanPoint, ...]:
    found = plan_point(0, WAYPOINT, ABOVE_SEA, *place)
    if found is None:
        return ()
    return (PlanPoint(0, "home", found.latitude_rad, found.longitude_rad, altitude_msl_m=found.altitude_msl_m),)


def _of_lines(path: Path, text: str) -> tuple[list[_Item], tuple[PlanPoint, ...]]:
    lines = text.splitlines()
    version = lines[0].removeprefix(_WPL.decode()).strip()
    if version != _VERSION:
        raise MissionFileError(f"{path}, line 1: version {version[:20]!r} is not known, only {_VERSION} is.")
    items: list[_Item] = []
    home: tuple[PlanPoint, ...] = ()
    for count, line in enumerate(lines[1:], 2):
        words = line.split()
        if not words:
            continue
        where = f"{path}, line {count}"
        if len(words) != _COLUMNS:
            raise MissionFileError(f"{where}: an item has {_COLUMNS} columns, here are {len(words)}.")
        sequence, frame, command = (_whole(words[place], where) for place in (0, 2, 3))
        place = (_number(words[8], where), _number(words[9], where), _number(words[10], where))
        if sequence == 0:
            home = _home(place)
        else:
            first, second, third, fourth = (_number(word, where) for word in words[4:8])
            items.append(_Item(where, sequence, MissionItem(command, *place, frame, (first, second, third, fourth))))
    return items, home


def _of_plan(path: Path, text: str) -> tuple[list[_Item], tuple[PlanPoint, ...]]:
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise MissionFileError(f"{path}, line {error.lineno}: this is not JSON ({error.msg.lower()}).") from error
    except RecursionError as error:
        raise MissionFileError(f"{path} is no plan: it is nested too deeply.") from error
    except ValueError as error:
        raise MissionFileError(f"{path} is no plan: a number in it has thousands of digits.") from error
    mission = _part(document, "mission", dict, f"{path}")
    planned = mission.get("plannedHomePosition")
    home = () if planned is None else _home(_place(planned, f"{path}, plannedHomePosition"))
    first = 0 if mission.get("firmwareType") == _PX4 else 1
    items: list[_Item] = []
    for count, item in enumerate(_part(mission, "items", list, f"{path}, mission"), 1):
        items += _plan_items(item, first + len(items), f"{path}, item {count}")
    return items, home


def _plan_items(item: Any, sequence: int, where: str) -> Iterator[_Item]:
    """The mission items that one item of a .plan stands for."""
    kind = _part(item, "type", str, where)
    if kind == "SimpleItem":
        params = _part(item, "params", list, where)
        if len(params) != 7:
            raise MissionFileError(f"{where}: params has {len(params)} values, a SimpleItem has 7.")
        command, frame = (_whole(item.get(name), f"{where}, {name}") for name in ("command", "frame"))
        first, second, third, fourth = (_number(one, where) for one in params[:4])
        place = _place(params[4:], f"{where}, params")
        yield _Item(where, sequence, MissionItem(command, *place, frame, (first, second, third, fourth)))
    elif kind == "ComplexItem":
        yield from _complex_items(item, sequence, where)
    else:
        raise MissionFileError(f"{where}: type {kind!r} is not known, only SimpleItem and ComplexItem are.")


def _complex_items(item: dict[str, Any], sequence: int, where: str) -> Iterator[_Item]:
    transects = item.get("TransectStyleComplexItem")
    if isinstance(transects, dict):
        for count, simple in enumerate(_part(transects, "Items", list, where)):
            yield from _plan_items(simple, sequence + count, f"{where}.{count + 1}")
    elif "landCoordinate" in item:
        above_home = item.get("altitudesAreRelative", True)
        frame = ABOVE_HOME if above_home else ABOVE_SEA
        approach = item.get("landingApproachCoordinate", item.get("loiterCoordinate"))
        yield _Item(where, sequence, MissionItem(LANDING_SEQUENCE, *_NOWHERE, frame, _UNTOLD))
        place = _place(approach, f"{where}, landingApproachCoordinate")
        command = LOITER_TO_ALTITUDE if item.get("useLoiterToAlt", True) else WAYPOINT
        circle = (math.nan, _radius(item, where), math.nan, math.nan)
        yield _Item(where, sequence + 1, MissionItem(command, *place, frame, circle))
        ground = _place(item["landCoordinate"], f"{where}, landCoordinate")
        yield _Item(where, sequence + 2, MissionItem(LAND, *ground, frame, _UNTOLD))
    else:
        kind = item.get("complexItemType")
        raise MissionFileError(f"{where}: a ComplexItem of type {kind!r} is not known; only surveys and landings are.")


def _radius(landing: dict[str, Any], where: str) -> float:
    """Of the circle in which the height of a landing pattern is reached, positive to the right; NaN = not known."""
    radius = abs(_number(landing.get("loiterRadius"), where))
    return radius if landing.get("loiterClockwise", True) else -radius


def _part(whole: Any, name: str, kind: type, where: str) -> Any:
    part = whole.get(name) if isinstance(whole, dict) else None
    if not isinstance(part, kind):
        raise MissionFileError(f"{where}: {name} is missing, or not what it should be.")
    return part


def _place(values: Any, where: str) -> tuple[float, float, float]:
    """Latitude, longitude, altitude; what is null is not a number."""
    if not isinstance(values, list) or len(values) < 2:
        raise MissionFileError(f"{where}: a place is [latitude, longitude, altitude].")
    latitude, longitude, altitude = (_number(value, where) for value in [*values, None][:3])
    return latitude, longitude, altitude


def _number(value: Any, where: str) -> float:
    if value is None:
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise MissionFileError(f"{where}: {str(value)[:20]!r} is not a number.") from error


def _whole(value: Any, where: str) -> int:
    number = _number(value, where)
    if not math.isfinite(number) or number != int(number) or not 0 <= number < 65536:
        raise MissionFileError(f"{where}: {str(value)[:20]!r} is not a whole number.")
    return int(number)
