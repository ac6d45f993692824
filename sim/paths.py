"""Flight paths: where an aircraft is over the ground, as closed functions of time over arrays.

A path lives on the ground plan of a runway: x along the main landing direction, y left, both as lengths of
the geodesic from the runway's centre (so a point at distance d and bearing b on the plan lies at distance d
and bearing b on the ellipsoid), and h, the height above the runway's centre, measured along the ellipsoid's
normal at the point. `sim.earth` lays it there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.settings import Runway

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Motion:
    """Position, velocity and acceleration on the ground plan, x, y, h each (..., 3); m, m/s, m/s2."""

    position: Floats
    velocity: Floats
    acceleration: Floats


class Path(Protocol):
    """An aircraft's way; before `start_s` and after `end_s` (seconds of the scene) it is not there."""

    @property
    def start_s(self) -> float:
        """The first instant at which the aircraft exists."""

    @property
    def end_s(self) -> float:
        """The instant from which it is gone; infinity for one that stands on the runway at the end."""

    def motion(self, time_s: ArrayLike) -> Motion:
        """Where it is at times (...), within start and end."""


FAR_M, NEAR_M, LAST_M = 50_000.0, 5_000.0, 1_500.0  # ground distances of 003's case
FAST_MPS, SLOW_MPS, BRAKING_M = 130.0, 72.0, 25_000.0
OFFSET_M, OFFSET_FROM_M, OFFSET_OVER_M = 6_000.0, 25_000.0, 22_000.0
PLATFORM_M = 1_200.0
_RATE = (FAST_MPS - SLOW_MPS) / BRAKING_M  # 1/s: while braking, speed falls exponentially in time
_BRAKE_AT_S = (FAR_M - NEAR_M - BRAKING_M) / FAST_MPS
_SLOW_AT_S = _BRAKE_AT_S + math.log(FAST_MPS / SLOW_MPS) / _RATE


@dataclass(frozen=True, slots=True)
class CasePath:
    """003's approach: from 50 km out and 6 km left onto the centreline, 1200 m, a 3 degree glide path, 457 s.

    The time law has a closed form, so positions are exact. With `lands`, the aircraft goes on from there:
    distances then count from the threshold (`origin_x_m`), the descent ends in a parabolic flare, and it
    rolls to a standstill on the centreline. Source: 003, the case.
    """

    origin_x_m: float = 0.0  # runway-frame x from which distances count: 0 is the paper's
    glide_path_rad: float = math.radians(3.0)
    crossing_height_m: float = 15.0
    lands: bool = False
    flare_m: float = 300.0  # half the ground distance over which the descent is rounded out
    braking_mps2: float = 2.0

    @classmethod
    def landing(cls, runway: Runway) -> CasePath:
        """The same approach flown to this runway's threshold and down to a standstill."""
        crossing_m = runway.threshold_crossing_height_m
        return cls(runway.threshold_x_m, runway.glide_path_rad, crossing_m, lands=True)

    @property
    def start_s(self) -> float:
        """Zero: the path begins 50 km out."""
        return 0.0

    @property
    def end_s(self) -> float:
        """When the distance of 1500 m is reached, 457.2 s; never for a path that lands."""
        return math.inf if self.lands else _SLOW_AT_S + (NEAR_M - LAST_M) / SLOW_MPS

    @property
    def touchdown_s(self) -> float:
        """When the wheels of a path that lands touch: the end of the flare."""
        return _SLOW_AT_S + (NEAR_M - self._touchdown_m) / SLOW_MPS

    @property
    def _aim_m(self) -> float:
        """Distance (negative: beyond the origin) at which the glide path would meet the runway."""
        return -self.crossing_height_m / math.tan(self.glide_path_rad)

    @property
    def _touchdown_m(self) -> float:
        return self._aim_m - self.flare_m

    def motion(self, time_s: ArrayLike) -> Motion:
        """Position, velocity, acceleration at times (...) from 0. Source: 003, the case."""
        distance, speed, braking = self._along(np.asarray(time_s, dtype=np.float64))
        u = np.clip((distance - OFFSET_FROM_M) / OFFSET_OVER_M, 0.0, 1.0)
        left = OFFSET_M * u * u * (3.0 - 2.0 * u)
        left_by_distance = OFFSET_M * 6.0 * u * (1.0 - u) / OFFSET_OVER_M
        inside = (u > 0.0) & (u < 1.0)
        left_by_distance_2 = np.where(inside, OFFSET_M * 6.0 * (1.0 - 2.0 * u) / OFFSET_OVER_M**2, 0.0)
        height, height_by_distance, height_by_distance_2 = self._height(distance)
        # d distance / dt = -speed, d2 distance / dt2 = braking
        velocity = [speed, -left_by_distance * speed, -height_by_distance * speed]
        square = speed * speed
        acceleration = [
            -braking,
            left_by_distance_2 * square + left_by_distance * braking,
            height_by_distance_2 * square + height_by_distance * braking,
        ]
        position = [self.origin_x_m - distance, left, height]
        return Motion(np.stack(position, -1), np.stack(velocity, -1), np.stack(acceleration, -1))

    def _along(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Ground distance, speed and deceleration: constant, exponential, constant, and the roll-out."""
        braked = np.clip(time - _BRAKE_AT_S, 0.0, _SLOW_AT_S - _BRAKE_AT_S)
        speed = FAST_MPS * np.exp(-_RATE * braked)
        distance = NEAR_M + (speed - SLOW_MPS) / _RATE
        distance = distance - FAST_MPS * np.minimum(time - _BRAKE_AT_S, 0.0)
        distance = distance - SLOW_MPS * np.maximum(time - _SLOW_AT_S, 0.0)
        braking = np.where((time >= _BRAKE_AT_S) & (time < _SLOW_AT_S), _RATE * speed, 0.0)
        if not self.lands:
            return distance, speed, braking
        stop_s = SLOW_MPS / self.braking_mps2
        rolling = np.clip(time - self.touchdown_s, 0.0, stop_s)
        on_ground = self._touchdown_m - SLOW_MPS * rolling + 0.5 * self.braking_mps2 * rolling * rolling
        rolls = time >= self.touchdown_s
        moving = rolls & (rolling < stop_s)
        distance = np.where(rolls, on_ground, distance)
        speed = np.where(rolls, np.where(moving, SLOW_MPS - self.braking_mps2 * rolling, 0.0), speed)
        return distance, speed, np.where(moving, self.braking_mps2, np.where(rolls, 0.0, braking))

    def _height(self, distance: Floats) -> tuple[Floats, Floats, Floats]:
        """Height above the runway and its first and second derivative by ground distance."""
        slope = math.tan(self.glide_path_rad)
        glide = distance * slope + self.crossing_height_m
        descends = glide < PLATFORM_M
        height, first = np.minimum(glide, PLATFORM_M), np.where(descends, slope, 0.0)
        second = np.zeros_like(distance)
        if not self.lands:
            return height, first, second
        over_touchdown = np.clip(distance - self._touchdown_m, 0.0, 2.0 * self.flare_m)
        flares = distance < self._aim_m + self.flare_m
        height = np.where(flares, slope * over_touchdown**2 / (4.0 * self.flare_m), height)
        first = np.where(flares, slope * over_touchdown / (2.0 * self.flare_m), first)
        return height, first, np.where(flares & (over_touchdown > 0.0), slope / (2.0 * self.flare_m), second)


@dataclass(frozen=True, slots=True)
class Delayed:
    """Another path flown later."""

    path: Path
    by_s: float

    @property
    def start_s(self) -> float:
        """The other path's, later."""
        return self.path.start_s + self.by_s

    @property
    def end_s(self) -> float:
        """The other path's, later."""
        return self.path.end_s + self.by_s

    def motion(self, time_s: ArrayLike) -> Motion:
        """The other path's motion, that much earlier."""
        return self.path.motion(np.asarray(time_s, dtype=np.float64) - self.by_s)


@dataclass(frozen=True, slots=True)
class Abeam:
    """Another path turned about a point of the ground plan: the same distance and height, another bearing.

    A positive angle turns to the left. Source: 003 2.3, the aircraft 3 degrees abeam.
    """

    path: Path
    angle_rad: float
    about_x_m: float = 0.0
    about_y_m: float = 0.0

    @property
    def start_s(self) -> float:
        """As the other path's."""
        return self.path.start_s

    @property
    def end_s(self) -> float:
        """As the other path's."""
        return self.path.end_s

    def motion(self, time_s: ArrayLike) -> Motion:
        """The other path's motion, turned."""
        other = self.path.motion(time_s)
        about = np.array([self.about_x_m, self.about_y_m, 0.0])
        position = self._turned(other.position - about) + about
        return Motion(position, self._turned(other.velocity), self._turned(other.acceleration))

    def _turned(self, vectors: Floats) -> Floats:
        cosine, sine = math.cos(self.angle_rad), math.sin(self.angle_rad)
        x, y, up = vectors[..., 0], vectors[..., 1], vectors[..., 2]
        return np.stack([cosine * x - sine * y, sine * x + cosine * y, up], axis=-1)
