"""What simulated sensors say of the truth: an aircraft's position source and a landing radar, over arrays.

Every sensor draws from a stream of its own (`stream`), and always the same number of variates in the same
order, whatever its parameters are: changing one sensor leaves the others' noise, changing a probability
leaves this one's. Leading axes are batch axes: the same functions make one scene and a thousand Monte Carlo
runs.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.frames import polar_from_xyz
from gateway.geodesy import wrap_rad
from sim.earth import Flown, offset_geodetic

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Intervals = tuple[tuple[float, float], ...]  # seconds of the scene, from and until


@dataclass(frozen=True, slots=True)
class GpsParameters:
    """A position source; the defaults are 003's case."""

    period_s: float = 5.0
    phase_s: float = 0.13  # the first report is valid then
    random_phase: bool = False  # each aircraft its own, uniform over a period, instead of phase_s
    sigma_m: float = 15.0  # an axis
    error_east_m: float = 35.0  # constant, and common to all aircraft
    error_north_m: float = 40.0
    error_up_m: float = 28.0
    error_sigma_m: float = 0.0  # constant, each aircraft its own, an axis
    velocity: bool = True  # False: position only
    velocity_sigma_mps: float = 0.5
    latency_low_s: float = 0.8
    latency_high_s: float = 2.0
    missing: float = 0.0  # share of the reports that never arrive
    dropouts: Intervals = ()
    accuracy_given: bool = False  # tell sigma_m in the stream


@dataclass(frozen=True, slots=True)
class RadarParameters:
    """A landing radar; the defaults are 003's case."""

    period_s: float = 0.4
    phase_s: float = 0.0
    range_sigma_m: float = 15.0
    azimuth_sigma_rad: float = 1e-3
    elevation_sigma_rad: float = 1e-3
    missing_range: float = 0.05
    missing_azimuth: float = 0.2
    missing_elevation: float = 0.2
    range_error_m: float = 0.0
    azimuth_error_rad: float = 0.0
    elevation_error_rad: float = 0.0
    time_error_s: float = 0.0  # its stamps are late by this
    latency_s: float = 0.02
    detection_probability: float = 1.0
    maximum_range_m: float = 60_000.0
    sector_rad: float = math.pi  # sees this far to each side of the boresight
    radial_velocity: bool = False
    radial_velocity_sigma_mps: float = 0.5
    numbered: bool = True  # False: every plot has track number 0
    first_number: int = 1  # of the first aircraft; the next ones follow
    clutter_per_scan: float = 0.0  # mean of a Poisson number, uniform over the coverage up to 10 degrees
    bursts: Intervals = ()  # while a jammer, or a fault, makes of every scan
    burst_plots: int = 10_000  # so many false plots more
    birds: int = 0  # about the approach, each on its own way
    rain_per_scan: float = 0.0  # mean of a Poisson number of plots of a shower that drifts over the approach
    dropouts: Intervals = ()
    status_period_s: float = 5.0
    sigma_given: bool = False  # tell the sigmas in each plot


@dataclass(frozen=True, slots=True)
class ImuParameters:
    """An aircraft's inertial unit, one sigma; noise in a root Hz. A rate of 0: it tells nothing."""

    rate_hz: float = 0.0
    rate_bias_radps: float = math.radians(0.03)
    force_bias_mps2: float = 0.03
    rate_noise_radps: float = math.radians(0.01)
    force_noise_mps2: float = 0.005
    airspeed_sigma_mps: float = 0.3  # of what has wings
    airspeed_period_s: float = 0.1


@dataclass(frozen=True, slots=True)
class GpsMeasured:
    """Reports (..., n) of a position source, velocities (..., n, 3), and when each is valid and heard."""

    valid_s: Floats
    received_s: Floats
    heard: Bools  # False: lost on the way
    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats
    velocity_mps: Floats  # NaN for a source that gives positions only
    fix: Bools  # False: the source tells that it does not know where it is


@dataclass(frozen=True, slots=True)
class PlotsMeasured:
    """What a radar makes of one target: range m, azimuth and elevation rad (..., 3), NaN: not measured."""

    polar: Floats
    radial_mps: Floats  # (...), positive = receding; NaN where not measured

    @property
    def seen(self) -> Bools:
        """Whether anything was measured at all (...)."""
        return np.asarray(np.isfinite(self.polar).any(axis=-1))


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """The random stream of one named thing in the world; streams of other names are independent of it."""
    key = tuple(zlib.crc32(str(name).encode()) for name in names)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))


def during(intervals: Intervals, time_s: ArrayLike) -> Bools:
    """Whether times (...) lie in any of the intervals, the start included."""
    time = np.asarray(time_s, dtype=np.float64)
    inside = np.zeros(time.shape, dtype=np.bool_)
    for start, end in intervals:
        inside |= (time >= start) & (time < end)
    return inside


def gps_times(parameters: GpsParameters, start_s: float, end_s: float, phases: ArrayLike) -> Floats:
    """Validity times (..., n) of a position source of given phases (...) within start and end, in whole
    milliseconds.

    Where phases differ, all get as many reports as fit for the latest.
    """
    phase = np.asarray(phases, dtype=np.float64)
    period = parameters.period_s
    first = phase + np.ceil((start_s - phase) / period) * period
    count = max(math.ceil((end_s - float(np.max(first))) / period), 0)
    return np.asarray(np.round(first[..., None] + period * np.arange(count), 3), dtype=np.float64)


def gps_phases(parameters: GpsParameters, generator: np.random.Generator, shape: tuple[int, ...] = ()) -> Floats:
    """The phases (shape) of sources, s: as set, or uniform over a period."""
    drawn = generator.uniform(0.0, 1.0, shape) * parameters.period_s
    return np.asarray(drawn) if parameters.random_phase else np.full(shape, parameters.phase_s)


def measure_gps(
    parameters: GpsParameters,
    valid_s: Floats,
    flown: Flown,
    generator: np.random.Generator,
    sigma_m: ArrayLike | None = None,
) -> GpsMeasured:
    """Reports of a position source at times (..., n), of the truth at these times ((n,) or (..., n)).

    `sigma_m` (n,) is the noise an axis at each time, where it is not always the parameters'.
    """
    shape = valid_s.shape
    own = generator.normal(size=(*shape[:-1], 1, 3)) * parameters.error_sigma_m
    noise = (
        generator.normal(size=(*shape, 3)) * np.asarray(parameters.sigma_m if sigma_m is None else sigma_m)[..., None]
    )
    velocity_noise = generator.normal(size=(*shape, 3)) * parameters.velocity_sigma_mps
    spread_s = parameters.latency_high_s - parameters.latency_low_s
    latency = parameters.latency_low_s + spread_s * generator.uniform(size=shape)
    lost = generator.uniform(size=shape) < parameters.missing
    common = np.array([parameters.error_east_m, parameters.error_north_m, parameters.error_up_m])
    off = common + own + noise
    latitude, longitude, height = offset_geodetic(flown, off[..., 0], off[..., 1], off[..., 2])
    velocity = flown.velocity_mps + velocity_noise if parameters.velocity else np.full((*shape, 3), np.nan)
    heard = ~(lost | during(parameters.dropouts, valid_s))
    return GpsMeasured(valid_s, valid_s + latency, heard, latitude, longitude, height, velocity, np.ones(shape, bool))


def scan_times(parameters: RadarParameters, start_s: float, end_s: float) -> Floats:
    """Times (n,) of a radar's scans from start until before end: multiples of its period after its phase."""
    period, phase = parameters.period_s, parameters.phase_s
    first = math.ceil((start_s - phase) / period - 1e-9)  # a scan at start or end itself, but for rounding
    last = math.ceil((end_s - phase) / period - 1e-9)
    return np.asarray(phase + period * np.arange(first, max(last, first)), dtype=np.float64)


def measure_radar(
    parameters: RadarParameters,
    time_s: ArrayLike,
    radar_m: Floats,
    velocity_mps: Floats,
    generator: np.random.Generator,
    shape: tuple[int, ...] = (),
    error: ArrayLike = 0.0,
) -> PlotsMeasured:
    """Plots (shape, n) of one target at scan times (n,); its truth (n, 3) in the radar's frame.

    `error` (n, 3) is what it measures too much at each time beside the parameters' constant errors.
    Source: 003 2.2 eq 5, the case.
    """
    count = (*shape, len(radar_m))
    noise = generator.normal(size=(*count, 3))
    missing = generator.uniform(size=(*count, 3))
    detected = generator.uniform(size=count) < parameters.detection_probability
    radial_noise = generator.normal(size=count) * parameters.radial_velocity_sigma_mps
    true = polar_from_xyz(radar_m)
    p = parameters
    errors = np.array([p.range_error_m, p.azimuth_error_rad, p.elevation_error_rad]) + np.asarray(
        error, dtype=np.float64
    )
    sigmas = np.array([p.range_sigma_m, p.azimuth_sigma_rad, p.elevation_sigma_rad])
    polar = true + errors + noise * sigmas
    polar[..., 0] = np.maximum(polar[..., 0], 0.0)
    polar[..., 1] = wrap_rad(polar[..., 1])
    polar[..., 2] = np.clip(polar[..., 2], -0.5 * math.pi, 0.5 * math.pi)
    shares = np.array([parameters.missing_range, parameters.missing_azimuth, parameters.missing_elevation])
    in_view = (true[..., 0] <= parameters.maximum_range_m) & (np.abs(true[..., 1]) <= parameters.sector_rad)
    plotted = detected & in_view & ~during(parameters.dropouts, time_s)
    polar = np.where(plotted[..., None] & (missing >= shares), polar, np.nan)
    radial = np.sum(radar_m * velocity_mps, axis=-1) / np.maximum(true[..., 0], 1.0) + radial_noise
    measured = plotted & np.isfinite(polar).any(axis=-1) & parameters.radial_velocity
    return PlotsMeasured(polar, np.where(measured, radial, np.nan))


def draw_clutter(
    parameters: RadarParameters, time_s: Floats, generator: np.random.Generator
) -> tuple[NDArray[np.int64], Floats]:
    """False plots of scans, uniform over the coverage: the scan of each (m,), and range, azimuth, elevation (m, 3)."""
    per_scan = generator.poisson(parameters.clutter_per_scan, len(time_s))
    per_scan[during(parameters.bursts, time_s)] += parameters.burst_plots
    scan = np.repeat(np.arange(len(time_s)), per_scan)
    drawn = generator.uniform(size=(len(scan), 3))
    low = np.array([500.0, -parameters.sector_rad, 0.0])
    high = np.array([parameters.maximum_range_m, parameters.sector_rad, math.radians(10.0)])
    return scan, low + (high - low) * drawn
