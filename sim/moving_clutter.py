"""What a landing radar sees that moves and is no aircraft: birds about the approach, and a shower that drifts across it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gateway.frames import polar_from_xyz
from sim.sensors import RadarParameters

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BIRD_LOW = (500.0, -1500.0, 20.0)  # where birds are at first, in the radar's frame
BIRD_HIGH = (12_000.0, 1500.0, 400.0)
BIRD_SPEEDS_MPS = (8.0, 18.0)
BIRD_DETECTION = 0.6  # in each scan
BIRD_WANDER_RAD = 0.1  # of the course, in a second
RAIN_M, RAIN_SIZE_M = (6000.0, 300.0, 400.0), (1500.0, 800.0, 200.0)  # a shower's middle at first, and one sigma of it
RAIN_WIND_MPS = (10.0, 3.0)


def draw_birds(parameters: RadarParameters, time_s: Floats, generator: np.random.Generator) -> tuple[Ints, Floats]:
    """Plots of birds, each of which flies its own way: the scan of each (m,), and range, azimuth, elevation (m, 3)."""
    count, scans = parameters.birds, len(time_s)
    begin = generator.uniform(BIRD_LOW, BIRD_HIGH, (count, 3))
    course = generator.uniform(0.0, 2.0 * math.pi, (count, 1)) + BIRD_WANDER_RAD * math.sqrt(
        parameters.period_s
    ) * np.cumsum(generator.normal(size=(count, scans)), axis=1)
    speed = generator.uniform(*BIRD_SPEEDS_MPS, (count, 1))
    seen = generator.uniform(size=(count, scans)) < BIRD_DETECTION
    flown = np.cumsum(
        parameters.period_s * speed[..., None] * np.stack([np.cos(course), np.sin(course)], axis=-1), axis=1
    )
    place = np.concatenate([begin[:, None, :2] + flown, np.repeat(begin[:, None, 2:], scans, axis=1)], axis=-1)
    bird, scan = np.nonzero(seen)
    return scan, _measured(parameters, place[bird, scan], generator)


def draw_rain(parameters: RadarParameters, time_s: Floats, generator: np.random.Generator) -> tuple[Ints, Floats]:
    """Plots of a shower that drifts with the wind, strewn anew each scan: as `draw_birds`."""
    scan = np.repeat(np.arange(len(time_s)), generator.poisson(parameters.rain_per_scan, len(time_s)))
    strewn = np.array(RAIN_M) + generator.normal(size=(len(scan), 3)) * RAIN_SIZE_M
    strewn[:, :2] += (time_s[scan] - time_s[0])[:, None] * RAIN_WIND_MPS if len(scan) else 0.0
    strewn[:, 2] = np.abs(strewn[:, 2])
    return scan, _measured(parameters, strewn, generator)


def _measured(parameters: RadarParameters, radar_m: Floats, generator: np.random.Generator) -> Floats:
    """Range, azimuth, elevation (m, 3) as the radar measures them of aircraft: with its noise, and components missing."""
    sigmas = parameters.range_sigma_m, parameters.azimuth_sigma_rad, parameters.elevation_sigma_rad
    polar = polar_from_xyz(radar_m) + generator.normal(size=radar_m.shape) * sigmas
    shares = parameters.missing_range, parameters.missing_azimuth, parameters.missing_elevation
    return np.where(generator.uniform(size=polar.shape) < shares, np.nan, polar)
