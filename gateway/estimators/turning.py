"""Straight and turning motion over any time: transition and noise of the state of `kalman`, in closed form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import SIZE, Motion

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NOTHING = 1e-20  # rad; the sine of what is smaller is itself
SMALL = 0.2  # rad; below it (a - sin a) / a^3 loses digits and its series is exact


@dataclass(frozen=True, slots=True)
class Shaken:
    """What shakes m motions: level density of acceleration (m,), m2/s3, and what follows from all that shakes them."""

    level: Floats
    fades: Floats  # (m,) rate at which the source's error is forgotten, not positive, 1/s
    scale: Floats  # (m, e) of each entry of transition and noise

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Shaken:
        """The level density is the motion's eastern one on both axes: the velocity turns, its noise cannot keep an axis."""
        level = np.array([motion.acceleration_density[0] for motion in motions])
        upright = np.array([motion.acceleration_density[2] for motion in motions])
        error_m2 = np.array([motion.error_sigma_m**2 for motion in motions])
        fades = np.array([-1.0 / motion.error_time_constant_s for motion in motions])
        by = {"": np.ones_like(level), "level": level, "upright": upright, "error": error_m2}
        return cls(level, fades, np.stack([share * by[what] for _, _, share, what in _ENTRIES], axis=1))


def carried(shaken: Shaken, elapsed_s: Floats, turn_rate: Floats, size: int = SIZE) -> tuple[Floats, Floats]:
    """Transition and noise (n, m, size, size) over times (n,) of m motions that turn at rates (n, m), rad/s, 0 = straight.

    White acceleration through the turning motion, integrated exactly, so that two short steps equal one long one. States
    beyond the nine are left at 0.
    Source: 000 2.1.1 eq 3, 4, lost in the print: the coordinated turn of the literature, straight at a rate of 0.
    Deviation: the noise is of the time since the last update, not of a fixed period.
    Each different entry is a power of the time, times a function of the angle, times what the motion is shaken by; then they
    are taken to their places.
    """
    t = elapsed_s[:, None]
    angle = t * turn_rate
    amount = np.abs(angle)
    half = 0.5 * np.maximum(amount, NOTHING)
    sine = np.sin(half)
    both = sine * np.cos(half)
    keep = np.exp(t * shaken.fades)
    shapes = np.empty((*angle.shape, SHAPES))
    shapes[..., FLAT] = 1.0
    shapes[..., SINC] = both / half
    shapes[..., SINC_HALF] = (sine / half) ** 2
    shapes[..., BEND] = _bend(amount, both)
    np.multiply(shapes[..., SINC:BY_RATE], turn_rate[..., None], out=shapes[..., BY_RATE:COS])
    shapes[..., COS] = 1.0 - 2.0 * (sine * sine)
    shapes[..., KEPT] = keep
    shapes[..., LOST] = 1.0 - keep * keep
    square = t * t
    powers = np.concatenate([np.ones_like(t), t, square, square * t], axis=1)
    entries = shapes.take(SHAPE, axis=-1)
    entries *= powers.take(POWER, axis=1)[:, None]
    entries *= shaken.scale
    return entries.take(_CARRY[:size, :size], axis=-1), entries.take(_NOISE[:size, :size], axis=-1)


def _bend(angle: Floats, half_sine: Floats) -> Floats:
    """(a - sin a) / a^3 of angles that are not negative, with half of their sines; 1/6 at 0."""
    square = angle * angle
    series: Floats = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0))
    small = angle < SMALL
    if small.all():
        return series
    a = np.maximum(angle, SMALL)
    return np.where(small, series, (a - 2.0 * half_sine) / (a * a * a))


def _matrix(entries: Mapping[int, Sequence[tuple[int, int]]]) -> Ints:
    """Which entry stands where in a matrix (11, 11): the first, which is 0, where no other does."""
    matrix = np.zeros((SIZE + 2, SIZE + 2), dtype=np.int64)
    for entry, places in entries.items():
        for place in places:
            matrix[place] = entry
    return matrix


# functions of the angle a: 1, sin a / a, its square at a / 2, (a - sin a) / a^3, the last three times the rate, cos a; and of the
# time alone what is left of the source's error, and what noise has put in place of it
SHAPES = 10
FLAT, SINC, SINC_HALF, BEND, BY_RATE, ARC, SWAY, COS, KEPT, LOST = range(SHAPES)
# each entry: function, power of the time, share, and of what
_ENTRIES = (
    (FLAT, 0, 0.0, ""),
    (FLAT, 0, 1.0, ""),
    (SINC, 1, 1.0, ""),
    (ARC, 2, 0.5, ""),
    (ARC, 2, -0.5, ""),
    (FLAT, 1, 1.0, ""),
    (COS, 0, 1.0, ""),
    (BY_RATE, 1, 1.0, ""),
    (BY_RATE, 1, -1.0, ""),
    (KEPT, 0, 1.0, ""),
    (BEND, 3, 2.0, "level"),
    (SINC_HALF, 2, 0.5, "level"),
    (FLAT, 1, 1.0, "level"),
    (SWAY, 3, 1.0, "level"),
    (SWAY, 3, -1.0, "level"),
    (FLAT, 3, 1.0 / 3.0, "upright"),
    (FLAT, 2, 0.5, "upright"),
    (FLAT, 1, 1.0, "upright"),
    (LOST, 0, 1.0, "error"),
)
SHAPE, POWER = np.array([entry[0] for entry in _ENTRIES]), np.array([entry[1] for entry in _ENTRIES])
# of the transition
ONE, ALONG, ACROSS, BACK, TIME, COSINE, SINE, RIGHT, KEEP = range(1, 10)
# of the noise: level position and velocity, alike on both axes, and what a turn makes of one axis on the other; upright
PLACE, BOTH, SPEED, ASIDE, OTHER, HEIGHT, CLIMBING, CLIMB, ERROR = range(10, len(_ENTRIES))
_ERRORS = [(6, 6), (7, 7), (8, 8)]
_CARRY = _matrix(
    {
        ONE: [(0, 0), (1, 1), (2, 2), (5, 5)],
        ALONG: [(0, 3), (1, 4)],
        ACROSS: [(1, 3)],
        BACK: [(0, 4)],
        TIME: [(2, 5)],
        COSINE: [(3, 3), (4, 4)],
        SINE: [(4, 3)],
        RIGHT: [(3, 4)],
        KEEP: _ERRORS,
    }
)
_NOISE = _matrix(
    {
        PLACE: [(0, 0), (1, 1)],
        BOTH: [(0, 3), (3, 0), (1, 4), (4, 1)],
        SPEED: [(3, 3), (4, 4)],
        ASIDE: [(0, 4), (4, 0)],
        OTHER: [(1, 3), (3, 1)],
        HEIGHT: [(2, 2)],
        CLIMBING: [(2, 5), (5, 2)],
        CLIMB: [(5, 5)],
        ERROR: _ERRORS,
    }
)
