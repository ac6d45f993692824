"""A file of what people declare, read: where aircraft go, and areas of weather. TOML:

[[declared]]
aircraft = "mavlink:1"
to = "IAF"                  # a [[waypoint]] of the site, "runway", "go-around", "home", or an item of its plan: 5

[[declared]]
aircraft = "mavlink:2"
latitude_deg = 31.02        # or a place
longitude_deg = 103.8
altitude_msl_m = 900.0      # optional

[[weather]]                 # as in a site file
name = "CB 1"
latitude_deg = 31.1
longitude_deg = 103.9
radius_m = 8000.0
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from typing import Any

from gateway.settings.reading import SiteError, read_weather
from gateway.settings.site import Weather

_KEYS = ("aircraft", "to", "latitude_deg", "longitude_deg", "altitude_msl_m")
_DAYS_OF_400_YEARS, _DAYS_TO_1970 = 146_097, 719_468


@dataclass(frozen=True, slots=True)
class Declared:
    """Where one aircraft is declared to go: a name or an item's number, or a place in degrees."""

    aircraft: str
    to: str | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_msl_m: float | None = None


@dataclass(frozen=True, slots=True)
class Declarations:
    """All that a file declares."""

    goals: tuple[Declared, ...] = ()
    weather: tuple[Weather, ...] = ()


def parse_declared(text: str, name: str) -> Declarations:
    """What a file declares. Raises SiteError: one sentence with the file's name."""
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise SiteError(f"{name}: not TOML: {error}.") from error
    for key in document:
        if key not in ("declared", "weather"):
            raise SiteError(f"{name}: unknown table {key!r}; there are [[declared]] and [[weather]].")
    rows = document.get("declared", [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise SiteError(f"{name}: write declared as a table, [[declared]].")
    goals = tuple(_declared(row, name) for row in rows)
    whose = [goal.aircraft for goal in goals]
    if len(set(whose)) < len(whose):
        twice = next(one for one in whose if whose.count(one) > 1)
        raise SiteError(f"{name}: {twice} is declared twice; say once where it goes.")
    weather = read_weather(document, text, name)
    names = [area.name for area in weather]
    if len(set(names)) < len(names):
        raise SiteError(f"{name}: two areas of [[weather]] have the same name; give each its own.")
    return Declarations(goals, weather)


def _declared(row: dict[str, Any], name: str) -> Declared:
    aircraft, to = row.get("aircraft"), row.get("to")
    unknown = [key for key in row if key not in _KEYS]
    if unknown:
        raise SiteError(f"{name}: unknown key {unknown[0]!r} in [[declared]]; there are {', '.join(_KEYS)}.")
    if not isinstance(aircraft, str) or not aircraft:
        raise SiteError(f'{name}: [[declared]] lacks an aircraft, such as aircraft = "mavlink:1".')
    place = [_degrees(row, key, most, name) for key, most in (("latitude_deg", 90.0), ("longitude_deg", 180.0))]
    altitude = _degrees(row, "altitude_msl_m", 1e5, name)
    if (place[0] is None) != (place[1] is None) or (to is None) == (place[0] is None):
        raise SiteError(f"{name}: {aircraft} needs either `to` or latitude_deg and longitude_deg.")
    if to is not None and (isinstance(to, bool) or not isinstance(to, str | int) or to == ""):
        raise SiteError(f"{name}: `to` of {aircraft} must be a name in quotes or an item's number, not {to!r}.")
    return Declared(aircraft, None if to is None else str(to), place[0], place[1], altitude)


def _degrees(row: dict[str, Any], key: str, most: float, name: str) -> float | None:
    value = row.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= most:
        raise SiteError(f"{name}: {key} must be a number within {most:g}, not {value!r}.")
    return float(value)


def instant_ns(text: str) -> int | None:
    """A time such as 2026-03-01T12:00:00Z as ns since 1970 UTC; None for what is none. Without a zone it is UTC."""
    zone = r"(?:Z|([+-])(\d\d):(\d\d))?"
    found = re.fullmatch(rf"(\d{{4}})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(\.\d+)?)?{zone}", text)
    if found is None:
        return None
    year, month, day, hour, minute = (int(part) for part in found.groups()[:5])
    if not (1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and minute < 60):
        return None
    shifted = year - (month <= 2)  # years that begin in March, so that the leap day is the last
    of_year = (153 * ((month - 3) % 12) + 2) // 5 + day - 1
    days = 365 * (shifted % 400) + shifted % 400 // 4 - shifted % 400 // 100 + of_year
    days += shifted // 400 * _DAYS_OF_400_YEARS - _DAYS_TO_1970
    seconds = ((days * 24 + hour) * 60 + minute) * 60 + int(found[6] or 0)
    if found[8]:
        seconds -= (1 if found[8] == "+" else -1) * (int(found[9]) * 60 + int(found[10])) * 60
    return seconds * 1_000_000_000 + round(float(found[7] or 0.0) * 1e9)
