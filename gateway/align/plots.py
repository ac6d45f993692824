"""Radar plots with what `register` learnt taken off, and a radar's own word on where it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gateway.frames import RunwayFrame
from gateway.frozen import made_swiftly
from gateway.observation import RadarPlot, RadarStatus
from gateway.settings import RadarSite

Correction = tuple[float, float, float, float]  # what is taken off: range m, azimuth rad, elevation rad, time s
Polar = tuple[float, float, float]  # range m, azimuth rad, elevation rad; NaN = not measured

SECOND = 1_000_000_000
NOTHING: Correction = (0.0, 0.0, 0.0, 0.0)


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """A radar plot, corrected: range m, azimuth rad, elevation rad, NaN = not measured; and what was taken off it."""

    at: int
    serial: int
    received_at: int
    radar: int
    number: int
    polar: Polar
    sigma: Polar
    taken_off: Correction = NOTHING


def place_plot(plot: RadarPlot, serial: int, radar: RadarSite, correction: Correction) -> Plot:
    """A plot with its radar's errors taken off, the site's sigmas where it gives none, and no number that is to be ignored."""
    measured = (plot.range_m, plot.azimuth_rad, plot.elevation_rad)
    *errors, late_s = correction
    distance, azimuth, elevation = (
        math.nan if value is None else value - error for value, error in zip(measured, errors, strict=True)
    )
    sigma = (
        plot.range_sigma_m or radar.range_sigma_m,
        plot.azimuth_sigma_rad or radar.azimuth_sigma_rad,
        plot.elevation_sigma_rad or radar.elevation_sigma_rad,
    )
    polar = (distance, azimuth, elevation)
    at = plot.valid_at - round(late_s * SECOND)
    number = 0 if radar.numbers == "ignored" else plot.track_number
    return Plot(at, serial, plot.received_at, plot.radar, number, polar, sigma, correction)


def radar_from_status(status: RadarStatus, frame: RunwayFrame) -> RadarSite:
    """Where a radar says it stands, as a radar of the site file."""
    x, y, z = frame.runway_from_geodetic(status.latitude_rad, status.longitude_rad, status.height_m).tolist()
    return RadarSite(status.radar, x, y, z, status.compass_boresight_rad)


def contradiction(known: RadarSite, said: RadarSite) -> str | None:
    """How a radar's own word differs from the site file's by more than 30 m or 0.1 degrees, or None."""
    off_m = math.dist(
        (known.along_m, known.left_m, known.antenna_height_m), (said.along_m, said.left_m, said.antenna_height_m)
    )
    turned = math.degrees(math.remainder(said.compass_boresight_rad - known.compass_boresight_rad, 2.0 * math.pi))
    parts = [f"stands {off_m:.0f} m elsewhere"] * (off_m > 30.0)
    parts += [f"looks {turned:+.2f} degrees further right"] * (abs(turned) > 0.1)
    return " and ".join(parts) or None
