"""What a vehicle's sensors make of the truth: satellite position, inertial unit, pressure; each with noise and a slow error.

The position that the vehicle tells of itself (GLOBAL_POSITION_INT) has the receiver's slow error without its noise: that of a
filter that follows the receiver with the inertial unit's help.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim.inertial import Errors
from sim.vehicles.motion import Moment, Vector

_DRAWN_AT_ONCE = 1200
_SEA_HPA, _SEA_KELVIN, _LAPSE, _POWER = 1013.25, 288.15, 0.0065, 5.25588
_DENSITY = 1.225


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """One standard deviation each; `slow` errors are first-order Gauss-Markov over `slow_s`."""

    slow_m: float = 0.8  # an axis; upwards half as much again
    slow_s: float = 120.0
    position_m: float = 0.4
    velocity_mps: float = 0.08
    pressure_hpa: float = 0.03
    airspeed_mps: float = 0.3
    inertial: Errors = field(default_factory=Errors)


@dataclass(frozen=True, slots=True)
class Fix:
    """A position as told: metres off the truth (north, east, down), and the velocity (north, east, down)."""

    off_m: Vector
    velocity_mps: Vector


@dataclass(slots=True)
class Sensors:
    """One vehicle's. A fault is made from outside: `has_fix` switched off, or `spoofed_m` (north, east, down) put on."""

    errors: SensorErrors
    generator: np.random.Generator
    has_fix: bool = True
    spoofed_m: Vector = (0.0, 0.0, 0.0)
    _slow: Vector = (0.0, 0.0, 0.0)
    _at_s: float = 0.0
    _rate_bias: Vector = (0.0, 0.0, 0.0)
    _force_bias: Vector = (0.0, 0.0, 0.0)
    _drawn: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        told = self.errors.inertial
        self._rate_bias = self._noise(told.rate_bias_radps)
        self._force_bias = self._noise(told.force_bias_mps2)
        north, east, down = self._noise(self.errors.slow_m)
        self._slow = (north, east, 1.5 * down)

    def fix(self, moment: Moment, *, is_smooth: bool) -> Fix:
        """What is told of the position now: the receiver's own, or (`is_smooth`) the vehicle's."""
        self._drift(moment.time_s)
        north, east, down = (slow + spoof for slow, spoof in zip(self._slow, self.spoofed_m, strict=True))
        if is_smooth:
            return Fix((north, east, down), moment.velocity_mps)
        a, b, c = self._noise(self.errors.position_m)
        d, e, f = self._noise(self.errors.velocity_mps)
        x, y, z = moment.velocity_mps
        return Fix((north + a, east + b, down + 1.5 * c), (x + d, y + e, z + f))

    def inertial(self, moment: Moment, step_s: float) -> tuple[Vector, Vector]:
        """Rates and specific force of the step that has ended, along the body."""
        told, per = self.errors.inertial, 1.0 / math.sqrt(step_s)
        (a, b, c), (d, e, f) = self._noise(told.rate_noise * per), self._rate_bias
        (g, h, i), (j, k, m) = self._noise(told.force_noise * per), self._force_bias
        (p, q, r), (x, y, z) = moment.rate_radps, moment.force_mps2
        return (p + a + d, q + b + e, r + c + f), (x + g + j, y + h + k, z + i + m)

    def pressure_hpa(self, altitude_msl_m: float) -> float:
        """Static pressure of the standard atmosphere."""
        noise, _, _ = self._noise(self.errors.pressure_hpa)
        return float(_SEA_HPA * (1.0 - _LAPSE * altitude_msl_m / _SEA_KELVIN) ** _POWER) + noise

    def airspeed_mps(self, airspeed_mps: float) -> float:
        """Indicated, taken as true airspeed; never below nothing."""
        noise, _, _ = self._noise(self.errors.airspeed_mps)
        return max(airspeed_mps + noise, 0.0)

    def _drift(self, time_s: float) -> None:
        """The slow error has gone on since it was asked for last."""
        keeps = math.exp(-(time_s - self._at_s) / self.errors.slow_s)
        self._at_s = time_s
        (north, east, down), (a, b, c) = (
            self._slow,
            self._noise(self.errors.slow_m * math.sqrt(max(1.0 - keeps * keeps, 0.0))),
        )
        self._slow = (keeps * north + a, keeps * east + b, keeps * down + 1.5 * c)

    def _noise(self, sigma: float) -> Vector:
        if len(self._drawn) < 3:
            self._drawn = self.generator.standard_normal(_DRAWN_AT_ONCE).tolist()
        draw = self._drawn.pop
        return sigma * draw(), sigma * draw(), sigma * draw()


def dynamic_pressure_hpa(airspeed_mps: float) -> float:
    """Of air of the standard density."""
    return 0.5 * _DENSITY * airspeed_mps * airspeed_mps / 100.0
