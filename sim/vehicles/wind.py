"""Wind as a vehicle meets it: a mean, and gusts.

Gusts are three first-order Gauss-Markov processes, Dryden's form for the component along the flight, whose length the vehicle
flies through at its airspeed: time constant = length / airspeed. Source: MIL-F-8785C 3.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from sim.vehicles.motion import Vector

_DRAWN_AT_ONCE = 768  # a scalar draw costs ten times one of many
_SLOWEST_MPS = 3.0  # who stands meets gusts as the wind carries them past


@dataclass(frozen=True, slots=True)
class WindParameters:
    """Mean wind, where from, and gusts: one standard deviation an axis (vertical: half of it) and their length."""

    speed_mps: float = 0.0
    from_rad: float = 0.0  # true
    gust_sigma_mps: float = 0.0
    gust_length_m: float = 200.0


@dataclass(slots=True)
class Wind:
    """The air's own velocity where one vehicle is, north, east, down, m/s."""

    parameters: WindParameters
    generator: np.random.Generator
    velocity_mps: Vector = (0.0, 0.0, 0.0)
    _gust: Vector = (0.0, 0.0, 0.0)
    _drawn: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._add()

    def step(self, step_s: float, airspeed_mps: float) -> Vector:
        """One step further, for a vehicle of this airspeed; the wind there."""
        sigma = self.parameters.gust_sigma_mps
        if sigma > 0.0:
            if len(self._drawn) < 3:
                self._drawn = self.generator.standard_normal(_DRAWN_AT_ONCE).tolist()
            speed = max(airspeed_mps, self.parameters.speed_mps, _SLOWEST_MPS)
            keeps = math.exp(-step_s * speed / self.parameters.gust_length_m)
            new = sigma * math.sqrt(1.0 - keeps * keeps)
            draw = self._drawn.pop
            north, east, down = self._gust
            self._gust = (
                keeps * north + new * draw(),
                keeps * east + new * draw(),
                keeps * down + 0.5 * new * draw(),
            )
            self._add()
        return self.velocity_mps

    def _add(self) -> None:
        speed, where_from = self.parameters.speed_mps, self.parameters.from_rad
        north, east, down = self._gust
        self.velocity_mps = (
            north - speed * math.cos(where_from),
            east - speed * math.sin(where_from),
            down,
        )
