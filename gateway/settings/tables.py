"""The tables of a site file: their keys, the field inside that each of them is, and which values it may have."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from gateway.settings.instants import instant_ns
from gateway.settings.site import encloses

Convert = Callable[[Any], Any]

FOOT_M = 0.3048


def number(low: float = -math.inf, high: float = math.inf, *, scale: float = 1.0) -> Convert:
    """A number between two bounds, times a scale."""

    def convert(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"must be a number, not {value!r}")
        if not (low <= value <= high):  # also catches nan
            raise ValueError(f"must be between {low:g} and {high:g}, not {value!r}")
        return float(value) * scale

    return convert


def whole(low: int, high: int) -> Convert:
    """A whole number between two bounds."""

    def convert(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not (low <= value <= high):
            raise ValueError(f"must be a whole number from {low} to {high}, not {value!r}")
        return value

    return convert


def text(*allowed: str) -> Convert:
    """A text in quotes, any or one of these."""

    def convert(value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise ValueError(f"must be a text in quotes, not {value!r}")
        if allowed and value not in allowed:
            raise ValueError(f"must be one of {', '.join(allowed)}, not {value!r}")
        return value

    return convert


def flag(value: Any) -> bool:
    """True or false."""
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
    corners = tuple((_LATITUDE(latitude), _LONGITUDE(longitude)) for latitude, longitude in value)
    if not encloses(corners):
        raise ValueError("must enclose an area, and its corners are at one place or on one line")
    return corners


def instant(value: Any) -> str:
    """A time, ISO 8601, UTC without a zone."""
    said = value if isinstance(value, str) else getattr(value, "isoformat", str)()
    if instant_ns(str(said)) is None:
        raise ValueError(f"must be a time such as 2026-03-01T12:00:00Z, not {value!r}")
    return str(said)


_RAD = math.pi / 180.0
_FINITE = number(-1e7, 1e7)
_POSITIVE = number(1e-6, 1e7)
_LATITUDE = number(-90.0, 90.0, scale=_RAD)
_LONGITUDE = number(-180.0, 180.0, scale=_RAD)
_COMPASS = number(-360.0, 360.0, scale=_RAD)


@dataclass(frozen=True, slots=True)
class Table:
    """The keys of one table: name in the file -> (field of the dataclass, conversion, which raises ValueError)."""

    keys: Mapping[str, tuple[str, Convert]]
    required: tuple[str, ...] = ()
    many: bool = False


TABLES: dict[str, Table] = {
    "display": Table({"units": ("units", text("si", "aviation"))}),
    "runway": Table(
        {
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
            "height_m": ("height_m", number(-1000.0, 10000.0)),
            "geoid_separation_m": ("geoid_separation_m", number(-150.0, 150.0)),
            "landing_direction_deg": ("landing_compass_rad", _COMPASS),
            "length_m": ("length_m", _POSITIVE),
            "width_m": ("width_m", _POSITIVE),
            "glide_path_deg": ("glide_path_rad", number(0.5, 30.0, scale=_RAD)),
            "threshold_crossing_height_m": ("threshold_crossing_height_m", number(0.0, 500.0)),
            "follows": ("follows", text()),
        },
        required=("latitude_deg", "longitude_deg", "height_m", "landing_direction_deg"),
    ),
    "position": Table(
        {
            "sigma_m": ("sigma_m", _POSITIVE),
            "systematic_m": ("systematic_m", number(0.0, 1e6)),
            "velocity_sigma_mps": ("velocity_sigma_mps", _POSITIVE),
        }
    ),
    "estimation": Table(
        {
            "calm_acceleration_mps2": ("calm_acceleration_mps2", number(1e-3, 100.0)),
            "calm_across_acceleration_mps2": ("calm_across_acceleration_mps2", number(1e-3, 100.0)),
            "lasting_acceleration_mps2": ("lasting_acceleration_mps2", number(1e-3, 100.0)),
            "lasting_drag_mps2": ("lasting_drag_mps2", number(0.0, 100.0)),
            "lasting_across_acceleration_mps2": ("lasting_across_acceleration_mps2", number(1e-3, 100.0)),
            "lasting_for_s": ("lasting_for_s", number(0.1, 1e4)),
            "manoeuvre_acceleration_mps2": ("manoeuvre_acceleration_mps2", number(1e-3, 100.0)),
            "manoeuvre_vertical_acceleration_mps2": ("manoeuvre_vertical_acceleration_mps2", number(1e-3, 100.0)),
            "turn_acceleration_mps2": ("turn_acceleration_mps2", number(1e-3, 100.0)),
            "turn_rate_degps": ("turn_rate_rps", number(0.01, 360.0, scale=_RAD)),
            "bank_deg": ("bank_rad", number(0.1, 85.0, scale=_RAD)),
            "calm_share": ("calm_share", number(1e-3, 1e3)),
            "lasting_share": ("lasting_share", number(1e-3, 1e3)),
            "manoeuvre_share": ("manoeuvre_share", number(1e-3, 1e3)),
            "turn_share": ("turn_share", number(1e-3, 1e3)),
            "mode_lasts_s": ("mode_lasts_s", number(0.1, 1e4)),
        }
    ),
    "separation": Table(
        {
            "horizontal_m": ("horizontal_m", _POSITIVE),
            "vertical_m": ("vertical_m", _POSITIVE),
            "look_ahead_s": ("look_ahead_s", number(10.0, 3600.0)),
            "least_probability": ("least_probability", number(0.0, 1.0)),
            "least_height_m": ("least_height_m", number(-1e4, 1e4)),
        }
    ),
    "stabilised": Table(
        {
            "upper_gate_m": ("upper_gate_m", _POSITIVE),
            "lower_gate_m": ("lower_gate_m", _POSITIVE),
            "approach_speed_mps": ("approach_speed_mps", number(1.0, 1000.0)),
            "glide_path_deg": ("glide_path_rad", number(0.01, 30.0, scale=_RAD)),
            "centreline_deg": ("centreline_rad", number(0.01, 30.0, scale=_RAD)),
            "least_vertical_m": ("least_vertical_m", number(0.0, 1e3)),
            "least_lateral_m": ("least_lateral_m", number(0.0, 1e3)),
            "speed_share": ("speed_share", number(0.01, 10.0)),
            "slow_share": ("slow_share", number(0.01, 1.0)),
            "least_fast_mps": ("least_fast_mps", number(0.0, 100.0)),
        }
    ),
    "dead_reckoning": Table(
        {
            "gyro_noise_degps": ("gyro_noise", number(1e-5, 10.0, scale=_RAD)),
            "gyro_bias_degps": ("gyro_bias_radps", number(1e-5, 10.0, scale=_RAD)),
            "gyro_bias_wanders_degps": ("gyro_bias_wanders", number(0.0, 1.0, scale=_RAD)),
            "accelerometer_noise_mps2": ("accelerometer_noise", number(1e-5, 10.0)),
            "accelerometer_bias_mps2": ("accelerometer_bias_mps2", number(1e-5, 10.0)),
            "accelerometer_bias_wanders_mps2": ("accelerometer_bias_wanders", number(0.0, 1.0)),
            "attitude_sigma_deg": ("attitude_sigma_rad", number(0.01, 45.0, scale=_RAD)),
            "attitude_wanders_deg": ("attitude_wanders", number(0.0, 10.0, scale=_RAD)),
            "airspeed_sigma_mps": ("airspeed_sigma_mps", number(0.01, 100.0)),
            "sideslip_sigma_mps": ("sideslip_sigma_mps", number(0.01, 100.0)),
            "wind_mps": ("wind_mps", number(0.1, 100.0)),
            "wind_wanders_mps": ("wind_wanders", number(0.0, 10.0)),
            "slip_mps": ("slip_mps", number(0.001, 10.0)),
            "altitude_sigma_m": ("altitude_sigma_m", number(0.1, 1000.0)),
            "ends_at_sigma_m": ("ends_at_sigma_m", number(1.0, 1e5)),
            "refuses": ("refuses", flag),
        }
    ),
    "radar": Table(
        {
            "number": ("number", whole(1, 65535)),
            "along_m": ("along_m", _FINITE),
            "left_m": ("left_m", _FINITE),
            "antenna_height_m": ("antenna_height_m", number(-1000.0, 1000.0)),
            "boresight_deg": ("compass_boresight_rad", _COMPASS),
            "range_sigma_m": ("range_sigma_m", _POSITIVE),
            "azimuth_sigma_deg": ("azimuth_sigma_rad", number(1e-6, 45.0, scale=_RAD)),
            "elevation_sigma_deg": ("elevation_sigma_rad", number(1e-6, 45.0, scale=_RAD)),
            "maximum_range_m": ("maximum_range_m", _POSITIVE),
            "range_error_m": ("range_error_m", number(-1e4, 1e4)),
            "azimuth_error_deg": ("azimuth_error_rad", number(-45.0, 45.0, scale=_RAD)),
            "elevation_error_deg": ("elevation_error_rad", number(-45.0, 45.0, scale=_RAD)),
            "time_error_ms": ("time_error_s", number(-10_000.0, 10_000.0, scale=1e-3)),
            "key_file": ("key_file", text()),
            "numbers": ("numbers", text("used", "ignored")),
            "period_s": ("period_s", number(0.02, 60.0)),
            "clutter_per_scan": ("clutter_per_scan", number(0.0, 1e5)),
            "detection_probability": ("detection_probability", number(0.05, 0.999)),
            "slowest_mps": ("slowest_mps", number(0.0, 300.0)),
            "hypotheses_at_most": ("hypotheses_at_most", whole(10, 100_000)),
        },
        required=("number", "along_m", "left_m", "antenna_height_m"),
        many=True,
    ),
    "decision_point": Table(
        {"name": ("name", text()), "distance_m": ("distance_m", number(0.0, 1e6))},
        required=("name", "distance_m"),
        many=True,
    ),
    "waypoint": Table(
        {
            "name": ("name", text()),
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
        },
        required=("name", "latitude_deg", "longitude_deg"),
        many=True,
    ),
    "weather": Table(
        {
            "name": ("name", text()),
            "latitude_deg": ("latitude_rad", _LATITUDE),
            "longitude_deg": ("longitude_rad", _LONGITUDE),
            "radius_m": ("radius_m", _POSITIVE),
            "polygon_deg": ("polygon_rad", _polygon),
            "from": ("valid_from", instant),
            "until": ("valid_until", instant),
            "base_msl_m": ("base_msl_m", number(-1e4, 1e5)),
            "top_msl_m": ("top_msl_m", number(-1e4, 1e5)),
        },
        required=("name",),
        many=True,
    ),
}
