"""What people declare while a session runs, one JSON object a line, beside the plans of `told`:

    {"told": "intent", "aircraft": "mavlink:1", "to": "IAF"}               a published point, or "runway", "go-around", "home"
    {"told": "intent", "aircraft": "mavlink:1", "item": 5}                 an item of its plan
    {"told": "intent", "aircraft": "mavlink:1", "latitude_deg": 31.0, "longitude_deg": 104.0, "altitude_msl_m": 900.0}
    {"told": "intent", "aircraft": "mavlink:1"}                            what was declared of it is withdrawn
    {"told": "weather", "name": "CB 1", "latitude_deg": 31.1, "longitude_deg": 103.8, "radius_m": 8000.0}
    {"told": "weather", "name": "CB 1", "polygon_deg": [[31.1, 103.8], ...], "from": "2026-03-01T12:00:00Z", "top_msl_m": 9000.0}
    {"told": "weather", "name": "CB 1"}                                    it is gone

An altitude, `from`, `until`, `base_msl_m` and `top_msl_m` may be left out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from adapters.told_fields import HIGHEST_M, json_object, number, place_rad
from gateway.observation import Intent, WeatherArea
from gateway.settings import Weather, encloses
from gateway.settings.instants import instant_ns

DECLARED = "declared"
LONGEST_LINE = 100_000
_NAME_AT_MOST = 200


@dataclass(frozen=True, slots=True)
class Goal:
    """Where an aircraft is declared to go: one of a name, an item, a place; none of them = withdrawn."""

    name: str | None = None
    item: int | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_msl_m: float | None = None


def encode_intent(aircraft: str, goal: Goal) -> bytes:
    """A declared intent as one told line, without the line's end."""
    told: dict[str, Any] = {"told": "intent", "aircraft": aircraft, "to": goal.name, "item": goal.item}
    told |= {"latitude_deg": goal.latitude_deg, "longitude_deg": goal.longitude_deg}
    return _line(told | {"altitude_msl_m": goal.altitude_msl_m})


def encode_weather(name: str, area: Weather | None) -> bytes:
    """An area of weather as one told line; None: it is gone."""
    told: dict[str, Any] = {"told": "weather", "name": name}
    if area is not None:
        corners = [[math.degrees(latitude), math.degrees(longitude)] for latitude, longitude in area.polygon_rad]
        told |= {"polygon_deg": corners or None, "radius_m": area.radius_m}
        if area.latitude_rad is not None and area.longitude_rad is not None:
            told |= {"latitude_deg": math.degrees(area.latitude_rad), "longitude_deg": math.degrees(area.longitude_rad)}
        told |= {"from": area.valid_from, "until": area.valid_until}
        told |= {"base_msl_m": area.base_msl_m, "top_msl_m": area.top_msl_m}
    return _line(told)


def decode(data: bytes, now: int, received_at: int) -> Intent | WeatherArea | None:
    """What a told line declares, at `now` in the session's time; None where it is not understood as a whole. Never raises."""
    told = json_object(data, LONGEST_LINE)
    if told is None:
        return None
    if told.get("told") == "intent":
        return _intent(told, now, received_at)
    return _weather(told, now, received_at) if told.get("told") == "weather" else None


def sentence(said: Intent | WeatherArea) -> str:
    """What was declared, for people."""
    if isinstance(said, WeatherArea):
        return f"weather {said.name} is {'gone' if said.area is None else 'told'}"
    if not says_where(said):
        return f"what was declared of {said.aircraft} is withdrawn"
    place = (said.latitude_rad or 0.0, said.longitude_rad or 0.0)
    there = ", ".join(f"{math.degrees(angle):.4f}" for angle in place)
    where = said.name or (there if said.sequence is None else f"item {said.sequence} of its plan")
    return f"{said.aircraft} is declared to go to {where}"


def says_where(said: Intent) -> bool:
    """Whether it does not withdraw what was said before."""
    return said.name is not None or said.sequence is not None or said.latitude_rad is not None


def _intent(told: Mapping[str, Any], now: int, received_at: int) -> Intent | None:
    aircraft, name, item = told.get("aircraft"), told.get("to"), told.get("item")
    place = _place(told)
    altitude = number(told.get("altitude_msl_m"), HIGHEST_M)
    if not _is_name(aircraft) or not (name is None or _is_name(name)) or place is None:
        return None
    if not (item is None or (type(item) is int and 0 <= item < 1 << 16)):
        return None
    if told.get("altitude_msl_m") is not None and altitude is None:
        return None
    if sum(one is not None for one in (name, item, place[0])) > 1:
        return None
    return Intent(str(aircraft), now, received_at, DECLARED, item, *place, altitude_msl_m=altitude, name=name)


def _weather(told: Mapping[str, Any], now: int, received_at: int) -> WeatherArea | None:
    name, place, radius = told.get("name"), _place(told), number(told.get("radius_m"), 1e7)
    if not isinstance(name, str) or not _is_name(name) or place is None:
        return None
    corners = _corners(told.get("polygon_deg"))
    times = [told.get(key) for key in ("from", "until")]
    heights = [told.get(key) for key in ("base_msl_m", "top_msl_m")]
    bounds = [number(height, HIGHEST_M) for height in heights]
    if corners is None or any(given is not None and one is None for given, one in zip(heights, bounds, strict=True)):
        return None
    if any(one is not None and (not isinstance(one, str) or instant_ns(one) is None) for one in times):
        return None
    if place[0] is None and not corners:
        return WeatherArea(name, now, received_at, None)
    if (place[0] is not None and (radius is None or radius <= 0.0)) or (place[0] is not None and corners):
        return None
    return WeatherArea(name, now, received_at, Weather(name, *place, radius, corners, *times, *bounds))


def _place(told: Mapping[str, Any]) -> tuple[float | None, float | None] | None:
    """Latitude and longitude, rad, or None for both; None where only one is given, or one is none."""
    if told.get("latitude_deg") is None and told.get("longitude_deg") is None:
        return None, None
    return place_rad(told)


def _corners(told: object) -> tuple[tuple[float, float], ...] | None:
    """A polygon's corners, rad; none where none is told, None where it is none."""
    if told is None:
        return ()
    if not isinstance(told, list) or len(told) < 3:
        return None
    found = []
    for one in told:
        place = place_rad(dict(zip(("latitude_deg", "longitude_deg"), one, strict=True))) if _is_pair(one) else None
        if place is None:
            return None
        found.append(place)
    return tuple(found) if encloses(found) else None


def _is_pair(told: object) -> bool:
    return isinstance(told, list) and len(told) == 2


def _is_name(told: object) -> bool:
    return isinstance(told, str) and 0 < len(told) <= _NAME_AT_MOST


def _line(told: Mapping[str, Any]) -> bytes:
    return json.dumps({key: one for key, one in told.items() if one is not None}, allow_nan=False).encode()
