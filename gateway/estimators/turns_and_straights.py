"""Paths of turns and straights: where they lead to, and where they are at horizons.

Arrays are over n aircraft and h horizons; a course is from x towards y, a turn rate positive to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class OnPath:
    """Where n paths are at h horizons: all (n, h), courses not wrapped."""

    east: Floats
    north: Floats
    course: Floats
    turned: Floats  # radians until then, whichever way
    passed: Floats  # how many points of the route

    @classmethod
    def nowhere(cls, horizons: Floats) -> OnPath:
        """Of paths that nobody looks at."""
        nothing = np.zeros(horizons.shape)
        return cls(nothing, nothing, nothing, nothing, nothing)


@dataclass(slots=True)
class Path:
    """The end of n paths so far, (n,) or (n, 2), and the legs that lead there; it grows leg by leg.

    What is asked for are horizons (n, h): each is on one leg only, so all legs are looked at together when the path is made.
    """

    position: Floats
    course: Floats
    time_s: Floats
    turned: Floats
    horizons: Floats
    legs: list[tuple[Floats, ...]]  # as `_leg` has them
    braking: Floats | None = None  # (n,) m/s2 on the last leg

    @classmethod
    def at_start(cls, position: Floats, course: Floats, horizons: Floats) -> Path:
        """A path of no length."""
        nothing = np.zeros(len(course))
        return cls(position, course, nothing, nothing, horizons, [])

    def _leg(self, speed: Floats, rate: Floats, passed: int) -> None:
        """From here on so fast, in such a turn: begun then and there, on this course, so far turned, so many points passed."""
        east, north = self.position[:, 0], self.position[:, 1]
        points = np.full(len(speed), float(passed))
        self.legs.append((self.time_s, east, north, self.course, self.turned, points, speed, rate))

    def extend(self, speed: Floats, rate: Floats, duration_s: Floats, passed: int) -> None:
        """Fly on with these ground speeds and turn rates (n,) for so long (n,); all later horizons are on it so far."""
        self._leg(speed, rate, passed)
        chord, bend = _arc(rate * duration_s)
        length = speed * duration_s * chord
        middle = self.course + bend
        self.position = self.position + np.stack([length * np.cos(middle), length * np.sin(middle)], axis=-1)
        self.course = self.course + 2.0 * bend
        self.turned = self.turned + np.abs(2.0 * bend)
        self.time_s = self.time_s + duration_s

    def straight(self, speed: Floats, duration_s: Floats, passed: int) -> None:
        """Fly straight on with these ground speeds (n,) for so long (n,): the bits of `extend` with no turn, in less time."""
        self._leg(speed, np.zeros(len(speed)), passed)
        cosine, sine = np.cos(self.course), np.sin(self.course)
        self.position = self.position + (speed * duration_s)[:, None] * np.stack([cosine, sine], axis=-1)
        self.time_s = self.time_s + duration_s

    def stop(self, speed: Floats, braking: Floats, passed: int) -> None:
        """Straight on for good, brought to rest where `braking` (n,) m/s2 is not 0."""
        self._leg(speed, np.zeros(len(speed)), passed)
        self.braking = braking if braking.any() else None

    def at_horizons(self) -> OnPath:
        """Where the paths, of one leg at least, are at their horizons: each on the last leg that has begun by then."""
        legs = np.array(self.legs)
        begins = legs[:, 0]
        last = (begins[:, :, None] <= self.horizons).sum(axis=0) - 1
        n = len(self.course)
        place = last * (legs.shape[1] * n) + np.arange(n)[:, None]
        since, east, north, course, turned, passed, speed, rate = (
            legs.take(place + column * n) for column in range(legs.shape[1])
        )
        since = self.horizons - since
        length = speed * since
        if self.braking is not None:
            braking = np.where(last == len(legs) - 1, self.braking[:, None], 0.0)
            moving = np.minimum(since, speed / np.maximum(braking, 1e-9))
            length = speed * moving - 0.5 * braking * moving * moving
        chord, bend = _arc(rate * since)
        length, middle, turn = length * chord, course + bend, 2.0 * bend
        east, north = east + length * np.cos(middle), north + length * np.sin(middle)
        return OnPath(east, north, course + turn, turned + np.abs(turn), passed)


def or_zero(values: Floats) -> Floats:
    """The same with 0 where it is NaN: in a quarter of the time that `np.nan_to_num` takes, which looks for infinities too."""
    return np.where(np.isnan(values), 0.0, values)


def _arc(angle: Floats) -> tuple[Floats, Floats]:
    """Chord over arc, and half the angle, of an arc by an angle."""
    return np.sinc(angle / FULL_TURN), 0.5 * angle


def angle_to_go(position: Floats, course: Floats, radius: Floats, side: Floats, point: Floats) -> Floats:
    """By how much (n,) who turns about a radius (n,) to a side (n,), 1 left, -1 right, turns until a point lies ahead.

    In [0, 2 pi); NaN where the point is inside the circle: then it never does.
    """
    centre = position + (side * radius)[:, None] * np.stack([-np.sin(course), np.cos(course)], axis=-1)
    way = point - centre
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    outside = distance > radius
    ratio = np.where(outside, radius / np.where(outside, distance, 1.0), 1.0)
    # the velocity at the tangent point is the way to the point: the direction from the centre, turned by the rest of the angle
    wanted = np.arctan2(way[:, 1], way[:, 0]) + side * np.arcsin(ratio)
    turn = np.remainder(side * (wanted - course), FULL_TURN)
    return np.where(outside, np.where(turn > FULL_TURN - 1e-6, 0.0, turn), math.nan)
