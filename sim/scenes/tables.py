"""The tables of a scene file: their keys, what each is inside, and which values it may have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from gateway.settings.tables import Convert, Table, flag, instant, number, text, whole
from sim import faults
from sim.faults import Fault
from sim.faulty_sensors import COMPONENTS
from sim.parameter_tables import checked
from sim.scene import LARGEST_SYSTEM
from sim.ships.autopilots import KINDS as STEERING

_RAD = math.pi / 180.0
_METRES = number(-1e6, 1e6)
_HEIGHT = number(-1000.0, 40_000.0)
_SPEED = number(0.0, 1000.0)
_SECOND = number(0.0, 1e7)
_SHARE = number(0.0, 1.0)
_COMPASS = number(-360.0, 360.0, scale=_RAD)


def _components(value: Any) -> tuple[str, ...]:
    named = tuple(value) if isinstance(value, list) else (value,)
    if not named or any(one not in COMPONENTS for one in named):
        raise ValueError(f"must be one or several of {', '.join(COMPONENTS)}, not {value!r}")
    return named


def _route(value: Any) -> Any:
    if isinstance(value, str) and value:
        return value
    if isinstance(value, list) and len(value) >= 2 and all(isinstance(point, dict) for point in value):
        return value
    raise ValueError('must be a word such as "approach", a mission file, or a list of two points or more, each {...}')


def _gps(value: Any) -> Any:
    if not isinstance(value, dict):
        raise ValueError("must be a table, [vehicle.gps]")
    return value


SCENE = Table(
    {
        "name": ("name", text()),
        "description": ("description", text()),
        "duration_s": ("duration_s", checked("duration_s", float)),
        "start": ("start", instant),
        "seed": ("seed", whole(0, 2**32 - 1)),
        "site": ("site", text()),
        "radars": ("radar_count", checked("radars", int)),
    },
    required=("description",),
)
VEHICLE = Table(
    {
        "system": ("system", whole(1, LARGEST_SYSTEM)),
        "kind": ("craft", text("aeroplane", "airliner", "copter", "helicopter", "ship")),
        "route": ("route", _route),
        "speed_mps": ("speed_mps", number(0.1, 1000.0)),
        "height_m": ("height_m", _HEIGHT),
        "begin_s": ("begin_s", number(-1e6, 1e6)),
        "abeam_deg": ("abeam_rad", number(-180.0, 180.0, scale=_RAD)),
        "autopilot": ("autopilot", flag),
        "goes_around": ("goes_around", whole(0, 10)),
        "steering": ("steering", text(*STEERING)),
        "gps": ("gps", _gps),
    },
    required=("route",),
    many=True,
)
WAYPOINT = Table(
    {
        "along_m": ("along_m", _METRES),
        "left_m": ("left_m", _METRES),
        "latitude_deg": ("latitude_rad", number(-90.0, 90.0, scale=_RAD)),
        "longitude_deg": ("longitude_rad", number(-180.0, 180.0, scale=_RAD)),
        "height_m": ("height_m", _HEIGHT),
        "altitude_msl_m": ("altitude_msl_m", _HEIGHT),
        "speed_mps": ("speed_mps", _SPEED),
    }
)
WIND = Table(
    {
        "speed_mps": ("speed_mps", number(0.0, 100.0)),
        "from_deg": ("from_rad", _COMPASS),
        "gust_sigma_mps": ("gust_sigma_mps", number(0.0, 30.0)),
        "gust_length_m": ("gust_length_m", number(1.0, 1e4)),
    }
)
SEA = Table({"current_mps": ("speed_mps", number(0.0, 10.0)), "current_to_deg": ("to_rad", _COMPASS)})
DRAWN = Table({"aircraft": ("aircraft", checked("aircraft", int))}, required=("aircraft",))

_WHEN: dict[str, tuple[str, Convert]] = {
    "kind": ("kind", text()),
    "at_s": ("at_s", _SECOND),
    "until_s": ("until_s", _SECOND),
}
_VEHICLE: dict[str, tuple[str, Convert]] = {"vehicle": ("vehicle", whole(1, LARGEST_SYSTEM))}
_RADAR: dict[str, tuple[str, Convert]] = {"radar": ("radar", whole(1, 65535))}


def _of_gps(*required: str, **sizes: tuple[str, Convert]) -> Table:
    return Table({**_WHEN, **_VEHICLE, **sizes}, required=("kind", "at_s", *required))


def _of_radar(*required: str, **sizes: tuple[str, Convert]) -> Table:
    return Table({**_WHEN, **_RADAR, **sizes}, required=("kind", "at_s", *required))


def _of_link(*required: str, **sizes: tuple[str, Convert]) -> Table:
    return Table({**_WHEN, **_VEHICLE, **_RADAR, **sizes}, required=("kind", "at_s", *required))


class FaultKind(NamedTuple):
    """A kind of fault: how it is made, its keys, and those of which it needs one at least."""

    make: type[Fault]
    table: Table
    some_of: tuple[str, ...] = ()


FAULTS: Mapping[str, FaultKind] = {
    "gps lost": FaultKind(faults.GpsLost, _of_gps(shows=("shows", text("no fix", "silence")))),
    "gps frozen": FaultKind(faults.GpsFrozen, _of_gps()),
    "gps spoofed": FaultKind(
        faults.GpsSpoofed,
        _of_gps(
            step_m=("step_m", _METRES),
            walks_mps=("walks_mps", _SPEED),
            direction_deg=("compass_rad", _COMPASS),
            step_up_m=("step_up_m", _METRES),
            climbs_mps=("climbs_mps", number(-1000.0, 1000.0)),
        ),
        some_of=("step_m", "walks_mps", "step_up_m", "climbs_mps"),
    ),
    "gps noise": FaultKind(faults.GpsNoise, _of_gps("sigma_m", sigma_m=("sigma_m", number(0.0, 1e5)))),
    "gps velocity": FaultKind(faults.GpsVelocity, _of_gps("times", times=("times", number(-1e4, 1e4)))),
    "radar off": FaultKind(faults.RadarOff, _of_radar()),
    "radar component lost": FaultKind(
        faults.RadarComponentLost, _of_radar("component", component=("components", _components))
    ),
    "radar error": FaultKind(
        faults.RadarError,
        _of_radar(
            range_error_m=("range_error_m", _METRES),
            azimuth_error_deg=("azimuth_error_rad", number(-180.0, 180.0, scale=_RAD)),
            elevation_error_deg=("elevation_error_rad", number(-90.0, 90.0, scale=_RAD)),
        ),
        some_of=("range_error_m", "azimuth_error_deg", "elevation_error_deg"),
    ),
    "radar moved": FaultKind(
        faults.RadarMoved,
        _of_radar(
            along_m=("along_m", _METRES),
            left_m=("left_m", _METRES),
            up_m=("up_m", _METRES),
            turned_deg=("turned_rad", _COMPASS),
            status=("status", text("stale", "new")),
        ),
        some_of=("along_m", "left_m", "up_m", "turned_deg"),
    ),
    "clock jump": FaultKind(faults.ClockJump, _of_link("by_s", by_s=("by_s", number(-1e9, 1e9)))),
    "link cut": FaultKind(faults.LinkCut, _of_link()),
    "link lossy": FaultKind(faults.LinkLossy, _of_link("share", share=("share", _SHARE))),
    "link late": FaultKind(
        faults.LinkLate, _of_link(by_s=("by_s", _SECOND), spread_s=("spread_s", _SECOND)), some_of=("by_s", "spread_s")
    ),
    "link doubled": FaultKind(
        faults.LinkDoubled, _of_link("share", share=("share", _SHARE), after_s=("after_s", _SECOND))
    ),
}
