"""A scene file's text read, table by table; what is wrong in it is said in one sentence with its line."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from adapters.reasons import reason_of
from gateway.settings import Site, SiteError
from gateway.settings.instants import instant_ns
from gateway.settings.reading import check_tables, hint, line_of, parse_site, read_row, read_site, read_table, read_toml
from sim.faults import Fault
from sim.parameter_tables import GPS, IMU, RADAR, SAY, with_fields
from sim.scenes.schemes import SCHEMES
from sim.scenes.script import Script, Vehicle, Waypoint
from sim.scenes.tables import DRAWN, FAULTS, SCENE, SEA, VEHICLE, WAYPOINT, WIND
from sim.scenes.ways import WORDS
from sim.sensors import GpsParameters
from sim.vehicles.wind import WindParameters

_TABLES = ("scene", "site", "gps", "imu", "wind", "sea", "say", "radar", "vehicle", "fault", *SCHEMES)


def read_scene(path: Path) -> Script:
    """The scene of a file. Raises SiteError."""
    try:
        content = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError(f"{path} cannot be read ({reason_of(error)}).") from error
    return parse_scene(content, str(path), path.parent, path.stem)


def parse_scene(text: str, origin: str, folder: Path, name: str) -> Script:
    """The scene that a TOML text describes; files that it names are looked for in `folder`, `name` is its usual name.

    Raises SiteError: one sentence with the origin and the line.
    """
    document = read_toml(text, origin)
    check_tables(document, _TABLES, text, origin)
    if "scene" not in document:
        raise SiteError(f"{origin}: the table [scene] is missing; it needs {', '.join(SCENE.required)}.")

    def rows(table: str, shape: Any) -> list[dict[str, Any]]:
        return read_table(document, table, shape, text, origin)

    said = rows("scene", SCENE)[0]
    site_file, start = said.pop("site", None), said.pop("start", None)
    schemes = [one for one in SCHEMES if one in document]
    if len(schemes) > 1:
        raise SiteError(f"{origin}: [{schemes[0]}] and [{schemes[1]}] cannot be in one scene; choose one.")
    written = rows("vehicle", VEHICLE)
    own_gps = [sum("gps" in row for row in written[:index]) for index in range(len(written))]
    vehicles = tuple(_vehicle(row, index, own_gps[index], text, origin, folder) for index, row in enumerate(written))
    _check_systems(vehicles, origin)
    gps = _checked_gps((rows("gps", GPS) or [{}])[0], f"{origin}{line_of(text, '', 'gps')}")
    return Script(
        **{"name": name, **said},
        origin=origin,
        text=text,
        start_ns=None if start is None else instant_ns(start),
        site=_site(document, site_file, text, origin, folder),
        gps=gps,
        imu=(rows("imu", IMU) or [{}])[0],
        wind=WindParameters(**(rows("wind", WIND) or [{}])[0]),
        current_mps=_current((rows("sea", SEA) or [{}])[0]),
        say=(rows("say", SAY) or [{}])[0],
        radars=tuple(rows("radar", RADAR)),
        vehicles=vehicles,
        drawn=(schemes[0], rows(schemes[0], DRAWN)[0]["aircraft"]) if schemes else None,
        faults=_faults(document, text, origin),
    )


def _current(sea: Mapping[str, float]) -> tuple[float, float]:
    """Of the water, east and north, m/s."""
    speed, to = sea.get("speed_mps", 0.0), sea.get("to_rad", 0.0)
    return speed * math.sin(to), speed * math.cos(to)


def _site(document: Mapping[str, Any], file: str | None, text: str, origin: str, folder: Path) -> Site | None:
    if file is None:
        inside = document.get("site")
        if inside is None:
            return None
        if not isinstance(inside, dict):
            raise SiteError(f"{origin}{line_of(text, 'site')}: write site as tables, [site.runway] and so on.")
        return read_site(inside, text, origin, "site.")
    where = f"{origin}{line_of(text, 'site', 'scene')}"
    if "site" in document:
        raise SiteError(f"{where}: site is a file here, and there are tables [site...] too; keep one of them.")
    path = folder / file
    try:
        return parse_site(path.read_text("utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError(f"{where}: the site file {path} cannot be read.") from error


def _vehicle(row: dict[str, Any], index: int, own_gps: int, text: str, origin: str, folder: Path) -> Vehicle:
    """One vehicle; its own position source, if it has one, is the how-many-th of the file."""
    where = f"{origin}{line_of(text, 'route', 'vehicle', index)}"
    route = row["route"]
    if isinstance(route, list):
        row["route"] = tuple(
            _waypoint(point, f"{origin}{_line_of_point(text, index, at)}: point {at + 1}")
            for at, point in enumerate(route)
        )
    elif route not in WORDS:
        row["route"] = folder / route
        if not row["route"].is_file():
            raise SiteError(f"{where}: route {route!r} is no file in {folder}, and no word{hint(route, list(WORDS))}.")
    if row.get("autopilot") and not isinstance(row["route"], Path):
        raise SiteError(f'{where}: an autopilot flies a mission file; route names one, such as "round.plan".')
    if "gps" in row:

        def inside(key: str) -> str:
            here = line_of(text, key, "vehicle.gps", own_gps)
            return f"{origin}{here or line_of(text, 'gps' if key else '', 'vehicle', index)}"

        row["gps"] = _checked_gps(read_row(row["gps"], GPS, "[vehicle.gps]", inside), inside(""))
    return Vehicle(**row)


def _checked_gps(said: dict[str, Any], where: str) -> dict[str, Any]:
    try:
        with_fields(GpsParameters(), said)
    except ValueError as error:
        raise SiteError(f"{where}: {error}.") from error
    return said


def _waypoint(point: dict[str, Any], where: str) -> Waypoint:
    read = Waypoint(**read_row(point, WAYPOINT, "a point", lambda _: where))
    on_plan = [part is not None for part in (read.along_m, read.left_m)]
    on_earth = [part is not None for part in (read.latitude_rad, read.longitude_rad)]
    if not (all(on_plan) and not any(on_earth)) and not (all(on_earth) and not any(on_plan)):
        raise SiteError(f"{where}: a point needs along_m and left_m, or latitude_deg and longitude_deg.")
    if read.height_m is not None and read.altitude_msl_m is not None:
        raise SiteError(f"{where}: a point has height_m (above the runway) or altitude_msl_m, not both.")
    return read


def _check_systems(vehicles: tuple[Vehicle, ...], origin: str) -> None:
    numbers = [one.system for one in vehicles if one.system is not None]
    twice = next((number for number in numbers if numbers.count(number) > 1), None)
    if twice is not None:
        raise SiteError(f"{origin}: two [[vehicle]] tables have the system {twice}; give each its own.")


def _faults(document: Mapping[str, Any], text: str, origin: str) -> tuple[Fault, ...]:
    tables = document.get("fault", [])
    if not isinstance(tables, list) or not all(isinstance(row, dict) for row in tables):
        raise SiteError(f"{origin}{line_of(text, 'fault')}: write fault as a table, [[fault]].")
    return tuple(_fault(row, index, text, origin) for index, row in enumerate(tables))


def _fault(row: Mapping[str, Any], index: int, text: str, origin: str) -> Fault:
    def where(key: str) -> str:
        return f"{origin}{line_of(text, key, 'fault', index)}"

    kind = row.get("kind")
    if not isinstance(kind, str) or kind not in FAULTS:
        wrong = "[[fault]] lacks kind" if kind is None else f"unknown kind {kind!r}"
        raise SiteError(f"{where('kind' if 'kind' in row else '')}: {wrong}{hint(str(kind), list(FAULTS))}.")
    known = FAULTS[kind]
    read = read_row(row, known.table, f'[[fault]] of kind "{kind}"', where)
    del read["kind"]
    if known.some_of and not any(key in row for key in known.some_of):
        raise SiteError(f"{where('')}: {kind!r} needs at least one of {', '.join(known.some_of)}.")
    fault = known.make(**read)
    if fault.until_s <= fault.at_s:
        raise SiteError(f"{where('until_s')}: until_s must be later than at_s.")
    return fault


def _line_of_point(text: str, vehicle: int, point: int) -> str:
    """', line N' of a point, counted from 0, of a vehicle's route."""
    said = line_of(text, "route", "vehicle", vehicle)
    first = int(said.rpartition(" ")[2]) if said else 0
    opened = 0
    for number, line in enumerate(text.splitlines()[first - 1 :] if first else [], first):
        opened += line.partition("#")[0].count("{")
        if opened > point:
            return f", line {number}"
    return said
