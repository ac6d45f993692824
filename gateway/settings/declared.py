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

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gateway.settings.reading import SiteError, read_table, read_toml, read_weather
from gateway.settings.site import Weather
from gateway.settings.tables import Table, number, text


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


def _to(value: Any) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int) or value == "":
        raise ValueError(f"must be a name in quotes or an item's number, not {value!r}")
    return str(value)


_DECLARED = Table(
    {
        "aircraft": ("aircraft", text()),
        "to": ("to", _to),
        "latitude_deg": ("latitude_deg", number(-90.0, 90.0)),
        "longitude_deg": ("longitude_deg", number(-180.0, 180.0)),
        "altitude_msl_m": ("altitude_msl_m", number(-1e5, 1e5)),
    },
    required=("aircraft",),
    many=True,
)


def parse_declared(content: str, name: str) -> Declarations:
    """What a file declares. Raises SiteError: one sentence with the file's name."""
    document = read_toml(content, name)
    for key in document:
        if key not in ("declared", "weather"):
            raise SiteError(f"{name}: unknown table {key!r}; there are [[declared]] and [[weather]].")
    goals = tuple(Declared(**row) for row in read_table(document, "declared", _DECLARED, content, name))
    for goal in goals:
        somewhere = goal.latitude_deg is not None
        if somewhere != (goal.longitude_deg is not None) or somewhere == (goal.to is not None):
            raise SiteError(f"{name}: {goal.aircraft} needs either `to` or latitude_deg and longitude_deg.")
    if (twice := _twice([goal.aircraft for goal in goals])) is not None:
        raise SiteError(f"{name}: {twice} is declared twice; say once where it goes.")
    weather = read_weather(document, content, name)
    if (twice := _twice([area.name for area in weather])) is not None:
        raise SiteError(f"{name}: two areas of [[weather]] have the name {twice}; give each its own.")
    return Declarations(goals, weather)


def _twice(names: Sequence[str]) -> str | None:
    return next((one for one in names if names.count(one) > 1), None)
