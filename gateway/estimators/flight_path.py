"""A path from flight parameters: airspeed, heading and pitch integrated, and what closes the integral onto what is known.

A recorder without a position still knows how fast the aircraft flew through the air and where its nose pointed. Integrated,
that is the path through the air; the wind carries the air along. A known end tells the mean wind; further known places tell
how it changed. All paths here are level: east and north in metres from the lift-off point. Source: 002-2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.geodesy import STANDARD_GRAVITY_MPS2

Floats = NDArray[np.float64]

EARTH_M = 6_371_000.0
SEA_LEVEL_PA, SEA_LEVEL_K = 101_325.0, 288.15
_GAS_J_PER_KG_K = 287.052_87
_LAPSE_K_PER_M = 0.0065
_EXPONENT = STANDARD_GRAVITY_MPS2 / (_GAS_J_PER_KG_K * _LAPSE_K_PER_M)
SMOOTHED_OVER_S, SHORTEST_S = 3.0, 60.0  # of airspeed before it is held against the thresholds; of a sortie
CLIMB_OVER_S = 10.0  # a barometer's noise is a twentieth of a metre a second in so long


def air_velocity(
    true_airspeed_mps: ArrayLike,
    compass_heading_rad: ArrayLike,
    pitch_rad: ArrayLike,
    roll_rad: ArrayLike = 0.0,
    angle_of_attack_rad: ArrayLike = 0.0,
) -> Floats:
    """East, north, up (..., 3) in m/s through the air of an aircraft that flies where its nose points, or below it.

    Without an angle of attack roll turns the aircraft about its own velocity and drops out. Source: 002-2 1.1. Deviation: with
    one, a banked aircraft also flies to the side of where its nose points.
    """
    speed, heading, pitch, roll, attack = (
        np.asarray(one, dtype=np.float64)
        for one in (true_airspeed_mps, compass_heading_rad, pitch_rad, roll_rad, angle_of_attack_rad)
    )
    forward, below = speed * np.cos(attack), speed * np.sin(attack)
    ahead = forward * np.cos(pitch) + below * np.cos(roll) * np.sin(pitch)
    right = -below * np.sin(roll)
    up = forward * np.sin(pitch) - below * np.cos(roll) * np.cos(pitch)
    east, north = (
        ahead * np.sin(heading) + right * np.cos(heading),
        ahead * np.cos(heading) - right * np.sin(heading),
    )
    return np.stack(np.broadcast_arrays(east, north, up), axis=-1)


def angle_of_attack(
    true_airspeed_mps: ArrayLike, climb_mps: ArrayLike, pitch_rad: ArrayLike, roll_rad: ArrayLike
) -> Floats:
    """By how much the nose points above where the aircraft flies, rad: what leaves it the climb that its height shows.

    An error of the pitch, such as of a unit that is not mounted level, is in it and does not matter. Bounded by 17 degrees.
    """
    speed, climb, pitch, roll = (
        np.asarray(one, dtype=np.float64) for one in (true_airspeed_mps, climb_mps, pitch_rad, roll_rad)
    )
    along, across = np.sin(pitch), np.cos(roll) * np.cos(pitch)
    rises = climb / np.maximum(speed, 1.0) / np.maximum(np.hypot(along, across), 1e-9)
    return np.asarray(np.clip(np.arccos(np.clip(rises, -1.0, 1.0)) - np.arctan2(across, along), -0.3, 0.3))


def attack_by_height(
    time_s: Floats, height_m: Floats, true_airspeed_mps: Floats, pitch_rad: Floats, roll_rad: Floats
) -> Floats:
    """`angle_of_attack` (n,) by how the height (n,) changes about each instant, smoothed."""
    later = np.minimum(time_s + 0.5 * CLIMB_OVER_S, time_s[-1])
    earlier = np.maximum(time_s - 0.5 * CLIMB_OVER_S, time_s[0])
    climb = (np.interp(later, time_s, height_m) - np.interp(earlier, time_s, height_m)) / (later - earlier)
    return smoothed(time_s, angle_of_attack(true_airspeed_mps, climb, pitch_rad, roll_rad), CLIMB_OVER_S)


def integrated(time_s: Floats, velocity_mps: Floats) -> Floats:
    """The path (n, d) of a velocity (n, d), from 0, by the trapezoid rule. Source: 002-2 1.3."""
    steps = 0.5 * (velocity_mps[1:] + velocity_mps[:-1]) * np.diff(time_s)[:, None]
    return np.concatenate([np.zeros((1, velocity_mps.shape[1])), np.cumsum(steps, axis=0)])


def on_earth(time_s: Floats, velocity_mps: Floats, latitude_rad: float) -> Floats:
    """`integrated`, with east and north kept those of the lift-off point, at `latitude_rad`.

    North turns by the sine of the latitude for each radian of longitude: 0.8 degrees in 100 km at 45 degrees.
    Deviation: 002-2 takes the earth for flat.
    """
    flat = integrated(time_s, velocity_mps)
    latitude = latitude_rad + flat[:, 1] / EARTH_M
    turned = flat[:, 0] / (EARTH_M * np.cos(latitude)) * np.sin(latitude)
    sine, cosine = np.sin(turned), np.cos(turned)
    east, north = velocity_mps[:, 0], velocity_mps[:, 1]
    level = np.stack([cosine * east - sine * north, cosine * north + sine * east], axis=-1)
    return integrated(time_s, np.concatenate([level, velocity_mps[:, 2:]], axis=1))


def closed(time_s: Floats, path_m: Floats, end_m: ArrayLike) -> tuple[Floats, Floats]:
    """The path (n, d) with the error at its end spread evenly over time, and the wind (d,) m/s that this is.

    Spreading it in proportion to time is the exact estimate of one constant wind. Source: 002-2 2, step 3.
    """
    wind = (np.asarray(end_m, dtype=np.float64) - path_m[-1]) / (time_s[-1] - time_s[0])
    return path_m + (time_s - time_s[0])[:, None] * wind, wind


def true_airspeed(calibrated_mps: ArrayLike, pressure_pa: ArrayLike, temperature_k: ArrayLike = math.nan) -> Floats:
    """What an airspeed indicator shows, made true: m/s, by the air's density. Without a temperature that of the standard air.

    Compressibility is left out: 0.5 % at 130 m/s.
    """
    pressure = np.asarray(pressure_pa, dtype=np.float64)
    standard = SEA_LEVEL_K * (pressure / SEA_LEVEL_PA) ** (1.0 / _EXPONENT)
    temperature = np.where(np.isnan(temperature_k), standard, temperature_k)
    density_ratio = pressure / SEA_LEVEL_PA * SEA_LEVEL_K / temperature
    return np.asarray(calibrated_mps, dtype=np.float64) / np.sqrt(density_ratio)


def pressure_height(pressure_pa: ArrayLike, reference_pa: float) -> Floats:
    """Height in m above where the pressure is `reference_pa`, in the standard air. 002-2's repair of height from pitch."""
    ratios = (np.asarray(pressure_pa, dtype=np.float64) / SEA_LEVEL_PA, reference_pa / SEA_LEVEL_PA)
    high, low = (SEA_LEVEL_K / _LAPSE_K_PER_M * (1.0 - ratio ** (1.0 / _EXPONENT)) for ratio in ratios)
    return np.asarray(high - low)


def standard_pressure(altitude_m: ArrayLike) -> Floats:
    """The standard air's pressure in Pa at an altitude above mean sea level in m."""
    return np.asarray(
        SEA_LEVEL_PA * (1.0 - np.asarray(altitude_m, dtype=np.float64) * _LAPSE_K_PER_M / SEA_LEVEL_K) ** _EXPONENT
    )


def smoothed(time_s: Floats, values: Floats, over_s: float = SMOOTHED_OVER_S) -> Floats:
    """The mean of each sample's neighbourhood, half of `over_s` to either side; samples may come at any times."""
    before = np.searchsorted(time_s, time_s - 0.5 * over_s, "left")
    after = np.searchsorted(time_s, time_s + 0.5 * over_s, "right")
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray((sums[after] - sums[before]) / (after - before))


def sorties(
    time_s: Floats,
    airspeed_mps: Floats,
    take_off_mps: float,
    landing_mps: float,
    *,
    smoothed_over_s: float = SMOOTHED_OVER_S,
    shortest_s: float = SHORTEST_S,
) -> list[tuple[int, int]]:
    """First and last sample of each sortie: it begins above the take-off speed and ends below the lower landing speed.

    Smoothed, because at either speed noise crosses a threshold again and again; what is shorter than `shortest_s` is taxiing.
    A recording that ends in the air ends its sortie. Source: 002-2 2, step 1. Deviation: two thresholds, smoothing, a minimum.
    """
    if not landing_mps < take_off_mps:
        raise ValueError("the landing speed must be below the take-off speed")
    calm = smoothed(time_s, airspeed_mps, smoothed_over_s) if smoothed_over_s > 0.0 else airspeed_mps
    found, place = [], 0
    above, below = np.flatnonzero(calm > take_off_mps), np.flatnonzero(calm < landing_mps)
    while (nth := int(np.searchsorted(above, place))) < len(above):
        first = int(above[nth])
        ended = int(np.searchsorted(below, first))
        last = int(below[ended]) if ended < len(below) else len(time_s) - 1
        if time_s[last] - time_s[first] >= shortest_s:
            found.append((first, last))
        if ended == len(below):
            break
        place = last
    return found


def heading_bias(
    compass_heading_rad: Floats, airspeed_mps: Floats, take_off_mps: float, runway_compass_rad: float
) -> tuple[float, float]:
    """How much the heading shows too much, and its 1 sigma, rad, of the samples of a take-off roll; NaN where there are none.

    On the ground the nose points along the runway, whichever way it is used. A constant error of the heading turns the whole
    path, and closing it does not show that. Source: 002-2.
    """
    rolls = (airspeed_mps > 0.3 * take_off_mps) & (airspeed_mps < take_off_mps)
    if np.count_nonzero(rolls) < 2:
        return math.nan, math.nan
    off = compass_heading_rad[rolls] - runway_compass_rad
    off = np.mod(off + 0.5 * math.pi, math.pi) - 0.5 * math.pi  # either way of the runway
    middle = float(np.median(off))
    return middle, float(1.4826 * np.median(np.abs(off - middle)) / math.sqrt(len(off)))
