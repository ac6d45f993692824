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


@dataclass(slots=True)
class Path:
    """The end of n paths so far, (n,) or (n, 2), and what is known of the horizons (n, h); it grows leg by leg."""

    position: Floats
    course: Floats
    time_s: Floats
    turned: Floats
    horizons: Floats
    east_at: Floats
    north_at: Floats
    course_at: Floats
    turned_at: Floats
    passed_at: Floats

    @classmethod
    def at_start(cls, position: Floats, course: Floats, horizons: Floats) -> Path:
        """A path of no length."""
        nothing = np.zeros(len(course))
        return cls(position, course, nothing, nothing, horizons, *np.zeros((5, *horizons.shape)))

    def extend(self, speed: Floats, rate: Floats, duration_s: Floats, passed: int) -> None:
        """Fly on with these ground speeds and turn rates (n,) for so long (n,); all later horizons are on it so far."""
        since = self.horizons - self.time_s[:, None]
        on = since >= 0.0
        chord, bend = _arc(rate[:, None] * since)
        middle, turn = self.course[:, None] + bend, 2.0 * bend
        length = speed[:, None] * since * chord
        np.copyto(self.east_at, self.position[:, 0, None] + length * np.cos(middle), where=on)
        np.copyto(self.north_at, self.position[:, 1, None] + length * np.sin(middle), where=on)
        np.copyto(self.course_at, self.course[:, None] + turn, where=on)
        np.copyto(self.turned_at, self.turned[:, None] + np.abs(turn), where=on)
        np.copyto(self.passed_at, float(passed), where=on)
        chord, bend = _arc(rate * duration_s)
        length = speed * duration_s * chord
        middle = self.course + bend
        self.position = self.position + np.stack([length * np.cos(middle), length * np.sin(middle)], axis=-1)
        self.course = self.course + 2.0 * bend
        self.turned = self.turned + np.abs(2.0 * bend)
        self.time_s = self.time_s + duration_s

    def straight(self, speed: Floats, duration_s: Floats, passed: int) -> None:
        """Fly straight on with these ground speeds (n,) for so long (n,): the bits of `extend` with no turn, in less time."""
        since = self.horizons - self.time_s[:, None]
        on, length = since >= 0.0, speed[:, None] * since
        cosine, sine = np.cos(self.course), np.sin(self.course)
        np.copyto(self.east_at, self.position[:, 0, None] + length * cosine[:, None], where=on)
        np.copyto(self.north_at, self.position[:, 1, None] + length * sine[:, None], where=on)
        np.copyto(self.course_at, self.course[:, None], where=on)
        np.copyto(self.turned_at, self.turned[:, None], where=on)
        np.copyto(self.passed_at, float(passed), where=on)
        self.position = self.position + (speed * duration_s)[:, None] * np.stack([cosine, sine], axis=-1)
        self.time_s = self.time_s + duration_s

    def stop(self, speed: Floats, braking: Floats, passed: int) -> None:
        """Straight on for good, brought to rest where `braking` (n,) m/s2 is not 0."""
        since = np.maximum(self.horizons - self.time_s[:, None], 0.0)
        on = self.horizons >= self.time_s[:, None]
        moving = np.minimum(since, (speed / np.maximum(braking, 1e-9))[:, None])
        length = speed[:, None] * moving - 0.5 * braking[:, None] * moving * moving
        np.copyto(self.east_at, self.position[:, 0, None] + length * np.cos(self.course)[:, None], where=on)
        np.copyto(self.north_at, self.position[:, 1, None] + length * np.sin(self.course)[:, None], where=on)
        np.copyto(self.course_at, self.course[:, None], where=on)
        np.copyto(self.turned_at, self.turned[:, None], where=on)
        np.copyto(self.passed_at, float(passed), where=on)


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
