"""The site file: where the runway and the radars stand and what the sources are worth; and the options of a run.

A site file is TOML with the unit in every key's name; inside, everything is SI and radians. `SiteError` says in one
sentence what is wrong, in which line, and what to do.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

Weighting = Literal["bias", "covariance", "innovation", "literal"]
AssociationRule = Literal["default", "literal"]
Units = Literal["si", "aviation"]


class SiteError(ValueError):
    """A site file that cannot be used; the message is one plain sentence for the person who wrote it."""


@dataclass(frozen=True, slots=True)
class Runway:
    """The runway: its centre is the origin of the ENU and runway frames.

    `threshold_x_m` (negative) and `glide_path_origin_x_m` follow from the length, the glide path and the crossing height.
    """

    latitude_rad: float
    longitude_rad: float
    height_m: float
    landing_compass_rad: float
    geoid_separation_m: float | None = None
    length_m: float = 3000.0
    width_m: float = 45.0
    glide_path_rad: float = math.radians(3.0)
    threshold_crossing_height_m: float = 15.0

    @property
    def threshold_x_m(self) -> float:
        """Runway-frame x of the landing threshold."""
        return -0.5 * self.length_m

    @property
    def aiming_point_x_m(self) -> float:
        """Runway-frame x where the glide path meets the runway."""
        return self.threshold_x_m + self.threshold_crossing_height_m / math.tan(self.glide_path_rad)


@dataclass(frozen=True, slots=True)
class PositionSource:
    """What a position source is worth when its stream does not say: noise an axis, and allowed constant error."""

    sigma_m: float = 15.0
    systematic_m: float = 60.0
    velocity_sigma_mps: float = 1.0


@dataclass(frozen=True, slots=True)
class RadarSite:
    """One radar's place in the runway frame and the noise of its measurements."""

    number: int
    along_m: float
    left_m: float
    antenna_height_m: float
    compass_boresight_rad: float
    range_sigma_m: float = 15.0
    azimuth_sigma_rad: float = math.radians(0.0573)
    elevation_sigma_rad: float = math.radians(0.0573)
    maximum_range_m: float = 60000.0
    key_file: str | None = None


@dataclass(frozen=True, slots=True)
class DecisionPoint:
    """A named point on the approach, before the threshold."""

    name: str
    distance_m: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A published point, a candidate of intent."""

    name: str
    latitude_rad: float
    longitude_rad: float


@dataclass(frozen=True, slots=True)
class Weather:
    """An area to avoid: a circle about a point, or a polygon; between two times where they are given (ISO 8601, UTC)."""

    name: str
    latitude_rad: float | None = None
    longitude_rad: float | None = None
    radius_m: float | None = None
    polygon_rad: tuple[tuple[float, float], ...] = ()
    valid_from: str | None = None
    valid_until: str | None = None


@dataclass(frozen=True, slots=True)
class Site:
    """Everything that is known of the place before the first byte arrives."""

    name: str
    runway: Runway
    position: PositionSource = PositionSource()
    radars: tuple[RadarSite, ...] = ()
    decision_points: tuple[DecisionPoint, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    weather: tuple[Weather, ...] = ()
    units: Units = "si"

    def radar(self, number: int) -> RadarSite | None:
        """The radar of this number, or None."""
        return next((radar for radar in self.radars if radar.number == number), None)


@dataclass(frozen=True, slots=True)
class Options:
    """What may be chosen for a run; everything in here changes numbers, so all of it is archived."""

    weighting: Weighting = "bias"
    association: AssociationRule = "default"
    acceleration_sigma_mps2: float = 2.0  # of the constant-velocity model, east and north
    vertical_acceleration_sigma_mps2: float = 1.0  # aircraft change their climb less than their course
    acceleration_time_s: float = 0.4  # white over this time: sigma^2 x time is the density, whatever the step
    associate_at: int = 3  # hits in a row before a radar track and an aircraft are one
    association_wait_s: float = 1.0  # how long after a GPS report's validity plots may still bracket it
    history_s: float = 10.0  # later than this is too late
    coast_after_s: float = 2.0  # without an update for this long a track is coasting
    end_after_s: float = 30.0  # and for this long it ends
    prediction_period_s: float = 1.0
    horizons_s: tuple[float, ...] = (10.0, 30.0, 60.0)


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
            "key_file": ("key_file", _text()),
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
        radars=radars,
        decision_points=tuple(DecisionPoint(**row) for row in rows("decision_point")),
        waypoints=tuple(Waypoint(**row) for row in rows("waypoint")),
        weather=tuple(_weather(row, name) for row in rows("weather")),
        units=(rows("display") or [{}])[0].get("units", "si"),
    )


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
    stem = re.sub(r"_(deg|rad|m|km|ft|nm|mps|kn)$", "", key)
    same = [name for name in known if re.sub(r"_(deg|rad|m|mps)$", "", name) == stem]
    if same:
        return f"; it is {same[0]} here (the unit is part of the name)"
    from difflib import get_close_matches

    near = get_close_matches(key, known, n=1)
    return f"; did you mean {near[0]}?" if near else f"; known are {', '.join(known)}"


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


_DEG = 180.0 / math.pi


def format_site(site: Site) -> str:
    """The TOML text of a site; parsing it again gives the same site to the digits written.

    Angles are written to 1e-9 degrees (0.1 mm on the ground), lengths to 0.1 mm.
    """
    runway = site.runway
    lines = [
        f'name = "{_escaped(site.name)}"',
        "",
        "[display]",
        f'units = "{site.units}"                # or "aviation"',
        "",
        "[runway]",
    ]
    lines += [
        f"latitude_deg = {runway.latitude_rad * _DEG:.9f}          # centre",
        f"longitude_deg = {runway.longitude_rad * _DEG:.9f}",
        f"height_m = {runway.height_m:.4f}              # above the ellipsoid",
    ]
    if runway.geoid_separation_m is not None:
        lines.append(f"geoid_separation_m = {runway.geoid_separation_m:.4f}   # height_m = altitude_msl_m + this")
    lines += [
        f"landing_direction_deg = {runway.landing_compass_rad * _DEG:.6f} # true, main landing direction",
        f"length_m = {runway.length_m:.1f}",
        f"width_m = {runway.width_m:.1f}",
        f"glide_path_deg = {runway.glide_path_rad * _DEG:.4f}",
        f"threshold_crossing_height_m = {runway.threshold_crossing_height_m:.2f}",
        "",
        "[position]                   # what a position source is worth when its stream does not say",
        f"sigma_m = {site.position.sigma_m:g}",
        f"systematic_m = {site.position.systematic_m:g}          # allowed constant error",
        f"velocity_sigma_mps = {site.position.velocity_sigma_mps:g}",
    ]
    for radar in site.radars:
        lines += [
            "",
            "[[radar]]",
            f"number = {radar.number}",
            f"along_m = {radar.along_m:.4f}              # antenna in the runway frame: x",
        ]
        lines += [
            f"left_m = {radar.left_m:.4f}               # y",
            f"antenna_height_m = {radar.antenna_height_m:.4f}     # z, above the runway plane",
        ]
        lines += [
            f"boresight_deg = {radar.compass_boresight_rad * _DEG % 360.0:.6f}",
            f"range_sigma_m = {radar.range_sigma_m:g}",
        ]
        lines += [
            f"azimuth_sigma_deg = {radar.azimuth_sigma_rad * _DEG:.6g}",
            f"elevation_sigma_deg = {radar.elevation_sigma_rad * _DEG:.6g}",
        ]
        lines += [f"maximum_range_m = {radar.maximum_range_m:g}"]
        if radar.key_file:
            lines.append(f'key_file = "{_escaped(radar.key_file)}"')
    for point in site.decision_points:
        lines += ["", "[[decision_point]]", f'name = "{_escaped(point.name)}"', f"distance_m = {point.distance_m:g}"]
    for waypoint in site.waypoints:
        lines += ["", "[[waypoint]]", f'name = "{_escaped(waypoint.name)}"']
        lines += [
            f"latitude_deg = {waypoint.latitude_rad * _DEG:.9f}",
            f"longitude_deg = {waypoint.longitude_rad * _DEG:.9f}",
        ]
    for area in site.weather:
        lines += ["", "[[weather]]", f'name = "{_escaped(area.name)}"']
        if area.latitude_rad is not None and area.longitude_rad is not None:
            lines += [
                f"latitude_deg = {area.latitude_rad * _DEG:.9f}",
                f"longitude_deg = {area.longitude_rad * _DEG:.9f}",
            ]
            lines += [f"radius_m = {area.radius_m:g}"]
        else:
            corners = ", ".join(
                f"[{latitude * _DEG:.9f}, {longitude * _DEG:.9f}]" for latitude, longitude in area.polygon_rad
            )
            lines += [f"polygon_deg = [{corners}]"]
        lines += [
            f'{key} = "{value}"' for key, value in (("from", area.valid_from), ("until", area.valid_until)) if value
        ]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """As the inside of a TOML basic string, control characters included."""
    return json.dumps(text, ensure_ascii=False)[1:-1].replace("\x7f", "\\u007f")


def with_radar(site: Site, radar: RadarSite) -> Site:
    """The same site with this radar added, or in place of the one of its number."""
    others = tuple(known for known in site.radars if known.number != radar.number)
    return replace(site, radars=(*others, radar))


DEMO_SITE = Site(
    name="Demo field",
    runway=Runway(
        latitude_rad=math.radians(31.0),
        longitude_rad=math.radians(104.0),
        height_m=500.0,
        landing_compass_rad=math.radians(90.0),
        geoid_separation_m=-35.0,
    ),
    radars=(
        RadarSite(
            number=1, along_m=300.0, left_m=150.0, antenna_height_m=3.0, compass_boresight_rad=math.radians(270.0)
        ),
    ),
    decision_points=(DecisionPoint("DA", 1500.0),),
)
