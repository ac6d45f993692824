"""A site file's text read: degrees become radians, and what is wrong is said in one sentence with its line."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
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


class SiteError(ValueError):
    """A site file that cannot be used; the message is one plain sentence for the person who wrote it."""


Convert = Callable[[Any], Any]


def _number(low: float = -math.inf, high: float = math.inf, *, scale: float = 1.0) -> Convert:
    def convert(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"must be a number, not {value!r}")
        if not (low <= value <= high):  # also catches nan
            raise ValueError(f"must be between {low:g} and {high:g}, not {value!r}")
        return float(value) * scale

    return convert


def _whole(low: int, high: int) -> Convert:
    def convert(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not (low <= value <= high):
            raise ValueError(f"must be a whole number from {low} to {high}, not {value!r}")
        return value

    return convert


def _text(*allowed: str) -> Convert:
    def convert(value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise ValueError(f"must be a text in quotes, not {value!r}")
        if allowed and value not in allowed:
            raise ValueError(f"must be one of {', '.join(allowed)}, not {value!r}")
        return value

    return convert


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"must be true or false, not {value!r}")
    return value


def _polygon(value: Any) -> tuple[tuple[float, float], ...]:
    if (
        not isinstance(value, list)
        or len(value) < 3
        or not all(isinstance(corner, list) and len(corner) == 2 for corner in value)
    ):
        raise ValueError("must be a list of at least three [latitude, longitude] corners in degrees")
    return tuple((_LATITUDE(latitude), _LONGITUDE(longitude)) for latitude, longitude in value)


def _instant(value: Any) -> str:
    text = value if isinstance(value, str) else getattr(value, "isoformat", str)()
    if not re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d(\.\d+)?)?(Z|[+-]\d\d:\d\d)?", str(text)):
        raise ValueError(f"must be a time such as 2026-03-01T12:00:00Z, not {value!r}")
    return str(text)


_RAD = math.pi / 180.0
_FINITE = _number(-1e7, 1e7)
_POSITIVE = _number(1e-6, 1e7)
_LATITUDE = _number(-90.0, 90.0, scale=_RAD)
_LONGITUDE = _number(-180.0, 180.0, scale=_RAD)
_COMPASS = _number(-360.0, 360.0, scale=_RAD)


@dataclass(frozen=True, slots=True)
class _Table:
    """The keys of one table: name in the file -> (field of the dataclass, conversion)."""

    keys: Mapping[str, tuple[str, Convert]]
    required: tuple[str, ...] = ()
    many: bool = False


_TABLES: dict[str, _Table] = {
    "display": _Table({"units": ("units", _text("si", "aviation"))}),
    "runway": _Table(
        {
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
            "height_m": ("height_m", _number(-1000.0, 10000.0)),
            "geoid_separation_m": ("geoid_separation_m", _number(-150.0, 150.0)),
            "landing_direction_deg": ("landing_compass_rad", _COMPASS),
            "length_m": ("length_m", _POSITIVE),
            "width_m": ("width_m", _POSITIVE),
            "glide_path_deg": ("glide_path_rad", _number(0.5, 30.0, scale=_RAD)),
            "threshold_crossing_height_m": ("threshold_crossing_height_m", _number(0.0, 500.0)),
        },
        required=("latitude_deg", "longitude_deg", "height_m", "landing_direction_deg"),
    ),
    "position": _Table(
        {
            "sigma_m": ("sigma_m", _POSITIVE),
            "systematic_m": ("systematic_m", _number(0.0, 1e6)),
            "velocity_sigma_mps": ("velocity_sigma_mps", _POSITIVE),
        }
    ),
    "estimation": _Table(
        {
            "calm_acceleration_mps2": ("calm_acceleration_mps2", _number(1e-3, 100.0)),
            "calm_across_acceleration_mps2": ("calm_across_acceleration_mps2", _number(1e-3, 100.0)),
            "lasting_acceleration_mps2": ("lasting_acceleration_mps2", _number(1e-3, 100.0)),
            "lasting_across_acceleration_mps2": ("lasting_across_acceleration_mps2", _number(1e-3, 100.0)),
            "lasting_for_s": ("lasting_for_s", _number(0.1, 1e4)),
            "manoeuvre_acceleration_mps2": ("manoeuvre_acceleration_mps2", _number(1e-3, 100.0)),
            "manoeuvre_vertical_acceleration_mps2": ("manoeuvre_vertical_acceleration_mps2", _number(1e-3, 100.0)),
            "turn_acceleration_mps2": ("turn_acceleration_mps2", _number(1e-3, 100.0)),
            "turn_rate_degps": ("turn_rate_rps", _number(0.01, 360.0, scale=_RAD)),
            "bank_deg": ("bank_rad", _number(0.1, 85.0, scale=_RAD)),
            "calm_share": ("calm_share", _number(1e-3, 1e3)),
            "lasting_share": ("lasting_share", _number(1e-3, 1e3)),
            "manoeuvre_share": ("manoeuvre_share", _number(1e-3, 1e3)),
            "turn_share": ("turn_share", _number(1e-3, 1e3)),
            "mode_lasts_s": ("mode_lasts_s", _number(0.1, 1e4)),
        }
    ),
    "separation": _Table(
        {
            "horizontal_m": ("horizontal_m", _POSITIVE),
            "vertical_m": ("vertical_m", _POSITIVE),
            "look_ahead_s": ("look_ahead_s", _number(10.0, 3600.0)),
            "least_probability": ("least_probability", _number(0.0, 1.0)),
            "least_height_m": ("least_height_m", _number(-1e4, 1e4)),
        }
    ),
    "stabilised": _Table(
        {
            "upper_gate_m": ("upper_gate_m", _POSITIVE),
            "lower_gate_m": ("lower_gate_m", _POSITIVE),
            "approach_speed_mps": ("approach_speed_mps", _number(1.0, 1000.0)),
            "glide_path_deg": ("glide_path_rad", _number(0.01, 30.0, scale=_RAD)),
            "centreline_deg": ("centreline_rad", _number(0.01, 30.0, scale=_RAD)),
            "least_vertical_m": ("least_vertical_m", _number(0.0, 1e3)),
            "least_lateral_m": ("least_lateral_m", _number(0.0, 1e3)),
            "speed_share": ("speed_share", _number(0.01, 10.0)),
            "least_fast_mps": ("least_fast_mps", _number(0.0, 100.0)),
        }
    ),
    "dead_reckoning": _Table(
        {
            "gyro_noise_degps": ("gyro_noise", _number(1e-5, 10.0, scale=_RAD)),
            "gyro_bias_degps": ("gyro_bias_radps", _number(1e-5, 10.0, scale=_RAD)),
            "gyro_bias_wanders_degps": ("gyro_bias_wanders", _number(0.0, 1.0, scale=_RAD)),
            "accelerometer_noise_mps2": ("accelerometer_noise", _number(1e-5, 10.0)),
            "accelerometer_bias_mps2": ("accelerometer_bias_mps2", _number(1e-5, 10.0)),
            "accelerometer_bias_wanders_mps2": ("accelerometer_bias_wanders", _number(0.0, 1.0)),
            "attitude_sigma_deg": ("attitude_sigma_rad", _number(0.01, 45.0, scale=_RAD)),
            "attitude_wanders_deg": ("attitude_wanders", _number(0.0, 10.0, scale=_RAD)),
            "airspeed_sigma_mps": ("airspeed_sigma_mps", _number(0.01, 100.0)),
            "sideslip_sigma_mps": ("sideslip_sigma_mps", _number(0.01, 100.0)),
            "wind_mps": ("wind_mps", _number(0.1, 100.0)),
            "wind_wanders_mps": ("wind_wanders", _number(0.0, 10.0)),
            "slip_mps": ("slip_mps", _number(0.001, 10.0)),
            "altitude_sigma_m": ("altitude_sigma_m", _number(0.1, 1000.0)),
            "ends_at_sigma_m": ("ends_at_sigma_m", _number(1.0, 1e5)),
            "refuses": ("refuses", _flag),
        }
    ),
    "radar": _Table(
        {
            "number": ("number", _whole(1, 65535)),
            "along_m": ("along_m", _FINITE),
            "left_m": ("left_m", _FINITE),
            "antenna_height_m": ("antenna_height_m", _number(-1000.0, 1000.0)),
            "boresight_deg": ("compass_boresight_rad", _COMPASS),
            "range_sigma_m": ("range_sigma_m", _POSITIVE),
            "azimuth_sigma_deg": ("azimuth_sigma_rad", _number(1e-6, 45.0, scale=_RAD)),
            "elevation_sigma_deg": ("elevation_sigma_rad", _number(1e-6, 45.0, scale=_RAD)),
            "maximum_range_m": ("maximum_range_m", _POSITIVE),
            "range_error_m": ("range_error_m", _number(-1e4, 1e4)),
            "azimuth_error_deg": ("azimuth_error_rad", _number(-45.0, 45.0, scale=_RAD)),
            "elevation_error_deg": ("elevation_error_rad", _number(-45.0, 45.0, scale=_RAD)),
            "time_error_ms": ("time_error_s", _number(-10_000.0, 10_000.0, scale=1e-3)),
            "key_file": ("key_file", _text()),
            "numbers": ("numbers", _text("used", "ignored")),
            "period_s": ("period_s", _number(0.02, 60.0)),
            "clutter_per_scan": ("clutter_per_scan", _number(0.0, 1e5)),
            "detection_probability": ("detection_probability", _number(0.05, 0.999)),
            "slowest_mps": ("slowest_mps", _number(0.0, 300.0)),
            "hypotheses_at_most": ("hypotheses_at_most", _whole(10, 100_000)),
        },
        required=("number", "along_m", "left_m", "antenna_height_m"),
        many=True,
    ),
    "decision_point": _Table(
        {"name": ("name", _text()), "distance_m": ("distance_m", _number(0.0, 1e6))},
        required=("name", "distance_m"),
        many=True,
    ),
    "waypoint": _Table(
        {
            "name": ("name", _text()),
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
        },
        required=("name", "latitude_deg", "longitude_deg"),
        many=True,
    ),
    "weather": _Table(
        {
            "name": ("name", _text()),
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
            "radius_m": ("radius_m", _POSITIVE),
            "polygon_deg": ("polygon_rad", _polygon),
            "from": ("valid_from", _instant),
            "until": ("valid_until", _instant),
            "base_msl_m": ("base_msl_m", _number(-1e4, 1e5)),
            "top_msl_m": ("top_msl_m", _number(-1e4, 1e5)),
        },
        required=("name",),
        many=True,
    ),
}


def parse_site(text: str, name: str = "site file") -> Site:
    """The site that a TOML text describes.

    Raises SiteError: one sentence with the file's name and the line.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SiteError(f"{name}: not TOML: {error}.") from error
    except (ValueError, RecursionError) as error:  # thousands of digits, or of brackets
        raise SiteError(f"{name}: not TOML that anybody would write: {error}.") from error
    for key in document:
        if key != "name" and key not in _TABLES:
            raise SiteError(
                f"{name}{_line_of(text, key)}: unknown {_kind(document[key])} {key!r}{_hint(key, ['name', *_TABLES])}."
            )
    title = document.get("name", "unnamed site")
    if not isinstance(title, str):
        raise SiteError(f"{name}{_line_of(text, 'name')}: name must be a text in quotes, not {title!r}.")
    if "runway" not in document:
        raise SiteError(f"{name}: the table [runway] is missing; it needs {', '.join(_TABLES['runway'].required)}.")

    def rows(table: str) -> list[dict[str, Any]]:
        return _read_table(document, table, text, name)

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
    return tuple(_weather(row, name) for row in _read_table(document, "weather", text, name))


def _weather(row: dict[str, Any], name: str) -> Weather:
    circle = all(key in row for key in ("latitude_rad", "longitude_rad", "radius_m"))
    if circle == bool(row.get("polygon_rad")):
        raise SiteError(
            f"{name}: [[weather]] {row['name']!r} needs latitude_deg, longitude_deg and radius_m, or polygon_deg, not both."
        )
    return Weather(**row)


def _read_table(document: Mapping[str, Any], table: str, text: str, name: str) -> list[dict[str, Any]]:
    """Every occurrence of one table with its keys checked and converted to the dataclass's fields."""
    shape, label = _TABLES[table], f"[[{table}]]" if _TABLES[table].many else f"[{table}]"
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
