"""A site written as the text of a site file."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable

from gateway.settings.safety import Separation, Stabilised
from gateway.settings.site import (
    HYPOTHESES_AT_MOST,
    SLOWEST_MPS,
    DeadReckoning,
    Estimation,
    PositionSource,
    RadarSite,
    Runway,
    Site,
    Weather,
)


def format_site(site: Site) -> str:
    """The TOML text of a site; parsing it again gives the same site to the digits written.

    Angles are written to 1e-9 degrees (0.1 mm on the ground), lengths to 0.1 mm.
    """
    lines = [f"name = {_quoted(site.name)}", "", "[display]", f'units = "{site.units}"                # or "aviation"']
    lines += ["", "[runway]", *_runway(site.runway), "", *_position(site.position), "", *_estimation(site.estimation)]
    lines += ["", *_separation(site.separation), "", *_stabilised(site.stabilised)]
    lines += ["", *_dead_reckoning(site.dead_reckoning)]
    for radar in site.radars:
        lines += ["", "[[radar]]", *_radar(radar)]
    for point in site.decision_points:
        lines += ["", "[[decision_point]]", f"name = {_quoted(point.name)}", f"distance_m = {point.distance_m:g}"]
    for waypoint in site.waypoints:
        lines += ["", "[[waypoint]]", f"name = {_quoted(waypoint.name)}"]
        lines += _place(waypoint.latitude_rad, waypoint.longitude_rad)
    for area in site.weather:
        lines += ["", "[[weather]]", *_weather(area)]
    return "\n".join(lines) + "\n"


def _runway(runway: Runway) -> list[str]:
    latitude, longitude = _place(runway.latitude_rad, runway.longitude_rad)
    lines = [f"{latitude}          # centre", longitude]
    lines.append(f"height_m = {runway.height_m:.4f}              # above the ellipsoid")
    if runway.geoid_separation_m is not None:
        lines.append(f"geoid_separation_m = {runway.geoid_separation_m:.4f}   # height_m = altitude_msl_m + this")
    return [
        *lines,
        f"landing_direction_deg = {math.degrees(runway.landing_compass_rad):.6f} # true, main landing direction",
        f"length_m = {runway.length_m:.1f}",
        f"width_m = {runway.width_m:.1f}",
        f"glide_path_deg = {math.degrees(runway.glide_path_rad):.4f}",
        f"threshold_crossing_height_m = {runway.threshold_crossing_height_m:.2f}",
        *([f"follows = {_quoted(runway.follows)}"] if runway.follows is not None else []),
    ]


def _position(position: PositionSource) -> list[str]:
    return [
        "[position]                   # what a position source is worth when its stream does not say",
        f"sigma_m = {position.sigma_m:g}",
        f"systematic_m = {position.systematic_m:g}          # allowed constant error",
        f"velocity_sigma_mps = {position.velocity_sigma_mps:g}",
    ]


_ACCELERATIONS = (
    ("calm_acceleration_mps2", "along the course and upright"),
    ("calm_across_acceleration_mps2", ""),
    ("lasting_acceleration_mps2", "along the course: braking"),
    ("lasting_drag_mps2", "more where fast: at 100 m/s, by the square of speed"),
    ("lasting_across_acceleration_mps2", "swinging onto a course"),
    ("lasting_for_s", ""),
    ("manoeuvre_acceleration_mps2", "no full turn"),
    ("manoeuvre_vertical_acceleration_mps2", ""),
    ("turn_acceleration_mps2", "beside the turn's own"),
)
"""Of `Estimation`, in the file's order: what is the same in the file and inside, and what is said of it."""


def _estimation(chosen: Estimation) -> list[str]:
    """What is as it is by default stands in comments, so that a site follows better defaults of a later release."""
    usual = Estimation()
    rows = (
        *((name, getattr(chosen, name), getattr(usual, name), says) for name, says in _ACCELERATIONS),
        ("turn_rate_degps", math.degrees(chosen.turn_rate_rps), math.degrees(usual.turn_rate_rps), ""),
        ("bank_deg", math.degrees(chosen.bank_rad), math.degrees(usual.bank_rad), "slow aircraft turn as at this bank"),
        ("calm_share", chosen.calm_share, usual.calm_share, "of an aircraft's time, against the others"),
        ("lasting_share", chosen.lasting_share, usual.lasting_share, ""),
        ("manoeuvre_share", chosen.manoeuvre_share, usual.manoeuvre_share, ""),
        ("turn_share", chosen.turn_share, usual.turn_share, "both sides"),
        ("mode_lasts_s", chosen.mode_lasts_s, usual.mode_lasts_s, ""),
    )
    head = "[estimation]                 # how aircraft fly, for --estimator imm and rmimm; nobody has to tune it"
    return [head, *_chosen(rows)]


def _separation(chosen: Separation) -> list[str]:
    usual = Separation()
    says = {
        "horizontal_m": "well clear; 5556 and 300 for a controlled approach",
        "vertical_m": "nearer than both is a conflict",
        "look_ahead_s": "no further than predictions reach",
        "least_probability": "",
        "least_height_m": "above the runway: nobody lower is probed",
    }
    rows = ((name, getattr(chosen, name), getattr(usual, name), said) for name, said in says.items())
    return ["[separation]                 # what conflicts are probed for", *_chosen(rows)]


def _stabilised(chosen: Stabilised) -> list[str]:
    usual = Stabilised()
    rows = (
        ("glide_path_deg", math.degrees(chosen.glide_path_rad), math.degrees(usual.glide_path_rad), "above or below"),
        ("centreline_deg", math.degrees(chosen.centreline_rad), math.degrees(usual.centreline_rad), "to either side"),
        ("least_vertical_m", chosen.least_vertical_m, usual.least_vertical_m, "near the runway"),
        ("least_lateral_m", chosen.least_lateral_m, usual.least_lateral_m, ""),
        ("speed_share", chosen.speed_share, usual.speed_share, "faster than the approach speed"),
        ("slow_share", chosen.slow_share, usual.slow_share, "slower than approach_speed_mps"),
        ("least_fast_mps", chosen.least_fast_mps, usual.least_fast_mps, "faster or slower"),
    )
    given = (
        ("upper_gate_m", chosen.upper_gate_m, 305, "above the runway; by default 83 s to go"),
        ("lower_gate_m", chosen.lower_gate_m, 152, "by default 41.5 s"),
        ("approach_speed_mps", chosen.approach_speed_mps, 70, "by default the least that it flew on this final"),
    )
    optional = (
        (name, example if value is None else value, None if value else example, said)
        for name, value, example, said in given
    )
    return ["[stabilised]                 # an approach that is not is told", *_chosen((*optional, *rows))]


def _dead_reckoning(chosen: DeadReckoning) -> list[str]:
    usual, degree = DeadReckoning(), 180.0 / math.pi
    said = (
        ("gyro_noise_degps", "gyro_noise", degree, "in a root Hz, vibration included"),
        ("gyro_bias_degps", "gyro_bias_radps", degree, "when switched on"),
        ("gyro_bias_wanders_degps", "gyro_bias_wanders", degree, "in a root second"),
        ("accelerometer_noise_mps2", "accelerometer_noise", 1.0, "in a root Hz"),
        ("accelerometer_bias_mps2", "accelerometer_bias_mps2", 1.0, ""),
        ("accelerometer_bias_wanders_mps2", "accelerometer_bias_wanders", 1.0, "in a root second"),
        (
            "attitude_sigma_deg",
            "attitude_sigma_rad",
            degree,
            "of roll and pitch that autopilots tell; heading twice that",
        ),
        ("attitude_wanders_deg", "attitude_wanders", degree, "in a root second"),
        ("airspeed_sigma_mps", "airspeed_sigma_mps", 1.0, ""),
        ("sideslip_sigma_mps", "sideslip_sigma_mps", 1.0, ""),
        ("wind_mps", "wind_mps", 1.0, "before anything is known of it"),
        ("wind_wanders_mps", "wind_wanders", 1.0, "in a root second"),
        ("slip_mps", "slip_mps", 1.0, "of wheels to the side"),
        ("altitude_sigma_m", "altitude_sigma_m", 1.0, "of altitudes that are told beside positions"),
        ("ends_at_sigma_m", "ends_at_sigma_m", 1.0, "less sure than this it tells nothing"),
    )
    rows = ((key, per * getattr(chosen, name), per * getattr(usual, name), says) for key, name, per, says in said)
    refuses = f"{'# ' if chosen.refuses else ''}refuses = {str(chosen.refuses).lower()}"
    head = "[dead_reckoning]             # how good vehicles' inertial units are"
    return [head, *_chosen(rows), f"{refuses:<44s} # positions that inertial data deny"]


def _chosen(rows: Iterable[tuple[str, float, float | None, str]]) -> list[str]:
    """Lines of (key, value, default, what is said of it); what is as it is by default stands in a comment."""
    lines = []
    for key, value, default, says in rows:
        line = f"{'# ' if value == default else ''}{key} = {value:.10g}"
        lines.append(f"{line:<44s} # {says}" if says else line)
    return lines


def _radar(radar: RadarSite) -> list[str]:
    lines = [
        f"number = {radar.number}",
        f"along_m = {radar.along_m:.4f}              # antenna in the runway frame: x",
        f"left_m = {radar.left_m:.4f}               # y",
        f"antenna_height_m = {radar.antenna_height_m:.4f}     # z, above the runway plane",
        f"boresight_deg = {math.degrees(radar.compass_boresight_rad) % 360.0:.6f}",
        f"range_sigma_m = {radar.range_sigma_m:g}",
        f"azimuth_sigma_deg = {math.degrees(radar.azimuth_sigma_rad):.6g}",
        f"elevation_sigma_deg = {math.degrees(radar.elevation_sigma_rad):.6g}",
        f"maximum_range_m = {radar.maximum_range_m:g}",
    ]
    errors = (
        ("range_error_m", radar.range_error_m, "measures too far by"),
        ("azimuth_error_deg", math.degrees(radar.azimuth_error_rad), "too far to the left by"),
        ("elevation_error_deg", math.degrees(radar.elevation_error_rad), "too high by"),
        ("time_error_ms", 1e3 * radar.time_error_s, "stamps late by"),
    )
    lines += [f"{f'{key} = {value:.6g}':<40s}# {says}" for key, value, says in errors if value]
    most = radar.hypotheses_at_most
    given = (
        ("period_s", radar.period_s, "of a scan"),
        ("clutter_per_scan", radar.clutter_per_scan, "plots"),
        ("detection_probability", radar.detection_probability, "of a target in a scan"),
        ("slowest_mps", None if radar.slowest_mps == SLOWEST_MPS else radar.slowest_mps, "an aircraft"),
        ("hypotheses_at_most", None if most == HYPOTHESES_AT_MOST else most, "time of a scan"),
    )
    lines += [f"{f'{key} = {value:.6g}':<40s}# {says}" for key, value, says in given if value is not None]
    lines += ['numbers = "ignored"'] if radar.numbers == "ignored" else []
    return [*lines, f"key_file = {_quoted(radar.key_file)}"] if radar.key_file else lines


def _weather(area: Weather) -> list[str]:
    lines = [f"name = {_quoted(area.name)}"]
    if area.latitude_rad is not None and area.longitude_rad is not None:
        lines += [*_place(area.latitude_rad, area.longitude_rad), f"radius_m = {area.radius_m:g}"]
    else:
        corners = (
            f"[{math.degrees(latitude):.9f}, {math.degrees(longitude):.9f}]" for latitude, longitude in area.polygon_rad
        )
        lines.append(f"polygon_deg = [{', '.join(corners)}]")
    times = (("from", area.valid_from), ("until", area.valid_until))
    heights = (("base_msl_m", area.base_msl_m), ("top_msl_m", area.top_msl_m))
    lines += [f'{key} = "{value}"' for key, value in times if value]
    return [*lines, *(f"{key} = {height:.10g}" for key, height in heights if height is not None)]


def _place(latitude_rad: float, longitude_rad: float) -> tuple[str, str]:
    return f"latitude_deg = {math.degrees(latitude_rad):.9f}", f"longitude_deg = {math.degrees(longitude_rad):.9f}"


def _quoted(text: str) -> str:
    """A TOML basic string, control characters included."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
