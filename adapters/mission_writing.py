"""Mission files for ground stations, written: QGroundControl's .plan and QGC WPL 110.

`adapters.mission_files` says what they look like. Both give again the places that were written within 1e-7 degrees.
Areas to keep out of become exclusion fences of a .plan; text of waypoints has no place for them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

WAYPOINT, LAND, TAKE_OFF, LOITER_TO_ALTITUDE = 16, 21, 22, 31  # MAV_CMD
CHANGE_SPEED, LANDING_SEQUENCE = 178, 189
ABOVE_SEA, NO_PLACE, ABOVE_HOME = 0, 2, 3  # MAV_FRAME

_ARDUPILOT, _FIXED_WING = 3, 1  # MAV_AUTOPILOT, MAV_TYPE
_ALTITUDE_MODES = {ABOVE_HOME: 1, ABOVE_SEA: 2}  # QGroundControl's own numbers


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item of a mission, as a mission file and MISSION_ITEM_INT hold it.

    `command` is a MAV_CMD, `frame` a MAV_FRAME that says what the altitude (m) is above. `parameters` are the first four;
    NaN stands for what the vehicle may choose itself, such as its heading.
    """

    command: int
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    altitude_m: float = 0.0
    frame: int = ABOVE_HOME
    parameters: tuple[float, float, float, float] = (0.0, 0.0, 0.0, math.nan)


def wire_fields(item: MissionItem, sequence: int, *, is_float: bool = False) -> dict[str, Any]:
    """The fields of MISSION_ITEM_INT, or with floats of MISSION_ITEM, without whom it is for."""
    return {
        **{f"param{number}": value for number, value in enumerate(item.parameters, 1)},
        "seq": sequence,
        "command": item.command,
        "frame": item.frame,
        "current": 0,
        "autocontinue": 1,
        "x": item.latitude_deg if is_float else round(item.latitude_deg * 1e7),
        "y": item.longitude_deg if is_float else round(item.longitude_deg * 1e7),
        "z": item.altitude_m,
        "mission_type": 0,
    }


@dataclass(frozen=True, slots=True)
class Fence:
    """An area that a vehicle keeps out of: a circle about a corner where there is a radius, else the corners' polygon.

    Corners are latitude and longitude in degrees.
    """

    corners_deg: tuple[tuple[float, float], ...]
    radius_m: float | None = None


def format_plan(
    items: Sequence[MissionItem],
    home: tuple[float, float, float],
    *,
    cruise_mps: float = 15.0,
    fences: Sequence[Fence] = (),
) -> str:
    """A .plan. `home`: latitude and longitude in degrees, altitude above mean sea level in m."""
    mission = {
        "version": 2,
        "firmwareType": _ARDUPILOT,
        "vehicleType": _FIXED_WING,
        "cruiseSpeed": cruise_mps,
        "hoverSpeed": cruise_mps,
        "globalPlanAltitudeMode": 1,
        "plannedHomePosition": list(home),
        "items": [_simple_item(item, number) for number, item in enumerate(items, 1)],
    }
    circles = [one for one in fences if one.radius_m is not None]
    polygons = [one for one in fences if one.radius_m is None]
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "Talkdown",
        "geoFence": {
            "version": 2,
            "circles": [
                {
                    "version": 1,
                    "inclusion": False,
                    "circle": {"center": list(one.corners_deg[0]), "radius": one.radius_m},
                }
                for one in circles
            ],
            "polygons": [
                {"version": 1, "inclusion": False, "polygon": [list(corner) for corner in one.corners_deg]}
                for one in polygons
            ],
        },
        "mission": mission,
        "rallyPoints": {"version": 2, "points": []},
    }
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def format_waypoints(items: Sequence[MissionItem], home: tuple[float, float, float]) -> str:
    """QGC WPL 110: home is item 0, a line an item; what the vehicle may choose is 0, as ground stations write it."""
    first = MissionItem(WAYPOINT, *home, frame=ABOVE_SEA)
    lines = ["QGC WPL 110"]
    for number, item in enumerate((first, *items)):
        numbers = (0.0 if math.isnan(one) else one for one in item.parameters)
        place = f"{item.latitude_deg:.9f}\t{item.longitude_deg:.9f}\t{item.altitude_m:.3f}"
        told = "\t".join(f"{one:.8f}" for one in numbers)
        lines.append(f"{number}\t{int(number == 0)}\t{item.frame}\t{item.command}\t{told}\t{place}\t1")
    return "\n".join(lines) + "\n"


def _simple_item(item: MissionItem, number: int) -> dict[str, Any]:
    place = (item.latitude_deg, item.longitude_deg, item.altitude_m)
    written: dict[str, Any] = {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [None if math.isnan(one) else one for one in (*item.parameters, *place)],
    }
    if item.frame in _ALTITUDE_MODES:
        mode = _ALTITUDE_MODES[item.frame]
        written |= {"Altitude": item.altitude_m, "AltitudeMode": mode, "AMSLAltAboveTerrain": None}
    return written
