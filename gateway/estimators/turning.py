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
    The different entries are worked out and then taken to their places: fewer steps, for one track two thirds of the time.
    """
    t = np.repeat(elapsed_s[:, None], turn_rate.shape[1], axis=1)
    angle = t * turn_rate
    amount = np.abs(angle)
    some = np.maximum(amount, NOTHING)
    half = 0.5 * some
    half = np.sin(half) / half
    entries = np.zeros((_ENTRIES, *angle.shape))
    sine = np.sin(angle, out=entries[_SINE])
    np.negative(sine, out=entries[_RIGHT])
    np.cos(angle, out=entries[_COSINE])
    np.multiply(t, np.sin(some) / some, out=entries[_ALONG])
    across = np.multiply(0.5 * t * angle, half * half, out=entries[_ACROSS])
    np.negative(across, out=entries[_BACK])
    entries[_ONE], entries[_TIME] = 1.0, t
    keep = np.exp(-t / shaken.error_time_s, out=entries[_KEEP])
    bend = _bend(amount)
    np.multiply(2.0 * t * t, bend, out=entries[_PLACE])
    np.multiply(0.5 * t * half, half, out=entries[_BOTH])
    aside = np.multiply(t * angle, bend, out=entries[_ASIDE])
    np.negative(aside, out=entries[_OTHER])
    entries[_SPEED] = entries[_CLIMB] = 1.0
    entries[_HEIGHT], entries[_CLIMBING] = t * t / 3.0, 0.5 * t
    entries[_PLACE:_HEIGHT] *= t * shaken.level
    entries[_HEIGHT:_ERROR] *= t * shaken.upright
    np.multiply(shaken.error_m2, 1.0 - keep * keep, out=entries[_ERROR])
    by_mode = np.ascontiguousarray(entries.transpose(1, 2, 0))
    return by_mode.take(_CARRY[:size, :size], axis=-1), by_mode.take(_NOISE[:size, :size], axis=-1)


def _bend(angle: Floats) -> Floats:
    """(a - sin a) / a^3 of angles that are not negative, 1/6 at 0."""
    a, square = np.maximum(angle, SMALL), angle * angle
    series = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0))
    return np.where(angle < SMALL, series, (a - np.sin(a)) / (a * a * a))


def _matrix(entries: Mapping[int, Sequence[tuple[int, int]]]) -> Ints:
    """Which entry stands where in a matrix (11, 11): the first, which is 0, where no other does."""
    matrix = np.zeros((SIZE + 2, SIZE + 2), dtype=np.int64)
    for entry, places in entries.items():
        for place in places:
            matrix[place] = entry
    return matrix


_ENTRIES = 19
# of the transition
_ONE, _ALONG, _ACROSS, _BACK, _TIME, _COSINE, _SINE, _RIGHT, _KEEP = range(1, 10)
# of the noise: level position and velocity, alike on both axes, and what a turn makes of one axis on the other; upright
_PLACE, _BOTH, _SPEED, _ASIDE, _OTHER, _HEIGHT, _CLIMBING, _CLIMB, _ERROR = range(10, _ENTRIES)
_ERRORS = [(6, 6), (7, 7), (8, 8)]
_CARRY = _matrix(
    {
        _ONE: [(0, 0), (1, 1), (2, 2), (5, 5)],
        _ALONG: [(0, 3), (1, 4)],
        _ACROSS: [(1, 3)],
        _BACK: [(0, 4)],
        _TIME: [(2, 5)],
        _COSINE: [(3, 3), (4, 4)],
        _SINE: [(4, 3)],
        _RIGHT: [(3, 4)],
        _KEEP: _ERRORS,
    }
)
_NOISE = _matrix(
    {
        _PLACE: [(0, 0), (1, 1)],
        _BOTH: [(0, 3), (3, 0), (1, 4), (4, 1)],
        _SPEED: [(3, 3), (4, 4)],
        _ASIDE: [(0, 4), (4, 0)],
        _OTHER: [(1, 3), (3, 1)],
        _HEIGHT: [(2, 2)],
        _CLIMBING: [(2, 5), (5, 2)],
        _CLIMB: [(5, 5)],
        _ERROR: _ERRORS,
    }
)
