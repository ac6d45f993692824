"""A case from a file, TOML or JSON, in degrees or in local kilometres.

[route]
start_km = [1.0, 2.0]            # east, north of the origin; or start_deg = [latitude, longitude]; or start = "runway"
goal_km = [18.0, 18.0]           # likewise
via_km = [[5.0, 9.0]]            # or via_deg; points to be passed, optional
origin_deg = [31.0, 104.0]       # of local kilometres; default: the demo field
bounds_km = [[0.0, 0.0], [20.0, 20.0]]   # or bounds_deg; two corners, optional
altitude_msl_m = 535.0           # of home, optional

[[threat]]
east_km = 4.2                    # or latitude_deg, longitude_deg
north_km = 7.9
height_m = 40.0                  # above home; without it distances count on the level

[[area]]                         # to keep out of
name = "village"
east_km = 9.0                    # a circle, or polygon_km (polygon_deg) = [[...], ...]
north_km = 9.0
radius_m = 800.0
base_m = 0.0                     # above home, optional
top_m = 400.0
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.reasons import reason_of
from gateway.settings import SiteError
from gateway.settings.reading import check_tables, read_table, read_toml
from gateway.settings.tables import Convert, Table, number, text
from sim.planning.areas import Area
from sim.planning.case import DEMO_ORIGIN_DEG, Case, End, Plane

Floats = NDArray[np.float64]

_LATITUDE, _LONGITUDE, _KM = number(-89.0, 89.0), number(-180.0, 180.0), number(-1e3, 1e3)
_HEIGHT = number(-1e4, 1e5)
_LARGEST_BYTES = 4 << 20


def _pair(first: Convert, second: Convert, what: str) -> Convert:
    def convert(value: Any) -> tuple[float, float]:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"must be {what}, not {value!r}")
        return first(value[0]), second(value[1])

    return convert


def _several(one: Convert, least: int, most: int | None = None) -> Convert:
    def convert(value: Any) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) < least or (most is not None and len(value) > most):
            raise ValueError(f"must be a list of {'' if most == least else 'at least '}{least} places")
        return tuple(one(each) for each in value)

    return convert


_PLACE_KM = _pair(_KM, _KM, "[east, north] in km")
_PLACE_DEG = _pair(_LATITUDE, _LONGITUDE, "[latitude, longitude] in degrees")
_SPOT = {
    "name": ("name", text()),
    "latitude_deg": ("latitude_deg", _LATITUDE),
    "longitude_deg": ("longitude_deg", _LONGITUDE),
    "east_km": ("east_km", _KM),
    "north_km": ("north_km", _KM),
}
_TABLES = {
    "route": Table(
        {
            "name": ("name", text()),
            **{f"{end}": (end, text("runway")) for end in ("start", "goal")},
            **{f"{end}_km": (f"{end}_km", _PLACE_KM) for end in ("start", "goal")},
            **{f"{end}_deg": (f"{end}_deg", _PLACE_DEG) for end in ("start", "goal")},
            "via_km": ("via_km", _several(_PLACE_KM, 1)),
            "via_deg": ("via_deg", _several(_PLACE_DEG, 1)),
            "origin_deg": ("origin_deg", _PLACE_DEG),
            "bounds_km": ("bounds_km", _several(_PLACE_KM, 2, 2)),
            "bounds_deg": ("bounds_deg", _several(_PLACE_DEG, 2, 2)),
            "altitude_msl_m": ("altitude_msl_m", number(-500.0, 9000.0)),
        }
    ),
    "threat": Table(
        {
            **_SPOT,
            "height_m": ("height_m", _HEIGHT),
        },
        many=True,
    ),
    "area": Table(
        {
            **_SPOT,
            "radius_m": ("radius_m", number(1.0, 1e6)),
            "polygon_km": ("polygon_km", _several(_PLACE_KM, 3)),
            "polygon_deg": ("polygon_deg", _several(_PLACE_DEG, 3)),
            "base_m": ("base_m", _HEIGHT),
            "top_m": ("top_m", _HEIGHT),
        },
        many=True,
    ),
}


def read_case(path: Path) -> Case:
    """The case of a file. Raises SiteError, one sentence, for what is wrong in it."""
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise SiteError(f"{path} is too large to be a file of threats.")
        written = path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError(f"{path} cannot be read ({reason_of(error)}).") from error
    return parse_case(written, str(path), path.stem)


def parse_case(written: str, origin: str, name: str) -> Case:
    """The case that a text describes; `origin` is what the text is called, `name` its usual name. Raises SiteError."""
    document = _json(written, origin) if written.lstrip().startswith("{") else read_toml(written, origin)
    check_tables(document, _TABLES, written, origin)
    rows = {table: read_table(document, table, shape, written, origin) for table, shape in _TABLES.items()}
    route = rows["route"][0] if rows["route"] else {}
    said = _origin(route, [*rows["threat"], *rows["area"]])
    plane = Plane(*(said or DEMO_ORIGIN_DEG))
    threats = [_place(row, plane, f"{origin}: [[threat]] {number}") for number, row in enumerate(rows["threat"], 1)]
    bounds = _places(route, "bounds", plane)
    return Case(
        name=route.get("name", name),
        plane=plane,
        start=_end(route, "start", plane, origin),
        goal=_end(route, "goal", plane, origin),
        threat_m=np.array(threats, dtype=np.float64).reshape(-1, 2),
        threat_height_m=np.array([row.get("height_m", math.nan) for row in rows["threat"]], dtype=np.float64),
        areas=tuple(_area(row, plane, f"{origin}: [[area]] {number}") for number, row in enumerate(rows["area"], 1)),
        via_m=tuple(_places(route, "via", plane)),
        box_m=np.stack([bounds.min(axis=0), bounds.max(axis=0)]) if len(bounds) else None,
        altitude_msl_m=route.get("altitude_msl_m", 0.0),
        is_placed=said is not None,
    )


def _json(written: str, origin: str) -> Mapping[str, Any]:
    try:
        document = json.loads(written)
    except json.JSONDecodeError as error:
        raise SiteError(f"{origin}, line {error.lineno}: this is not JSON ({error.msg.lower()}).") from error
    except (ValueError, RecursionError) as error:
        raise SiteError(f"{origin}: not JSON that anybody would write.") from error
    return dict(document)


def _origin(route: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> tuple[float, float] | None:
    """Where the plane touches the earth: as said, else between the first two places in degrees."""
    if "origin_deg" in route:
        latitude, longitude = route["origin_deg"]
        return latitude, longitude
    said = [route[key] for key in ("start_deg", "goal_deg") if key in route]
    said += [one for key in ("via_deg", "bounds_deg") for one in route.get(key, ())]
    said += [
        (row["latitude_deg"], row["longitude_deg"]) for row in rows if {"latitude_deg", "longitude_deg"} <= set(row)
    ]
    said += [corner for row in rows for corner in row.get("polygon_deg", ())]
    if not said:
        return None
    first = np.array(said[:2])
    first[:, 1] = first[0, 1] + (first[:, 1] - first[0, 1] + 180.0) % 360.0 - 180.0
    latitude, longitude = first.mean(axis=0).tolist()
    return latitude, longitude


def _end(route: Mapping[str, Any], end: str, plane: Plane, origin: str) -> End:
    said = [key for key in (end, f"{end}_km", f"{end}_deg") if key in route]
    if len(said) > 1:
        raise SiteError(f"{origin}: [route] says {' and '.join(said)}; keep one of them.")
    places = _places({key: (value,) for key, value in route.items() if key in said}, end, plane)
    return places[0] if len(places) else "runway"


def _places(row: Mapping[str, Any], what: str, plane: Plane) -> Floats:
    """The places (n, 2) m that a row names in km and in degrees."""
    local = np.array(row.get(f"{what}_km", ()), dtype=np.float64).reshape(-1, 2) * 1e3
    return np.concatenate([local, plane.place_m(np.array(row.get(f"{what}_deg", ())).reshape(-1, 2))])


def _place(row: Mapping[str, Any], plane: Plane, where: str) -> Floats:
    local, earthly = {"east_km", "north_km"} & set(row), {"latitude_deg", "longitude_deg"} & set(row)
    if len(local) + len(earthly) != 2 or (local and earthly):
        raise SiteError(f"{where} needs east_km and north_km, or latitude_deg and longitude_deg.")
    if local:
        return np.array([row["east_km"], row["north_km"]]) * 1e3
    return plane.place_m([row["latitude_deg"], row["longitude_deg"]])


def _area(row: Mapping[str, Any], plane: Plane, where: str) -> Area:
    corners = _places(row, "polygon", plane)
    if ("radius_m" in row) == bool(len(corners)):
        raise SiteError(f"{where} needs a place and radius_m, or polygon_km or polygon_deg, not both.")
    base, top = row.get("base_m", -math.inf), row.get("top_m", math.inf)
    if base >= top:
        raise SiteError(f"{where}: base_m must be below top_m.")
    about = corners if len(corners) else _place(row, plane, where)[None]
    return Area(about, row.get("radius_m"), base, top, row.get("name", ""))
