"""A vehicle as a body that is carried over the earth, and what an inertial unit in it feels: the inverse of strapdown navigation.

Second order in the step, as `gateway.estimators.inertial.advanced`, whose inverse this is for one vehicle and one step;
`sim.inertial.ride` is the same over arrays of a way that is known beforehand. Source: 002-4 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gateway.estimators.inertial import EARTH_RATE_RADPS, gravity
from gateway.geodesy import meridian_radius_m, prime_vertical_radius_m
from sim.vehicles.motion import Home, Vector

_SAME_PLACE_RAD = 5e-5  # radii of curvature and gravity hold so far (300 m): better than 3e-7 of them
_FREE_AIR_PER_S2 = 3.086e-6  # how much gravity is less a metre higher


@dataclass(slots=True)
class Body:
    """Place, velocity (north, east, down), attitude (roll, pitch, yaw), and the means over the last step, along the body."""

    latitude_rad: float
    longitude_rad: float
    height_m: float
    attitude_rad: Vector
    velocity_mps: Vector = (0.0, 0.0, 0.0)
    rate_radps: Vector = (0.0, 0.0, 0.0)
    force_mps2: Vector = (0.0, 0.0, 0.0)
    meridian_m: float = 0.0
    vertical_m: float = 0.0  # radius in the prime vertical
    _gravity_mps2: float = 0.0  # on the ellipsoid
    _measured_at_rad: float = math.inf

    @classmethod
    def at(cls, home: Home) -> Body:
        """Standing at home."""
        return cls(home.latitude_rad, home.longitude_rad, home.height_m, (0.0, 0.0, home.heading_rad))

    def move(self, velocity_mps: Vector, attitude_rad: Vector, step_s: float) -> None:
        """Be carried on for a step, at whose end velocity and attitude are these."""
        if abs(self.latitude_rad - self._measured_at_rad) > _SAME_PLACE_RAD:
            self._measure()
        north, east, down = (0.5 * (one + other) for one, other in zip(self.velocity_mps, velocity_mps, strict=True))
        sine, cosine = math.sin(self.latitude_rad), math.cos(self.latitude_rad)
        along_meridian, along_parallel = self.meridian_m + self.height_m, self.vertical_m + self.height_m
        earth = (EARTH_RATE_RADPS * cosine, 0.0, -EARTH_RATE_RADPS * sine)
        about_north = east / along_parallel
        frame = (about_north, -north / along_meridian, -about_north * sine / cosine)
        to_body = _Middle(self.attitude_rad, attitude_rad, step_s)
        turning = to_body.turn((earth[0] + frame[0], frame[1], earth[2] + frame[2]))
        self.rate_radps = _sum(to_body.rate_radps, turning)
        about = (2.0 * earth[0] + frame[0], frame[1], 2.0 * earth[2] + frame[2])
        self.force_mps2 = to_body.turn(
            (
                (velocity_mps[0] - self.velocity_mps[0]) / step_s + about[1] * down - about[2] * east,
                (velocity_mps[1] - self.velocity_mps[1]) / step_s + about[2] * north - about[0] * down,
                (velocity_mps[2] - self.velocity_mps[2]) / step_s + about[0] * east - about[1] * north
                - (self._gravity_mps2 - _FREE_AIR_PER_S2 * self.height_m),
            )
        )  # fmt: skip
        further = self.latitude_rad + north * step_s / along_meridian
        middle = math.cos(0.5 * (self.latitude_rad + further))
        self.longitude_rad = wrapped(self.longitude_rad + east * step_s / (along_parallel * middle))
        self.latitude_rad = further
        self.height_m -= down * step_s
        self.velocity_mps, self.attitude_rad = velocity_mps, attitude_rad

    def _measure(self) -> None:
        self._measured_at_rad = self.latitude_rad
        self.meridian_m = float(meridian_radius_m(self.latitude_rad))
        self.vertical_m = float(prime_vertical_radius_m(self.latitude_rad))
        self._gravity_mps2 = float(gravity(self.latitude_rad, 0.0))


class _Middle:
    """The body's axes halfway through a step, and the rates of turn that lead from its beginning to its end."""

    __slots__ = ("_rows", "rate_radps")

    def __init__(self, before: Vector, after: Vector, step_s: float) -> None:
        roll, pitch = 0.5 * (before[0] + after[0]), 0.5 * (before[1] + after[1])
        turned = wrapped(after[2] - before[2])
        yaw = before[2] + 0.5 * turned
        rolling, pitching = (after[0] - before[0]) / step_s, (after[1] - before[1]) / step_s
        yawing = turned / step_s
        sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
        sy, cy = math.sin(yaw), math.cos(yaw)
        self.rate_radps = (rolling - yawing * sp, pitching * cr + yawing * sr * cp, yawing * cr * cp - pitching * sr)
        self._rows = (
            (cp * cy, cp * sy, -sp),
            (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp),
            (cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp),
        )

    def turn(self, vector: Vector) -> Vector:
        """A vector of north, east, down along the body."""
        x, y, z = vector
        (a, b, c), (d, e, f), (g, h, i) = self._rows
        return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def _sum(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi); `gateway.geodesy.wrap_rad` is the one over arrays."""
    return angle_rad - 2.0 * math.pi * math.floor((angle_rad + math.pi) / (2.0 * math.pi))
