"""A site file's text read, table by table; what is wrong in it is said in one sentence with its line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from gateway.settings.safety import Separation, Stabilised
from gateway.settings.site import (
    DeadReckoning,
    DecisionPoint,
    Estimation,
    PositionSource,
    RadarSite,
    Runway,
    Site,
    Waypoint,
    Weather,
)
from gateway.settings.tables import TABLES, Table


class SiteError(ValueError):
    """A site file that cannot be used; the message is one plain sentence for the person who wrote it."""


def read_toml(text: str, name: str) -> dict[str, Any]:
    """The document that a TOML text is. Raises SiteError."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SiteError(f"{name}: not TOML: {error}.") from error
    except (ValueError, RecursionError) as error:  # thousands of digits, or of brackets
        raise SiteError(f"{name}: not TOML that anybody would write: {error}.") from error


def parse_site(text: str, name: str = "site file") -> Site:
    """The site that a TOML text describes.

    Raises SiteError: one sentence with the file's name and the line.
    """
    document = read_toml(text, name)
    for key in document:
        if key != "name" and key not in TABLES:
            raise SiteError(
                f"{name}{_line_of(text, key)}: unknown {_kind(document[key])} {key!r}{_hint(key, ['name', *TABLES])}."
            )
    title = document.get("name", "unnamed site")
    if not isinstance(title, str):
        raise SiteError(f"{name}{_line_of(text, 'name')}: name must be a text in quotes, not {title!r}.")
    if "runway" not in document:
        raise SiteError(f"{name}: the table [runway] is missing; it needs {', '.join(TABLES['runway'].required)}.")

    def rows(table: str) -> list[dict[str, Any]]:
        return read_table(document, table, TABLES[table], text, name)

    runway = Runway(**rows("runway")[0])
    against = runway.landing_compass_rad + math.pi
    radars = tuple(RadarSite(**{"compass_boresight_rad": against, **row}) for row in rows("radar"))
    numbers = [radar.number for radar in radars]
    if len(set(numbers)) != len(numbers):
        twice = next(number for number in numbers if numbers.count(number) > 1)
        raise SiteError(f"{name}: two [[radar]] tables have the number {twice}; give each its own.")
    return Site(
        name=title,
        runway=runway,
        position=PositionSource(**(rows("position") or [{}])[0]),
        estimation=Estimation(**(rows("estimation") or [{}])[0]),
        dead_reckoning=DeadReckoning(**(rows("dead_reckoning") or [{}])[0]),
        separation=Separation(**(rows("separation") or [{}])[0]),
        stabilised=Stabilised(**(rows("stabilised") or [{}])[0]),
        radars=radars,
        decision_points=tuple(DecisionPoint(**row) for row in rows("decision_point")),
        waypoints=tuple(Waypoint(**row) for row in rows("waypoint")),
        weather=read_weather(document, text, name),
        units=(rows("display") or [{}])[0].get("units", "si"),
    )


def read_weather(document: Mapping[str, Any], text: str, name: str) -> tuple[Weather, ...]:
    """The areas of a document that was read from a text. Raises SiteError."""
    return tuple(_weather(row, name) for row in read_table(document, "weather", TABLES["weather"], text, name))


def _weather(row: dict[str, Any], name: str) -> Weather:
    circle = all(key in row for key in ("latitude_rad", "longitude_rad", "radius_m"))
    if circle == bool(row.get("polygon_rad")):
        raise SiteError(
            f"{name}: [[weather]] {row['name']!r} needs latitude_deg, longitude_deg and radius_m, or polygon_deg, not both."
        )
    return Weather(**row)


def read_table(document: Mapping[str, Any], table: str, shape: Table, text: str, name: str) -> list[dict[str, Any]]:
    """Every occurrence of one table with its keys checked and converted to the dataclass's fields. Raises SiteError."""
    label = f"[[{table}]]" if shape.many else f"[{table}]"
    content = document.get(table, [] if shape.many else None)
    if content is None:
        return []
    if isinstance(content, list) != shape.many or not all(
        isinstance(row, dict) for row in (content if shape.many else [content])
    ):
        raise SiteError(f"{name}{_line_of(text, table)}: write {table} as a table, {label}.")
    read: list[dict[str, Any]] = []
    for index, row in enumerate(content if shape.many else [content]):
        fields: dict[str, Any] = {}
        for key, value in row.items():
            where = f"{name}{_line_of(text, key, table, index)}"
            if key not in shape.keys:
                raise SiteError(f"{where}: unknown key {key!r} in {label}{_hint(key, list(shape.keys))}.")
            field_name, convert = shape.keys[key]
            try:
                fields[field_name] = convert(value)
            except ValueError as error:
                raise SiteError(f"{where}: {key} {error}.") from error
        missing = [key for key in shape.required if key not in row]
        if missing:
            raise SiteError(f"{name}{_line_of(text, '', table, index)}: {label} lacks {' and '.join(missing)}.")
        read.append(fields)
    return read


def _kind(value: object) -> str:
    return "table" if isinstance(value, dict | list) else "key"


def _hint(key: str, known: list[str]) -> str:
    """What the writer may have meant: the same quantity in another unit, or a near spelling."""
    stem = re.sub(r"_(deg|rad|m|km|ft|nm|mps|kn|mps2|degps|g|s|ms)$", "", key)
    same = [name for name in known if re.sub(r"_(deg|rad|m|mps|mps2|degps|s|ms)$", "", name) == stem]
    if same:
        return f"; it is {same[0]} here (the unit is part of the name)"
    from difflib import get_close_matches

    near = get_close_matches(key, known, n=1)
    return f"; perhaps {near[0]} is meant" if near else f"; known are {', '.join(known)}"


def _line_of(text: str, key: str, table: str | None = None, index: int = 0) -> str:
    """', line N' of a key (or, with an empty key, of the table's own header), '' where it cannot be found."""
    current: str | None = None
    seen: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[\[?\s*([\w-]+)\s*\]\]?", line)
        if header:
            current = header.group(1)
            seen[current] = seen.get(current, -1) + 1
            if (not key and current == table and seen[current] == index) or (table is None and key == current):
                return f", line {number}"
        elif key and re.match(rf"\s*\"?{re.escape(key)}\"?\s*=", line):
            if table is None and current is None:
                return f", line {number}"
            if current == table and table is not None and seen.get(table) == index:
                return f", line {number}"
    return ""
