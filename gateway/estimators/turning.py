"""Straight and turning motion over any time: transition and noise of the state of `kalman`, in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import ERROR, SIZE, Motion

Floats = NDArray[np.float64]

SMALL = 0.2  # rad; below it (a - sin a) / a^3 loses digits and its series is exact


@dataclass(frozen=True, slots=True)
class Shaken:
    """What shakes m motions, as arrays (m,): densities of acceleration, level and upright, m2/s3, and the source's error."""

    level: Floats
    upright: Floats
    error_m2: Floats
    error_time_s: Floats

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Shaken:
        """The level density is the motion's eastern one on both axes: the velocity turns, its noise cannot keep an axis."""
        return cls(
            np.array([motion.acceleration_density[0] for motion in motions]),
            np.array([motion.acceleration_density[2] for motion in motions]),
            np.array([motion.error_sigma_m**2 for motion in motions]),
            np.array([motion.error_time_constant_s for motion in motions]),
        )


def carried(shaken: Shaken, elapsed_s: Floats, turn_rate: Floats, size: int = SIZE) -> tuple[Floats, Floats]:
    """Transition and noise (n, m, size, size) over times (n,) of m motions that turn at rates (n, m), rad/s, 0 = straight.

    White acceleration through the turning motion, integrated exactly, so that two short steps equal one long one. States
    beyond the nine are left at 0.
    Source: 000 2.1.1 eq 3, 4, lost in the print: the coordinated turn of the literature, straight at a rate of 0.
    Deviation: the noise is of the time since the last update, not of a fixed period.
    """
    t = elapsed_s[:, None]
    angle = t * turn_rate
    half = np.sinc(angle / (2.0 * math.pi))
    along, across = t * np.sinc(angle / math.pi), t * (0.5 * angle) * half * half
    carry = np.zeros((*angle.shape, size, size))
    carry[..., _STATES, _STATES] = 1.0
    carry[..., 0, 3] = carry[..., 1, 4] = along
    carry[..., 1, 3] = across
    carry[..., 0, 4] = -across
    carry[..., 2, 5] = t
    carry[..., 3, 3] = carry[..., 4, 4] = np.cos(angle)
    carry[..., 4, 3] = np.sin(angle)
    carry[..., 3, 4] = -carry[..., 4, 3]
    keep = np.exp(-t / shaken.error_time_s)
    carry[..., _ERRORS, _ERRORS] = keep[..., None]
    return carry, _noise(shaken, t, angle, half, keep, size)


_STATES = np.arange(ERROR.start)
_ERRORS = np.arange(SIZE)[ERROR]


def _noise(shaken: Shaken, t: Floats, angle: Floats, half: Floats, keep: Floats, size: int) -> Floats:
    """What white acceleration adds in a turn by `angle` (n, m); `half` is sin(a/2) / (a/2)."""
    level, upright = shaken.level * t, shaken.upright * t
    error = shaken.error_m2 * (1.0 - keep * keep)
    bend = _bend(angle)
    noise = np.zeros((*angle.shape, size, size))
    noise[..., 0, 0] = noise[..., 1, 1] = level * t * t * 2.0 * bend
    noise[..., 0, 3] = noise[..., 3, 0] = noise[..., 1, 4] = noise[..., 4, 1] = level * t * 0.5 * half * half
    noise[..., 0, 4] = noise[..., 4, 0] = level * t * angle * bend
    noise[..., 1, 3] = noise[..., 3, 1] = -noise[..., 0, 4]
    noise[..., 3, 3] = noise[..., 4, 4] = level
    noise[..., 2, 2] = upright * t * t / 3.0
    noise[..., 2, 5] = noise[..., 5, 2] = upright * t * 0.5
    noise[..., 5, 5] = upright
    noise[..., _ERRORS, _ERRORS] = error[..., None]
    return noise


def _bend(angle: Floats) -> Floats:
    """(a - sin a) / a^3, 1/6 at 0."""
    small = np.abs(angle) < SMALL
    a = np.where(small, 1.0, angle)
    square = angle * angle
    series = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0))
    return np.where(small, series, (a - np.sin(a)) / (a * a * a))
