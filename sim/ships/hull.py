"""A ship's answer to her rudder: Nomoto's first-order model, the steering gear's limits, and where that carries her.

    T r' + r + a r^3 = K (rudder + wind),    heading' = r

`wind` is the steady turning moment of the wind as the rudder angle that makes the same; a is Norrbin's term, 0 for Nomoto's
model as printed. K grows with the speed through the water, T falls with it. Rudder and rate count clockwise, as compass
headings do: positive rudder turns to starboard. Everything is elementwise over (...), many ships or many runs at once.

Source: 002-5. Deviation: the print names no model; Nomoto's is the field's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

STEERAGE_MPS = 0.5  # slower than this a rudder does no more than at this speed, and T grows no more


@dataclass(frozen=True, slots=True)
class Hull:
    """What a ship is: length, the speed at which K and T hold, and what her steering gear can do."""

    length_m: float = 160.0
    speed_mps: float = 7.7
    gain_per_s: float = 0.072  # K
    lag_s: float = 41.6  # T
    norrbin_s2: float = 0.0  # a, s2/rad2
    rudder_limit_rad: float = math.radians(35.0)
    rudder_rate_radps: float = math.radians(2.5)

    def gain_at(self, speed_mps: ArrayLike) -> Floats:
        """K (...) at speeds through the water (...), 1/s."""
        return np.asarray(self.gain_per_s * np.maximum(speed_mps, STEERAGE_MPS) / self.speed_mps)

    def lag_at(self, speed_mps: ArrayLike) -> Floats:
        """T (...) at speeds through the water (...), s."""
        return np.asarray(self.lag_s * self.speed_mps / np.maximum(speed_mps, STEERAGE_MPS))


@dataclass(frozen=True, slots=True)
class Ship:
    """How ships (...) are moving: place on the plane, heading (not wrapped), rate of turn, rudder, speed through the water."""

    east_m: Floats
    north_m: Floats
    heading_rad: Floats
    rate_radps: Floats
    rudder_rad: Floats
    speed_mps: Floats

    @classmethod
    def under_way(
        cls, shape: tuple[int, ...], speed_mps: ArrayLike, heading_rad: ArrayLike = 0.0, east_m: ArrayLike = 0.0
    ) -> Ship:
        """Ships on a steady heading, rudders amidships."""
        heading, speed, east = (
            np.broadcast_to(np.asarray(one, dtype=np.float64), shape).copy() for one in (heading_rad, speed_mps, east_m)
        )
        return cls(east, np.zeros(shape), heading, np.zeros(shape), np.zeros(shape), speed)


@dataclass(frozen=True, slots=True)
class Weather:
    """What acts on ships steadily: the wind as rudder angle (...), the current (..., 2) east, north in m/s."""

    wind_rudder_rad: Floats | float = 0.0
    current_mps: Floats | tuple[float, float] = (0.0, 0.0)


def swing(hull: Hull, rudder_rad: Floats, ordered_rad: ArrayLike, step_s: float) -> Floats:
    """Where rudders (...) are a step after an order: towards it, no faster than the gear can, never beyond its stops."""
    wanted = np.clip(ordered_rad, -hull.rudder_limit_rad, hull.rudder_limit_rad)
    most = hull.rudder_rate_radps * step_s
    return np.asarray(rudder_rad + np.clip(wanted - rudder_rad, -most, most))


def sail(hull: Hull, ship: Ship, ordered_rad: ArrayLike, weather: Weather, step_s: float) -> Ship:
    """Ships a step later, under a rudder order (...). Heun's rule for the rate, the mean heading for the way."""
    rudder = swing(hull, ship.rudder_rad, ordered_rad, step_s)
    gain, lag = hull.gain_at(ship.speed_mps), hull.lag_at(ship.speed_mps)

    def turning(rate: Floats, angle: Floats) -> Floats:
        drag = rate + hull.norrbin_s2 * rate**3
        return np.asarray((gain * (angle + weather.wind_rudder_rad) - drag) / lag)

    before = turning(ship.rate_radps, ship.rudder_rad)
    after = turning(ship.rate_radps + before * step_s, rudder)
    rate = ship.rate_radps + 0.5 * step_s * (before + after)
    heading = ship.heading_rad + 0.5 * step_s * (ship.rate_radps + rate)
    east_mps, north_mps = ground_velocity(ship, weather, 0.5 * (ship.heading_rad + heading))
    return replace(
        ship,
        east_m=ship.east_m + east_mps * step_s,
        north_m=ship.north_m + north_mps * step_s,
        heading_rad=heading,
        rate_radps=rate,
        rudder_rad=rudder,
    )


def ground_velocity(ship: Ship, weather: Weather, heading_rad: Floats | None = None) -> tuple[Floats, Floats]:
    """Velocity over the ground (...), east and north, m/s: the way through the water and the current."""
    heading = ship.heading_rad if heading_rad is None else heading_rad
    current = np.asarray(weather.current_mps, dtype=np.float64)
    east = ship.speed_mps * np.sin(heading) + current[..., 0]
    return np.asarray(east), np.asarray(ship.speed_mps * np.cos(heading) + current[..., 1])
