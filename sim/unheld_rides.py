"""Rides of what neither wings nor wheels hold: a multirotor in gusts, a boat in waves and a current; and units that shake.

The multirotor is the one of `sim.vehicles`, flown by a pilot who wants velocities; a boat skids in bends, rolls, pitches and
heaves, and the water that it moves through moves too. Source: 002-4, tried where nothing holds the velocity.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import inertial as ins
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.inertial import START, Errors, Ride, bends, ride, wandering
from sim.vehicles.body import Body
from sim.vehicles.rotorcraft import Rotorcraft, RotorcraftParameters, Thrust
from sim.vehicles.wind import Wind, WindParameters

Floats = NDArray[np.float64]

ROTORS = Errors(
    rate_bias_radps=math.radians(0.3),
    force_bias_mps2=0.1,
    rate_noise=math.radians(0.3),
    force_noise=0.15,
    rate_wanders_radps=math.radians(0.1),
    force_wanders_mps2=0.1,
)
"""A MEMS unit between rotors: they shake it by 1 m/s2 and 2 degrees a second from sample to sample, and rectify themselves."""

MOTOR = Errors(
    rate_bias_radps=math.radians(0.3),
    force_bias_mps2=0.1,
    rate_noise=math.radians(0.05),
    force_noise=0.05,
    rate_wanders_radps=math.radians(0.1),
    force_wanders_mps2=0.05,
)
"""The same beside the motor of a boat."""

_HOVERS, _LEG_S = 0.4, 12.0  # the share of legs that it hovers for, and how long one takes
_PULL_PER_S, _TRIM_PER_S2 = 1.0, 0.15  # how a pilot makes good what is missing of a velocity


def copter(generator: np.random.Generator, length_s: float, rate_hz: float = 50.0) -> Ride:
    """A multirotor that hovers, and flies legs of up to 12 m/s any way, in a gusty wind of 3 to 9 m/s, its nose anywhere."""
    time = np.arange(0.0, length_s + 0.5 / rate_hz, 1.0 / rate_hz)
    legs = int(length_s / _LEG_S) + 2
    speed = generator.uniform(2.0, 12.0, legs) * (generator.random(legs) > _HOVERS)
    course, nose = generator.uniform(0.0, 2.0 * math.pi, legs), generator.uniform(0.0, 2.0 * math.pi, legs)
    climb = generator.uniform(-1.5, 2.0, legs) * (generator.random(legs) < 0.3)
    mean = generator.uniform(3.0, 9.0)
    wind = Wind(WindParameters(mean, generator.uniform(0.0, 2.0 * math.pi), 0.2 * mean, 100.0), generator)
    body = Body(START[0], START[1], START[2], (0.0, 0.0, float(nose[0])))
    rotors = Rotorcraft(RotorcraftParameters(), body, START[2] - 100.0, is_on_ground=False)
    velocity, angles, air = (np.empty((len(time), 3)) for _ in range(3))
    trim = [0.0, 0.0]
    for place, now in enumerate(time.tolist()):
        leg = int(now / _LEG_S)
        velocity[place], angles[place], air[place] = body.velocity_mps, body.attitude_rad, wind.velocity_mps
        wanted = speed[leg] * math.cos(course[leg]), speed[leg] * math.sin(course[leg])
        missing = [one - other for one, other in zip(wanted, body.velocity_mps, strict=False)]
        trim = [min(max(one + _TRIM_PER_S2 * off / rate_hz, -2.0), 2.0) for one, off in zip(trim, missing, strict=True)]
        pull = [min(max(_PULL_PER_S * off, -3.0), 3.0) + more for off, more in zip(missing, trim, strict=True)]
        thrust = Thrust(float(pull[0]), float(pull[1]), float(climb[leg]), float(nose[leg]), is_flying=True)
        rotors.step(thrust, wind.step(1.0 / rate_hz, math.hypot(*missing)), 1.0 / rate_hz)
    return ride(time, velocity, ins.from_angles(*angles.T), START, air[:, :2])


def boat(generator: np.random.Generator, length_s: float, rate_hz: float = 50.0) -> Ride:
    """A motor boat of 2 to 8 m/s that skids to the outside of bends, in waves of half a metre and a current of up to 1 m/s."""
    time = np.arange(0.0, length_s + 0.5 / rate_hz, 1.0 / rate_hz)
    speed = wandering(generator, time, 5.0, 2.0, 15.0, 2.0, 8.0)
    rate = bends(generator, time, 0.2)
    heading = generator.uniform(0.0, 2.0 * math.pi) + np.concatenate([[0.0], np.cumsum(rate[1:] / rate_hz)])
    skids = -speed * np.tan(np.clip(1.2 * rate, -0.4, 0.4)) + wandering(generator, time, 0.0, 0.15, 20.0, -0.4, 0.4)
    current = [wandering(generator, time, mean, 0.15, 120.0, -1.2, 1.2) for mean in generator.uniform(-0.7, 0.7, 2)]
    north, east, up, slope_north, slope_east = _waves(generator, time, speed, heading)
    cosine, sine = np.cos(heading), np.sin(heading)
    velocity = np.stack(
        [
            speed * cosine - skids * sine + current[0] + north,
            speed * sine + skids * cosine + current[1] + east,
            -up,
        ],
        axis=-1,
    )
    pitch = 0.7 * (slope_north * cosine + slope_east * sine) + 0.006 * speed  # the faster, the higher its bow
    roll = 1.2 * (slope_east * cosine - slope_north * sine) - 0.1 * rate * speed
    return ride(time, velocity, ins.from_angles(roll, pitch, heading), START, np.stack(current, axis=-1))


def _waves(
    generator: np.random.Generator, time_s: Floats, speed_mps: Floats, heading_rad: Floats
) -> tuple[Floats, ...]:
    """Of a sea as a boat meets it: the water's velocity north, east and up, and the slopes that lift it to north and to east.

    Five deep-water waves about one direction: the phase goes by with their speed less the boat's way along them.
    """
    found = [np.zeros_like(time_s) for _ in range(5)]
    step_s = float(time_s[1] - time_s[0])
    mean = generator.uniform(0.0, 2.0 * math.pi)
    for _ in range(5):
        pulsation = generator.uniform(0.8, 2.0)  # rad/s
        height_m, number = 0.12 / pulsation, pulsation**2 / STANDARD_GRAVITY_MPS2
        goes = mean + 0.4 * generator.standard_normal()
        met = pulsation - number * speed_mps * np.cos(heading_rad - goes)
        phase = generator.uniform(0.0, 2.0 * math.pi) + np.cumsum(met) * step_s
        along = height_m * pulsation * np.cos(phase)
        slope = number * height_m * np.sin(phase)
        for place, more in enumerate(
            (
                along * math.cos(goes),
                along * math.sin(goes),
                height_m * met * np.sin(phase),
                slope * math.cos(goes),
                slope * math.sin(goes),
            )
        ):
            found[place] = found[place] + more
    return tuple(found)
