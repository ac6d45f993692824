"""A site file's text read, table by table; what is wrong in it is said in one sentence with its line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
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
    return read_site(read_toml(text, name), text, name)


def read_site(document: Mapping[str, Any], text: str, name: str, within: str = "") -> Site:
    """The site of a document that was read from a text; its tables are called `within` and their own names there.

    Raises SiteError.
    """
    check_tables(document, ("name", *TABLES), text, name, within)
    title = document.get("name", "unnamed site")
    if not isinstance(title, str):
        raise SiteError(
            f"{name}{line_of(text, 'name', within[:-1] or None)}: name must be a text in quotes, not {title!r}."
        )
    if "runway" not in document:
        needs = ", ".join(TABLES["runway"].required)
        raise SiteError(f"{name}: the table [{within}runway] is missing; it needs {needs}.")

    def rows(table: str) -> list[dict[str, Any]]:
        return read_table(document, table, TABLES[table], text, name, within)

    runway = Runway(**rows("runway")[0])
    against = runway.landing_compass_rad + math.pi
    radars = tuple(RadarSite(**{"compass_boresight_rad": against, **row}) for row in rows("radar"))
    if runway.follows is not None and radars:
        raise SiteError(
            f"{name}: [{within}runway] follows a ship, and [[{within}radar]] stands in its frame: radars on a deck "
            "that moves are not understood; leave one of the two out."
        )
    numbers = [radar.number for radar in radars]
    if len(set(numbers)) != len(numbers):
        twice = next(number for number in numbers if numbers.count(number) > 1)
        raise SiteError(f"{name}: two [[{within}radar]] tables have the number {twice}; give each its own.")
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
        weather=read_weather(document, text, name, within),
        units=(rows("display") or [{}])[0].get("units", "si"),
    )


def check_tables(document: Mapping[str, Any], known: Iterable[str], text: str, name: str, within: str = "") -> None:
    """Raises SiteError for a table, or a key outside of all tables, that is not known."""
    for key in document:
        if key not in known:
            where = f"{name}{line_of(text, f'{within}{key}')}"
            raise SiteError(f"{where}: unknown {_kind(document[key])} {f'{within}{key}'!r}{hint(key, list(known))}.")


def read_weather(document: Mapping[str, Any], text: str, name: str, within: str = "") -> tuple[Weather, ...]:
    """The areas of a document that was read from a text. Raises SiteError."""
    rows = read_table(document, "weather", TABLES["weather"], text, name, within)
    return tuple(_weather(row, name) for row in rows)


def _weather(row: dict[str, Any], name: str) -> Weather:
    circle = all(key in row for key in ("latitude_rad", "longitude_rad", "radius_m"))
    if circle == bool(row.get("polygon_rad")):
        raise SiteError(
            f"{name}: [[weather]] {row['name']!r} needs latitude_deg, longitude_deg and radius_m, or polygon_deg, not both."
        )
    return Weather(**row)


def read_table(
    document: Mapping[str, Any], table: str, shape: Table, text: str, name: str, within: str = ""
) -> list[dict[str, Any]]:
    """Every occurrence of one table with its keys checked and converted to the dataclass's fields. Raises SiteError."""
    full = f"{within}{table}"
    label = f"[[{full}]]" if shape.many else f"[{full}]"
    content = document.get(table, [] if shape.many else None)
    if content is None:
        return []
    if isinstance(content, list) != shape.many or not all(
        isinstance(row, dict) for row in (content if shape.many else [content])
    ):
        raise SiteError(f"{name}{line_of(text, full)}: write {full} as a table, {label}.")

    def read(index: int, row: Mapping[str, Any]) -> dict[str, Any]:
        return read_row(row, shape, label, lambda key: f"{name}{line_of(text, key, full, index)}")

    return [read(index, row) for index, row in enumerate(content if shape.many else [content])]


def read_row(row: Mapping[str, Any], shape: Table, label: str, where: Callable[[str], str]) -> dict[str, Any]:
    """One table's keys checked and converted; `where` says the place of a key ("": of the table). Raises SiteError."""
    fields: dict[str, Any] = {}
    for key, value in row.items():
        if key not in shape.keys:
            raise SiteError(f"{where(key)}: unknown key {key!r} in {label}{hint(key, list(shape.keys))}.")
        field_name, convert = shape.keys[key]
        try:
            fields[field_name] = convert(value)
        except ValueError as error:
            raise SiteError(f"{where(key)}: {key} {error}.") from error
    missing = [key for key in shape.required if key not in row]
    if missing:
        raise SiteError(f"{where('')}: {label} lacks {' and '.join(missing)}.")
    return fields


def _kind(value: object) -> str:
    return "table" if isinstance(value, dict | list) else "key"


def hint(key: str, known: list[str]) -> str:
    """What the writer may have meant: the same quantity in another unit, or a near spelling."""
    stem = re.sub(r"_(deg|rad|m|km|ft|nm|mps|kn|mps2|degps|g|s|ms)$", "", key)
    same = [name for name in known if re.sub(r"_(deg|rad|m|mps|mps2|degps|s|ms)$", "", name) == stem]
    if same:
        return f"; it is {same[0]} here (the unit is part of the name)"
    from difflib import get_close_matches

    near = get_close_matches(key, known, n=1)
    return f"; perhaps {near[0]} is meant" if near else f"; known are {', '.join(known)}"


def line_of(text: str, key: str, table: str | None = None, index: int = 0) -> str:
    """', line N' of a key (or, with an empty key, of the table's own header), '' where it cannot be found."""
    current: str | None = None
    seen: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        header = re.match(r"\s*\[\[?\s*([\w.-]+)\s*\]\]?", line)
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
