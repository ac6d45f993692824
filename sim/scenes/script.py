"""What a scene file says, before it is staged at a site."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gateway.settings import Site
from sim.faults import Fault
from sim.flown_way import Craft
from sim.vehicles.wind import WindParameters


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A point of a route: on the runway's ground plan or geodetic; height above the runway or altitude above mean sea level."""

    along_m: float | None = None
    left_m: float | None = None
    latitude_rad: float | None = None
    longitude_rad: float | None = None
    height_m: float | None = None
    altitude_msl_m: float | None = None
    speed_mps: float | None = None


@dataclass(frozen=True, slots=True)
class Vehicle:
    """One [[vehicle]]: a word for its way, a mission file, or points; and its own position source, where it has one."""

    route: str | Path | tuple[Waypoint, ...]
    system: int | None = None  # None: the next free number
    craft: Craft = "aeroplane"
    speed_mps: float | None = None
    height_m: float | None = None
    begin_s: float = 0.0
    abeam_rad: float = 0.0  # the same way seen from the first radar at another bearing, positive to the left
    autopilot: bool = False  # it flies its mission by itself, in the scene's wind
    goes_around: int = 0  # so many landings are broken off, by an autopilot
    steering: str = "pid"  # a ship's autopilot
    gps: Mapping[str, Any] = field(default_factory=dict)  # fields of GpsParameters that differ from the scene's


@dataclass(frozen=True, slots=True)
class Script:
    """A scene as it is written. `gps`, `imu`, `say` and `radars` hold the fields that are set, one entry a radar.

    `radar_count` None: the site's radars, or as many as are written, at least one.
    """

    origin: str  # for a person: the file
    text: str
    name: str
    description: str
    duration_s: float | None = None  # None: until the last vehicle is gone
    seed: int = 0
    start_ns: int | None = None
    site: Site | None = None
    radar_count: int | None = None
    gps: Mapping[str, Any] = field(default_factory=dict)
    imu: Mapping[str, Any] = field(default_factory=dict)
    say: Mapping[str, Any] = field(default_factory=dict)
    radars: tuple[Mapping[str, Any], ...] = ()
    vehicles: tuple[Vehicle, ...] = ()
    drawn: tuple[str, int] | None = None  # aircraft that are drawn by chance: which scheme, and how many
    wind: WindParameters = WindParameters()
    current_mps: tuple[float, float] = (0.0, 0.0)  # of the water, east and north
    faults: tuple[Fault, ...] = ()
