"""What vehicles on rides tell, as a gateway hears it: inertial samples, attitudes, air data, and positions that may be false.

Positions are an autopilot's: their errors last, and receivers' wander by a metre or two. Source: 002-4.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import inertial as ins
from gateway.observation import AirData, Attitude, GpsReport, Heard, ImuSample, Many, Observation, VehicleStatus
from sim.inertial import Errors, Ride, measured

Floats = NDArray[np.float64]

TENTH_NS = 100_000_000
AUTOPILOT_RAD = (math.radians(0.5), math.radians(0.5), math.radians(1.0))
LASTS_S = 30.0
WANDERS_M, WANDERS_FOR_S, NOISE_M, NOISE_MPS = 1.0, 60.0, 0.3, 0.1

Falsified = Callable[[float], tuple[float, float, float, float] | None]
"""By seconds: metres north and east that positions are off by, and m/s that their velocities are; None: nothing is told."""


def honest(_: float) -> tuple[float, float, float, float]:
    """Nothing is false."""
    return 0.0, 0.0, 0.0, 0.0


@dataclass(frozen=True, slots=True)
class Teller:
    """One vehicle: its ride, and what it says of it."""

    aircraft: str
    vehicle_type: int
    ride: Ride
    rate_radps: Floats
    force_mps2: Floats
    attitude: Floats  # (n, 4) as its autopilot has it
    off_m: Floats  # (tenths, 3) of its positions
    off_mps: Floats
    airspeed_mps: Floats | None
    falsified: Falsified = honest

    @classmethod
    def of(
        cls,
        aircraft: str,
        vehicle_type: int,
        ride: Ride,
        generator: np.random.Generator,
        falsified: Falsified = honest,
        errors: Errors = Errors(),
    ) -> Teller:
        """With a unit, an autopilot and a receiver as usual."""
        rate, force = measured(ride, errors, generator)
        count = len(ride.time_s)
        step_s = float(ride.time_s[1] - ride.time_s[0])
        leaning = np.array(AUTOPILOT_RAD) * lasting(generator, count, step_s / LASTS_S)
        tenths = round(float(ride.time_s[-1]) * 10.0) + 1
        wandering = WANDERS_M * lasting(generator, tenths, 0.1 / WANDERS_FOR_S)
        airspeed = None
        if vehicle_type == 1:
            through = ride.motion.velocity_mps.copy()
            through[:, :2] -= ride.wind_mps
            thin = (1.0 - 2.255_77e-5 * ride.motion.height_m) ** 2.127_95
            airspeed = np.linalg.norm(through, axis=1) * thin + 0.3 * generator.standard_normal(count)
        return cls(
            aircraft,
            vehicle_type,
            ride,
            rate,
            force,
            ins.product(ins.turned_by(leaning), ride.motion.attitude),
            wandering + NOISE_M * generator.standard_normal((tenths, 3)),
            NOISE_MPS * generator.standard_normal((tenths, 3)),
            airspeed,
            falsified,
        )


def lasting(generator: np.random.Generator, count: int, share: float) -> Floats:
    """Errors (count, 3) of variance one that forget a share from one to the next."""
    from scipy.signal import lfilter

    keep = math.exp(-share)
    shaken = generator.standard_normal((count, 3))
    shaken[1:] *= math.sqrt(1.0 - keep * keep)
    return np.asarray(lfilter([1.0], [1.0, -keep], shaken, axis=0))


def heard(tellers: Sequence[Teller], start: int, report_every: int = 2) -> Iterator[Heard]:
    """What is heard of all of them, tenth of a second by tenth, each 20 ms after it was so; positions every so many tenths."""
    tenths = min(len(one.off_m) for one in tellers)
    per = round(0.1 / float(tellers[0].ride.time_s[1]))
    for tenth in range(1, tenths):
        at = start + tenth * TENTH_NS
        said: list[Observation] = []
        for one in tellers:
            said += _samples(one, (tenth - 1) * per, tenth * per, at)
            said += _state(one, tenth * per, tenth, at, tenth % report_every == 0)
        yield Heard(at + 20_000_000, tuple(said))


def _samples(one: Teller, first: int, end: int, at: int) -> list[Observation]:
    n = end - first
    steps = TENTH_NS // n
    middle = at - TENTH_NS + steps // 2 + steps * np.arange(n)
    columns = {
        "aircraft": np.array([one.aircraft] * n, object),
        "valid_at": middle,
        "received_at": np.full(n, at + 20_000_000),
        "sensor": np.ones(n, np.int64),
        "acceleration_mps2": one.force_mps2[first:end],
        "angular_rate_radps": one.rate_radps[first:end],
    }
    return [Many(ImuSample, columns)]


def _state(one: Teller, place: int, tenth: int, at: int, reports: bool) -> list[Observation]:
    now, motion = at + 20_000_000, one.ride.motion
    said: list[Observation] = [Attitude(one.aircraft, at, now, *_angles(one.attitude[place]))]
    if tenth % 10 == 1:
        said.append(VehicleStatus(one.aircraft, at, now, one.vehicle_type, 3, True, 0))
    if one.airspeed_mps is not None:
        said.append(AirData(one.aircraft, at, now, airspeed_mps=float(one.airspeed_mps[place])))
    false = one.falsified(tenth / 10.0)
    if not reports or false is None:
        return said
    off = one.off_m[tenth] + np.array([false[0], false[1], 0.0])
    there = (motion.latitude_rad[place], motion.longitude_rad[place], motion.height_m[place])
    latitude, longitude, height = ins.displaced(*there, off)
    north, east, down = (motion.velocity_mps[place] + one.off_mps[tenth] + np.array([false[2], false[3], 0.0])).tolist()
    report = GpsReport(
        one.aircraft,
        at,
        now,
        float(latitude),
        float(longitude),
        height_m=float(height),
        velocity_east_mps=east,
        velocity_north_mps=north,
        velocity_up_mps=-down,
        horizontal_sigma_m=1.5,
        vertical_sigma_m=2.0,
    )
    return [*said, report]


def _angles(attitude: Floats) -> tuple[float, float, float]:
    w, x, y, z = attitude.tolist()
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    return roll, pitch, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
