"""What an inertial unit measures on a way, and what else a vehicle tells there: the truth's own derivatives, and noise.

A way is velocities over time; attitude follows from them as the vehicle's kind has it, and the unit's rates and forces from
both, to second order in the fine step. Source: the inverse of 002-4 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import inertial as ins
from gateway.estimators.inertial import Motion

Floats = NDArray[np.float64]

START = (math.radians(47.4), math.radians(8.5), 500.0)
BIAS_LASTS_S = 60.0  # between two values of a bias that wanders


@dataclass(frozen=True, slots=True)
class Errors:
    """Of a MEMS unit, one sigma: what its calibration left of its biases, and noise in a root Hz."""

    rate_bias_radps: float = math.radians(0.03)
    force_bias_mps2: float = 0.03
    rate_noise: float = math.radians(0.01)
    force_noise: float = 0.005
    rate_wanders_radps: float = 0.0  # biases that are others after a minute or two: temperature, what rotors shake
    force_wanders_mps2: float = 0.0


@dataclass(frozen=True, slots=True)
class Ride:
    """One vehicle's truth and what its unit measured. Times (n,) s; samples (n - 1,) are means from one time to the next."""

    time_s: Floats
    motion: Motion  # (n,)
    rate_radps: Floats  # (n - 1, 3) without errors
    force_mps2: Floats  # (n - 1, 3)
    wind_mps: Floats  # (n, 2) north, east


def ride(
    time_s: Floats, velocity_mps: Floats, attitude: Floats, start: tuple[float, float, float], wind_mps: Floats
) -> Ride:
    """The truth of a way: velocities (n, 3) north, east, down and attitudes (n, 4), from a geodetic place on.

    Rates and forces are those of which strapdown navigation makes exactly this way.
    """
    steps = np.diff(time_s)
    metres = 0.5 * (velocity_mps[1:] + velocity_mps[:-1]) * steps[:, None]
    latitude, longitude, height = (np.full(len(time_s), one) for one in start)
    for _ in range(4):  # each place needs the radii of the one before: found by going over all of them again
        there = ins.displaced(latitude[:-1], longitude[:-1], height[:-1], metres)
        latitude, longitude, height = (
            np.concatenate([one[:1], one[0] + np.cumsum(after - one[:-1])])
            for one, after in zip((latitude, longitude, height), there, strict=True)
        )
    motion = Motion(latitude, longitude, height, velocity_mps, attitude)
    before = Motion(latitude[:-1], longitude[:-1], height[:-1], velocity_mps[:-1], attitude[:-1])
    earth, frame = ins.earth_rate(before.latitude_rad), ins.transport(before)
    turned = ins.product(ins.turned_by((earth + frame) * steps[:, None]), attitude[1:])
    body = ins.product(attitude[:-1] * [1.0, -1.0, -1.0, -1.0], turned)
    rate = _vector(body) / steps[:, None]
    halfway = 0.5 * (velocity_mps[1:] + velocity_mps[:-1])
    felt = np.diff(velocity_mps, axis=0) / steps[:, None] + ins.cross(2.0 * earth + frame, halfway)
    felt[:, 2] -= ins.gravity(before.latitude_rad, before.height_m)
    middle = ins.product(
        ins.turned_by(-0.5 * (earth + frame) * steps[:, None]),
        ins.product(attitude[:-1], ins.turned_by(0.5 * rate * steps[:, None])),
    )
    force = (np.swapaxes(ins.matrix(middle), -1, -2) @ felt[..., None])[..., 0]
    return Ride(time_s, motion, rate, force, wind_mps)


def measured(truth: Ride, errors: Errors, generator: np.random.Generator) -> tuple[Floats, Floats]:
    """Rates and forces (n - 1, 3) with biases and noise."""
    steps = np.diff(truth.time_s)[:, None]
    shape = truth.rate_radps.shape
    rate_bias, force_bias = (
        one * generator.standard_normal(3) for one in (errors.rate_bias_radps, errors.force_bias_mps2)
    )
    rate = truth.rate_radps + rate_bias + errors.rate_noise / np.sqrt(steps) * generator.standard_normal(shape)
    force = truth.force_mps2 + force_bias + errors.force_noise / np.sqrt(steps) * generator.standard_normal(shape)
    for sigma, told in ((errors.rate_wanders_radps, rate), (errors.force_wanders_mps2, force)):
        if sigma > 0.0:
            middle, most = 0.5 * (truth.time_s[1:] + truth.time_s[:-1]), 3.0 * sigma
            for axis in range(3):
                told[:, axis] += wandering(generator, middle, 0.0, sigma, BIAS_LASTS_S, -most, most)
    return rate, force


def _vector(turned: Floats) -> Floats:
    """The rotation vectors (n, 3) of quaternions (n, 4)."""
    turned = turned * np.where(turned[:, :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(turned[:, 1:], axis=1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, turned[:, :1])
    return np.asarray(turned[:, 1:] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0))


def car(generator: np.random.Generator, length_s: float, rate_hz: float = 50.0) -> Ride:
    """A car in a town and on a road: 4 to 25 m/s, bends at random times, level."""
    time = np.arange(0.0, length_s + 0.5 / rate_hz, 1.0 / rate_hz)
    speed = wandering(generator, time, 15.0, 7.0, 12.0, 4.0, 25.0)
    rate = bends(generator, time, 0.25)
    heading = generator.uniform(0.0, 2.0 * math.pi) + np.concatenate([[0.0], np.cumsum(rate[1:] / rate_hz)])
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros_like(speed)], axis=-1)
    level = np.zeros_like(time)
    return ride(time, velocity, ins.from_angles(level, level, heading), START, np.zeros((len(time), 2)))


def aeroplane(generator: np.random.Generator, length_s: float, rate_hz: float = 50.0) -> Ride:
    """A small aeroplane: 25 m/s through the air, in a wind of about 8 m/s that wanders; coordinated turns, slow climbs."""
    time = np.arange(0.0, length_s + 0.5 / rate_hz, 1.0 / rate_hz)
    airspeed = wandering(generator, time, 25.0, 1.0, 8.0, 20.0, 30.0)
    rate = bends(generator, time, 0.12)
    heading = generator.uniform(0.0, 2.0 * math.pi) + np.concatenate([[0.0], np.cumsum(rate[1:] / rate_hz)])
    climb = wandering(generator, time, 0.0, 0.8, 20.0, -2.0, 2.0)
    wind = 8.0 * _direction(generator) + np.stack(
        [wandering(generator, time, 0.0, 0.7, 60.0, -3.0, 3.0) for _ in range(2)], axis=-1
    )
    level = np.sqrt(airspeed**2 - climb**2)
    velocity = np.stack([level * np.cos(heading) + wind[:, 0], level * np.sin(heading) + wind[:, 1], -climb], axis=-1)
    roll, pitch = np.arctan(rate * airspeed / 9.81), np.arcsin(climb / airspeed)
    return ride(time, velocity, ins.from_angles(roll, pitch, heading), START, wind)


def _direction(generator: np.random.Generator) -> Floats:
    angle = generator.uniform(0.0, 2.0 * math.pi)
    return np.array([math.cos(angle), math.sin(angle)])


def wandering(
    generator: np.random.Generator, time_s: Floats, mean: float, sigma: float, over_s: float, least: float, most: float
) -> Floats:
    """A smooth random course of a quantity: knots every `over_s`, between bounds."""
    knots = np.arange(time_s[0] - 3 * over_s, time_s[-1] + 3 * over_s, over_s)
    return _smooth(knots, np.clip(mean + sigma * generator.standard_normal(len(knots)), least, most), time_s)


def bends(generator: np.random.Generator, time_s: Floats, fastest: float) -> Floats:
    """Rates of turn: straight half of the time, bends of 4 to 12 s."""
    knots = np.arange(time_s[0] - 12.0, time_s[-1] + 12.0, 4.0)
    chosen = generator.uniform(-fastest, fastest, len(knots)) * (generator.random(len(knots)) < 0.4)
    return _smooth(knots, chosen, time_s)


def _smooth(knots: Floats, values: Floats, time_s: Floats) -> Floats:
    """Between the knots with a continuous derivative, and never beyond them."""
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(knots, values)(time_s))
