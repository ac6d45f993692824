"""An aeroplane's answer to its controls: a point mass in coordinated flight, with lags of roll, path, pitch and thrust.

    V'   = g (T d - D - sin climb)      T d: thrust over weight at throttle d; D: drag over weight, half of it induced at cruise
    yaw' = g tan bank / V               the wings' pull, so that a ball stays in the middle
    air  = V (cos climb cos yaw, cos climb sin yaw, -sin climb),    over the ground: + the wind that the mass has followed

The mass follows a gust within `_FOLLOWS_S`; until then the gust is airspeed. The nose follows the air's direction (or, on wheels,
the ground's) within a second, so that there is no jump at lift-off and touch-down in a crosswind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.body import Body, wrapped
from sim.vehicles.motion import Vector

_ROLL_S, _ROLL_RATE_S, _PATH_S, _PITCH_S, _THRUST_S, _FOLLOWS_S, _ALIGNS_S = 0.5, 0.15, 0.6, 0.4, 0.5, 1.5, 1.0
_PULL, _PUSH = 0.6, 0.5  # g more and less than level flight
_LIFT = 1.2  # the most that the wings carry at the slowest speed, over weight
_NO_DRAUGHT_M = 30.0
_ATTACK_RAD = math.radians(4.0)  # angle of attack at cruise
_ROLLING, _BRAKING = 0.03, 0.2  # of the weight
_SLOWEST_MPS = 5.0  # below this nothing flies, and formulas must still hold


@dataclass(frozen=True, slots=True)
class AeroplaneParameters:
    """What an aeroplane is like. The defaults are an unmanned one of some ten kilograms."""

    cruise_mps: float = 22.0
    slowest_mps: float = 15.0
    fastest_mps: float = 32.0
    approach_mps: float = 18.0
    thrust: float = 0.4  # largest, over weight
    drag: float = 0.09  # over weight at cruise
    climb_mps: float = 4.0
    sink_mps: float = 4.0
    bank_rad: float = math.radians(45.0)
    roll_rate_radps: float = math.radians(75.0)


AIRLINER = AeroplaneParameters(
    110.0, 65.0, 140.0, 72.0, 0.28, 0.065, 12.0, 10.0, math.radians(30.0), math.radians(15.0)
)


class Controls(NamedTuple):
    """What the pilot asks for. `turn_radps` is the nose wheel's, on the ground only."""

    bank_rad: float = 0.0
    climb_rad: float = 0.0
    throttle: float = 0.0
    turn_radps: float = 0.0
    is_braking: bool = False
    may_lift: bool = False


@dataclass(slots=True)
class Aeroplane:
    """One aeroplane. It stands at first. `airspeed_mps` is that of the mass, without the gust that it has not followed yet."""

    parameters: AeroplaneParameters
    body: Body
    ground_m: float  # height of the ground where it takes off or lands
    is_on_ground: bool = True
    airspeed_mps: float = 0.0
    climb_rad: float = 0.0
    throttle: float = 0.0
    _way_rad: float = 0.0  # direction through the air; on the ground along it
    _slip_rad: float = 0.0  # yaw less that direction
    _roll_radps: float = 0.0
    _air_mps: Vector = (0.0, 0.0, 0.0)  # wind that the mass has followed

    def __post_init__(self) -> None:
        self._way_rad = self.body.attitude_rad[2]

    def drag(self, speed_mps: float, load: float = 1.0) -> float:
        """Drag over weight at an airspeed and load factor."""
        ratio = speed_mps / self.parameters.cruise_mps
        return 0.5 * self.parameters.drag * (ratio * ratio + (load / ratio) ** 2)

    def felt_airspeed(self, wind_mps: Vector) -> float:
        """What a Pitot tube tells."""
        return math.dist(self.body.velocity_mps, wind_mps) if not self.is_on_ground else self._on_wheels(wind_mps)

    def step(self, controls: Controls, wind_mps: Vector, step_s: float) -> None:
        """One step further."""
        follows = step_s / _FOLLOWS_S
        north, east, down = self._air_mps
        near = min((self.body.height_m - self.ground_m) / _NO_DRAUGHT_M, 1.0)  # air does not blow through the ground
        self._air_mps = (
            north + (wind_mps[0] - north) * follows,
            east + (wind_mps[1] - east) * follows,
            down + (wind_mps[2] * near - down) * follows,
        )
        self.throttle += (controls.throttle - self.throttle) * step_s / _THRUST_S
        self._slip_rad -= self._slip_rad * step_s / _ALIGNS_S
        if self.is_on_ground:
            self._roll_out(controls, wind_mps, step_s)
        else:
            self._fly(controls, step_s)

    def _fly(self, controls: Controls, step_s: float) -> None:
        p, (roll, pitch, _) = self.parameters, self.body.attitude_rad
        wanted = min(max((controls.bank_rad - roll) / _ROLL_S, -p.roll_rate_radps), p.roll_rate_radps)
        self._roll_radps += (wanted - self._roll_radps) * step_s / _ROLL_RATE_S
        roll += self._roll_radps * step_s
        speed = max(self.airspeed_mps, _SLOWEST_MPS)
        pull = (controls.climb_rad - self.climb_rad) / _PATH_S * speed / STANDARD_GRAVITY_MPS2
        stalls_at = (speed / p.slowest_mps) ** 2 * _LIFT * math.cos(roll) - math.cos(self.climb_rad)
        pull = max(min(pull, _PULL, stalls_at), -_PUSH)
        self.climb_rad += pull * STANDARD_GRAVITY_MPS2 / speed * step_s
        load = (math.cos(self.climb_rad) + pull) / math.cos(roll)
        excess = p.thrust * self.throttle - self.drag(speed, load) - math.sin(self.climb_rad)
        self.airspeed_mps = max(self.airspeed_mps + STANDARD_GRAVITY_MPS2 * excess * step_s, _SLOWEST_MPS)
        self._way_rad = wrapped(self._way_rad + STANDARD_GRAVITY_MPS2 * math.tan(roll) / speed * step_s)
        attack = _ATTACK_RAD * load * (p.cruise_mps / speed) ** 2
        pitch += (self.climb_rad + attack * math.cos(roll) - pitch) * step_s / _PITCH_S
        level = self.airspeed_mps * math.cos(self.climb_rad)
        velocity = (
            level * math.cos(self._way_rad) + self._air_mps[0],
            level * math.sin(self._way_rad) + self._air_mps[1],
            -self.airspeed_mps * math.sin(self.climb_rad) + self._air_mps[2],
        )
        if velocity[2] > 0.0 and self.body.height_m - velocity[2] * step_s <= self.ground_m:
            velocity = self._touch(velocity, step_s)
        self.body.move(velocity, (roll, pitch, wrapped(self._way_rad + self._slip_rad)), step_s)

    def _touch(self, velocity: Vector, step_s: float) -> Vector:
        yaw = self._way_rad + self._slip_rad
        self._way_rad = math.atan2(velocity[1], velocity[0])
        self._slip_rad = wrapped(yaw - self._way_rad)
        self.is_on_ground, self._roll_radps, self.climb_rad = True, 0.0, 0.0
        return velocity[0], velocity[1], (self.body.height_m - self.ground_m) / step_s

    def _roll_out(self, controls: Controls, wind_mps: Vector, step_s: float) -> None:
        north, east, _ = self.body.velocity_mps
        speed = math.hypot(north, east)
        self.airspeed_mps = self._on_wheels(wind_mps)
        held = _ROLLING + (_BRAKING if controls.is_braking else 0.0)
        drag = 0.5 * self.parameters.drag * (self.airspeed_mps / self.parameters.cruise_mps) ** 2
        speed = max(
            speed + STANDARD_GRAVITY_MPS2 * (self.parameters.thrust * self.throttle - held - drag) * step_s, 0.0
        )
        if speed > 0.0:
            self._way_rad = wrapped(self._way_rad + controls.turn_radps * step_s)
        roll, pitch, _ = self.body.attitude_rad
        roll -= roll * step_s / _ROLL_S
        pitch -= pitch * step_s / _PITCH_S
        velocity = (speed * math.cos(self._way_rad), speed * math.sin(self._way_rad), 0.0)
        self.body.move(velocity, (roll, pitch, wrapped(self._way_rad + self._slip_rad)), step_s)
        if controls.may_lift and self.airspeed_mps >= 1.1 * self.parameters.slowest_mps:
            self._lift(velocity)

    def _lift(self, velocity: Vector) -> None:
        yaw = self._way_rad + self._slip_rad
        north, east = velocity[0] - self._air_mps[0], velocity[1] - self._air_mps[1]
        self._way_rad, self.airspeed_mps = math.atan2(east, north), math.hypot(north, east)
        self._slip_rad = wrapped(yaw - self._way_rad)
        # the mass has not followed the air's own sinking while wheels carried it
        self.is_on_ground, self._air_mps, self.climb_rad = False, (self._air_mps[0], self._air_mps[1], 0.0), 0.0

    def _on_wheels(self, wind_mps: Vector) -> float:
        """Airspeed along the aeroplane while it rolls: a tube feels nothing from behind."""
        north, east, _ = self.body.velocity_mps
        yaw = self.body.attitude_rad[2]
        return max((north - wind_mps[0]) * math.cos(yaw) + (east - wind_mps[1]) * math.sin(yaw), 0.0)
