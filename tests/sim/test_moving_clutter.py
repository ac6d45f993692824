"""Birds and rain as a landing radar sees them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim.moving_clutter import BIRD_DETECTION, BIRD_SPEEDS_MPS, RAIN_WIND_MPS, draw_birds, draw_rain
from sim.sensors import RadarParameters, stream

EXACT = RadarParameters(
    range_sigma_m=0.0,
    azimuth_sigma_rad=0.0,
    elevation_sigma_rad=0.0,
    missing_range=0.0,
    missing_azimuth=0.0,
    missing_elevation=0.0,
)
TIMES = 0.4 * np.arange(200)


def test_birds_fly_as_birds_do() -> None:
    """Each is seen in its share of the scans, and between two of them it is not faster than birds are."""
    scan, _ = draw_birds(replace(EXACT, birds=5), TIMES, stream(1, "birds"))
    assert abs(len(scan) / (5 * 200) - BIRD_DETECTION) < 0.05
    scan, polar = draw_birds(replace(EXACT, birds=1), TIMES, stream(1, "birds"))
    speed = np.abs(np.diff(polar[:, 0])) / (0.4 * np.diff(scan))
    assert speed.max() <= BIRD_SPEEDS_MPS[1] * 1.001


def test_rain_drifts_with_the_wind() -> None:
    """The middle of a shower moves with the wind; each scan is strewn anew."""
    scan, polar = draw_rain(replace(EXACT, rain_per_scan=40.0), TIMES, stream(1, "rain"))
    east = polar[:, 0] * np.cos(polar[:, 2]) * np.cos(polar[:, 1])
    moved = east[scan >= 150].mean() - east[scan < 50].mean()
    assert abs(moved - RAIN_WIND_MPS[0] * 60.0) < 150.0


def test_without_them_nothing_is_drawn() -> None:
    """The defaults have neither."""
    for draw in (draw_birds, draw_rain):
        scan, polar = draw(RadarParameters(), TIMES, stream(1, "x"))
        assert len(scan) == len(polar) == 0
