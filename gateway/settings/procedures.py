"""Published arrival procedures, read from TOML, with the runways that they lead to:

airport_altitude_m = 119.0      # above mean sea level; needed where a point has an altitude

[[runway]]                      # optional: tells parallel runways apart
name = "26L"
latitude_deg = 49.0246          # its threshold
longitude_deg = 2.5610
direction_deg = 265.0           # true, of landing

[[procedure]]
name = "EAST 1"
runway = "26L"                  # optional

[[procedure.point]]             # in the order in which they are flown
name = "ENTRY"
latitude_deg = 48.6
longitude_deg = 3.5
least_altitude_m = 4000.0       # optional; or least_altitude_ft
most_altitude_m = 6000.0
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gateway.settings.reading import SiteError, check_tables, line_of, read_row, read_table, read_toml
from gateway.settings.tables import FOOT_M, Table, number, text


@dataclass(frozen=True, slots=True)
class ProcedurePoint:
    """One published point, and between which altitudes above mean sea level it is passed; None = not said."""

    name: str
    latitude_deg: float
    longitude_deg: float
    least_altitude_m: float | None = None
    most_altitude_m: float | None = None


@dataclass(frozen=True, slots=True)
class PublishedProcedure:
    """A way that is published, from its entry on."""

    name: str
    points: tuple[ProcedurePoint, ...]
    runway: str | None = None


@dataclass(frozen=True, slots=True)
class PublishedRunway:
    """A runway's threshold, and the true direction of landing."""

    name: str
    latitude_deg: float
    longitude_deg: float
    direction_rad: float


@dataclass(frozen=True, slots=True)
class Published:
    """All that a file tells of an airport."""

    procedures: tuple[PublishedProcedure, ...] = ()
    runways: tuple[PublishedRunway, ...] = ()
    airport_altitude_m: float | None = None


_PLACE = {
    "name": ("name", text()),
    "latitude_deg": ("latitude_deg", number(-89.0, 89.0)),
    "longitude_deg": ("longitude_deg", number(-180.0, 180.0)),
}
_RUNWAY = Table(
    _PLACE | {"direction_deg": ("direction_rad", number(-360.0, 360.0, scale=math.pi / 180.0))},
    required=("name", "latitude_deg", "longitude_deg", "direction_deg"),
    many=True,
)
_PROCEDURE = Table(
    {"name": ("name", text()), "runway": ("runway", text()), "point": ("point", lambda rows: rows)},
    required=("name", "point"),
    many=True,
)
_POINT = Table(
    _PLACE
    | {
        f"{which}_altitude_{unit}": (f"{which}_altitude_m", number(-1000.0, 100_000.0, scale=scale))
        for which in ("least", "most")
        for unit, scale in (("m", 1.0), ("ft", FOOT_M))
    },
    required=("name", "latitude_deg", "longitude_deg"),
    many=True,
)


def parse_procedures(content: str, name: str) -> Published:
    """What a file publishes. Raises SiteError: one sentence with the file's name and the line."""
    document = read_toml(content, name)
    check_tables(document, ("airport_altitude_m", "runway", "procedure"), content, name)
    altitude_m = document.get("airport_altitude_m")
    if altitude_m is not None:
        try:
            altitude_m = float(number(-500.0, 6000.0)(altitude_m))
        except ValueError as error:
            where = line_of(content, "airport_altitude_m")
            raise SiteError(f"{name}{where}: airport_altitude_m {error}.") from error
    runways = tuple(PublishedRunway(**row) for row in read_table(document, "runway", _RUNWAY, content, name))
    procedures, before = [], 0
    for row in read_table(document, "procedure", _PROCEDURE, content, name):
        points = _points(row.pop("point"), row["name"], before, content, name)
        before += len(points)
        procedures.append(PublishedProcedure(points=points, **row))
    published = Published(tuple(procedures), runways, altitude_m)
    _check(published, name)
    return published


def _points(rows: Any, procedure: str, before: int, content: str, name: str) -> tuple[ProcedurePoint, ...]:
    """A procedure's points; `before` so many are in the file above them."""
    if not isinstance(rows, list) or not all(isinstance(row, Mapping) for row in rows) or len(rows) < 2:
        raise SiteError(f"{name}: {procedure} needs at least two points; write each as a table, [[procedure.point]].")

    def read(index: int, row: Mapping[str, Any]) -> dict[str, Any]:
        where = "procedure.point"
        return read_row(
            row, _POINT, f"[[{where}]]", lambda key: f"{name}{line_of(content, key, where, before + index)}"
        )

    return tuple(ProcedurePoint(**read(index, row)) for index, row in enumerate(rows))


def _check(published: Published, name: str) -> None:
    """Raises SiteError for what does not fit together."""
    known = {runway.name for runway in published.runways}
    for procedure in published.procedures:
        bounds = [
            point for point in procedure.points if (point.least_altitude_m, point.most_altitude_m) != (None, None)
        ]
        if bounds and published.airport_altitude_m is None:
            raise SiteError(f"{name}: {bounds[0].name} has an altitude, so airport_altitude_m is needed, at the top.")
        if procedure.runway is not None and known and procedure.runway not in known:
            raise SiteError(f"{name}: {procedure.name} leads to runway {procedure.runway!r}, which no [[runway]] is.")
    names = [procedure.name for procedure in published.procedures]
    twice = next((one for one in names if names.count(one) > 1), None)
    if twice is not None:
        raise SiteError(f"{name}: two [[procedure]] tables are called {twice!r}; give each its own name.")
