"""What hangs from rotors, helicopters and multirotors: thrust tilts with a lag, the air drags, and it can stand still.

v' = a - k (v - wind)     a: level part of the thrust over mass; follows its order through two lags (the tilt's and its rate's)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.body import Body, wrapped
from sim.vehicles.motion import Vector

_YAW_S = 0.5


@dataclass(frozen=True, slots=True)
class RotorcraftParameters:
    """What it is like; the defaults are a quadrotor of some kilograms."""

    cruise_mps: float = 10.0
    accelerates_mps2: float = 3.0
    tilt_rad: float = math.radians(35.0)
    tilt_lag_s: float = 0.12  # each of two
    climb_lag_s: float = 0.3  # each of two
    climb_mps: float = 3.0
    sink_mps: float = 2.0
    drag_per_s: float = 0.12
    yaw_rate_radps: float = math.radians(60.0)


HELI = RotorcraftParameters(25.0, 2.5, math.radians(30.0), 0.3, 0.5, 5.0, 3.0, 0.06, math.radians(30.0))


class Thrust(NamedTuple):
    """What the pilot asks for: acceleration by tilting, north and east; climb rate; heading. Nothing while it stands."""

    north_mps2: float = 0.0
    east_mps2: float = 0.0
    climb_mps: float = 0.0
    heading_rad: float | None = None
    is_flying: bool = False


@dataclass(slots=True)
class Rotorcraft:
    """One of them. It stands at first."""

    parameters: RotorcraftParameters
    body: Body
    ground_m: float
    is_on_ground: bool = True
    throttle: float = 0.0
    _tilting: tuple[float, float] = (0.0, 0.0)
    _tilt: tuple[float, float] = (0.0, 0.0)  # the acceleration that it makes, north and east
    _climbing: float = 0.0
    _yaw_radps: float = 0.0

    def felt_airspeed(self, wind_mps: Vector) -> float | None:
        """It has no Pitot tube."""
        return None

    def step(self, controls: Thrust, wind_mps: Vector, step_s: float) -> None:
        """One step further."""
        if self.is_on_ground and not (controls.is_flying and controls.climb_mps > 0.0):
            self._stand(step_s)
            return
        self.is_on_ground = False
        p, (north, east, down) = self.parameters, self.body.velocity_mps
        lag = step_s / p.tilt_lag_s
        (a, b), (c, d) = self._tilting, self._tilt
        a, b = a + (controls.north_mps2 - a) * lag, b + (controls.east_mps2 - b) * lag
        c, d = c + (a - c) * lag, d + (b - d) * lag
        self._tilting, self._tilt = (a, b), (c, d)
        north += (c - p.drag_per_s * (north - wind_mps[0])) * step_s
        east += (d - p.drag_per_s * (east - wind_mps[1])) * step_s
        slower = step_s / p.climb_lag_s
        self._climbing += (controls.climb_mps - self._climbing) * slower
        rising = (self._climbing + down) * slower / step_s
        down -= rising * step_s
        if down > 0.0 and self.body.height_m - down * step_s <= self.ground_m:
            down = (self.body.height_m - self.ground_m) / step_s
            north = east = self._climbing = 0.0
            self.is_on_ground = True
        self.body.move((north, east, down), self._stance(controls, rising, step_s), step_s)
        lift = math.hypot(c, d, STANDARD_GRAVITY_MPS2 + rising) / STANDARD_GRAVITY_MPS2
        self.throttle = min(0.4 * lift, 1.0)

    def _stance(self, controls: Thrust, rising_mps2: float, step_s: float) -> Vector:
        """Roll, pitch and yaw of rotors that make this thrust."""
        p, yaw = self.parameters, self.body.attitude_rad[2]
        wanted = 0.0
        if controls.heading_rad is not None:
            wanted = min(max(wrapped(controls.heading_rad - yaw) / _YAW_S, -p.yaw_rate_radps), p.yaw_rate_radps)
        self._yaw_radps += (wanted - self._yaw_radps) * step_s / _YAW_S * 2.0
        yaw = wrapped(yaw + self._yaw_radps * step_s)
        north, east = self._tilt
        forward, right = north * math.cos(yaw) + east * math.sin(yaw), east * math.cos(yaw) - north * math.sin(yaw)
        up = STANDARD_GRAVITY_MPS2 + rising_mps2
        pitch = -math.atan2(forward, up)
        return math.atan2(right, math.hypot(forward, up)), pitch, yaw

    def _stand(self, step_s: float) -> None:
        self.throttle, self._tilting, self._tilt, self._yaw_radps = 0.0, (0.0, 0.0), (0.0, 0.0), 0.0
        roll, pitch, yaw = self.body.attitude_rad
        settles = 1.0 - step_s / 0.2
        self.body.move((0.0, 0.0, 0.0), (roll * settles, pitch * settles, yaw), step_s)
