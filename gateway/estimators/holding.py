"""Straight motion with an acceleration that lasts, as two states more: east and north, after the nine of `kalman`.

Braking goes on for minutes, and so does swinging onto a course. A mode without an acceleration lags behind either, always to
the same side, and says nothing of it. A mode that holds one has it die away with a time constant, shaken by white noise that
keeps its variance (Singer's model). In every other mode it is drawn anew all the time, so that who changes into the mode
begins with what is usual. Across the course aircraft accelerate more than along it: noise may be told for both. Along it,
what a fast one may brake with is its drag, which grows with the square of speed.

Arrays are over n tracks and m modes, as in `modes`. Source: 000 2.1.1; R. Singer (1970), eq 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import SIZE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WIDE = SIZE + 2
LONG = 1.0  # time constants: beyond it the closed form keeps its digits, below it eight points integrate exactly

_LEVEL = np.array([0, 1, 3, 4, SIZE, SIZE + 1])  # position, velocity and acceleration, east and north
_MOVING = _LEVEL[:4]
_BLOCK = (_LEVEL[:, None] * WIDE + _LEVEL).ravel()  # where these are in a matrix, row after row
_UNIT = np.eye(2)
_ORDER = np.array([0, 0, 1, 1, 2, 2])  # which of the three each of these is
_HELD = SIZE + np.array([0, 1] * 3)  # the acceleration that acts on it
_DRAG_AT_MPS = 100.0  # the speed that drag is told for
_POINTS, _SHARES = (0.5 * part for part in np.polynomial.legendre.leggauss(8))
_POINTS, _SHARES = np.append(_POINTS + 0.5, 1.0), np.append(_SHARES, 0.0)  # the end counts for nothing in the integral


@dataclass(frozen=True, slots=True)
class Held:
    """Accelerations that last: how large they usually are, 1 sigma, and the time constant with which they die away.

    Along the course it is `drag_mps2` at 100 m/s, growing with the square of speed up to what is usual across it, and never
    less than `along_mps2`.
    """

    across_mps2: float
    along_mps2: float
    lasts_s: float
    drag_mps2: float = 0.0

    @property
    def drag(self) -> float:
        """Acceleration along the course over the square of speed, 1/m."""
        return self.drag_mps2 / _DRAG_AT_MPS**2


def turn_along(noise: Floats, course: Floats, share: Floats, most: Floats, uneven: Ints) -> None:
    """Turn level noise (n, m, d, d), alike on both axes, along courses (n, 2) of length 1, for the u straight modes `uneven`.

    There shares (u,) of its sigma are left along the course, and shares (n, u), no less, across it. A course of 0, of what
    stands, leaves it alike.
    """
    ways = _turned(course, share, np.maximum(most, share))
    for mode, way in zip(uneven.tolist(), ways.transpose(1, 0, 2, 3), strict=True):
        of_mode = noise[:, mode]
        of_mode[:, _MOVING[:, None], _MOVING] = _along_both(of_mode[:, 0:4:3, 0:4:3], way)


def add_held(
    carry: Floats, noise: Floats, elapsed_s: Floats, course: Floats, speed: Floats, held: Held, holds: Sequence[int]
) -> None:
    """Fill in what two states more do to transition and noise (n, m, 11, 11) over times (n,), of which the modes `holds` do."""
    drawn = usual(course, speed, held)
    response, grown = answers(elapsed_s, held.lasts_s)
    noise[..., SIZE:, SIZE:] = drawn[:, None]
    block = _along_both(grown, drawn).reshape(-1, len(_BLOCK))
    for mode in holds:
        carry[:, mode, _LEVEL, _HELD] = response[:, _ORDER]
        noise[:, mode, SIZE:, SIZE:] = 0.0
        flat = noise[:, mode].reshape(len(noise), -1)  # a view
        flat[:, _BLOCK] += block


def _along_both(parts: Floats, way: Floats) -> Floats:
    """Covariances (n, 2 k, 2 k) of k quantities, east and north each: parts (n, k, k) alike on both axes, times (n, 2, 2)."""
    n, k, _ = parts.shape
    return (parts[:, :, None, :, None] * way[:, None, :, None, :]).reshape(n, 2 * k, 2 * k)


def usual(course: Floats, speed: Floats, held: Held) -> Floats:
    """Covariance (n, 2, 2) of an acceleration of which nothing is known, at courses (n, 2) and level speeds (n,)."""
    along = np.maximum(np.minimum(held.drag * speed * speed, held.across_mps2), held.along_mps2)
    return held.across_mps2**2 * _turned(course, (along / held.across_mps2)[:, None])[:, 0]


def _turned(course: Floats, along: Floats, across: Floats | float = 1.0) -> Floats:
    """Variances (n, m, 2, 2) of which sigma is a share (m,) or (n, m) along the course and a share (n, m) across it."""
    way = course[:, None, :, None] * course[:, None, None, :]
    square = np.asarray(across * across)[..., None, None]
    return np.asarray(square * _UNIT + ((along * along)[..., None, None] - square) * way)


def answers(elapsed_s: Floats, lasts_s: float) -> tuple[Floats, Floats]:
    """What becomes of an acceleration over times (n,).

    (n, 3): what one of 1 adds to position and velocity, and what is left of it; and the covariance (n, 3, 3) that the noise
    of one of variance 1 makes of these.
    """
    if len(elapsed_s) == 1:  # one track worked again after late data sees the same intervals again
        return _over(float(elapsed_s[0]), lasts_s)
    return _integrated(elapsed_s, lasts_s)


@lru_cache(maxsize=1024)
def _over(elapsed_s: float, lasts_s: float) -> tuple[Floats, Floats]:
    """The same over one time, remembered; nobody may write into them."""
    response, grown = _integrated(np.array([elapsed_s]), lasts_s)
    response.setflags(write=False)
    grown.setflags(write=False)
    return response, grown


def _integrated(elapsed_s: Floats, lasts_s: float) -> tuple[Floats, Floats]:
    t = elapsed_s[:, None]
    x = t * (_POINTS / lasts_s)
    lost = np.expm1(-x)
    response = np.empty((len(t), 3, len(_POINTS)))
    response[:, 0] = lasts_s * lasts_s * (lost + x)
    response[:, 1] = -lasts_s * lost
    response[:, 2] = 1.0 + lost
    grown: Floats = (response * (t * (2.0 / lasts_s * _SHARES))[:, None]) @ response.transpose(0, 2, 1)
    long = elapsed_s > LONG * lasts_s
    if long.any():
        grown[long] = _grown_long(elapsed_s[long] / lasts_s, lasts_s)
    return response[:, :, -1], grown


def _grown_long(x: Floats, lasts_s: float) -> Floats:
    once, twice = np.exp(-x), np.exp(-2.0 * x)
    place = 1.0 - twice + 2.0 * x + x * x * (2.0 / 3.0 * x - 2.0) - 4.0 * x * once
    both = twice + 1.0 - 2.0 * once + 2.0 * x * once - 2.0 * x + x * x
    first = np.stack([place, both, 1.0 - twice - 2.0 * x * once], axis=-1)
    second = np.stack([both, 4.0 * once - 3.0 - twice + 2.0 * x, twice + 1.0 - 2.0 * once], axis=-1)
    third = np.stack([first[:, 2], second[:, 2], 1.0 - twice], axis=-1)
    scale = lasts_s ** np.array([2.0, 1.0, 0.0])
    return np.stack([first, second, third], axis=1) * scale[:, None] * scale
