"""Watching: whether a radar still measures as was learnt of it, or was moved or repaired.

What pairs are off by beyond what is expected, each one bounded so that a few wrong ones do not matter, is averaged over the
last seconds. When that stays further off than it can be by chance, the radar is another one now.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

KEEP = 1.0 - 1.0 / 8.0  # each second: an average over eight
BOUND = 3.0  # sigmas: what is further off counts as that
FAR = 5.0  # sigmas of the average
WANDERS = 0.2  # of a plot's noise
SURE_S, SURE_ALONE_S = 5.0, 20.0  # so long, with several aircraft; with one alone it may as well be that one's report


@dataclass(frozen=True, slots=True, eq=False)
class Watch:
    """Faded sums over the pairs of one radar, (3,) each, and for how long they have been far off, from 0 to 1."""

    weight: Floats = field(default_factory=lambda: np.zeros(3))
    square: Floats = field(default_factory=lambda: np.zeros(3))  # the variance of `off`
    off: Floats = field(default_factory=lambda: np.zeros(3))  # weighed
    unsure: Floats = field(default_factory=lambda: np.zeros(3))  # weighed variance of what is expected
    doubt: float = 0.0

    @property
    def is_doubtful(self) -> bool:
        """Whether pairs are far off at present: nothing is learnt from such."""
        return self.doubt > 0.0

    @property
    def is_sure(self) -> bool:
        """Whether they have been for so long that it is the radar."""
        return self.doubt >= 1.0

    def seeing(self, left: Floats, variance: Floats, noise: Floats, usual: Floats, aircraft: int) -> Watch:
        """The same after a second's pairs of so many aircraft: how far off (n, 3), the variance of that, the noise in it.

        `usual`: (3,) the noise of single plots; errors that wander by a small part of it are nothing to start again for.
        """
        known = np.isfinite(left) & np.isfinite(variance)
        weight = np.where(known, np.where(known, noise, 1.0) ** -2.0, 0.0)
        bound = BOUND * np.sqrt(np.where(known, variance, 1.0))
        bounded = np.clip(np.where(known, left, 0.0), -bound, bound)
        unsure = np.where(known, variance - noise**2, 0.0)
        total = KEEP * self.weight + weight.sum(axis=0)
        square = KEEP**2 * self.square + weight.sum(axis=0)
        off = KEEP * self.off + (weight * bounded).sum(axis=0)
        spread = KEEP * self.unsure + (weight * unsure).sum(axis=0)
        safe = np.where(total > 0.0, total, 1.0)
        deviation = np.sqrt(square / safe**2 + np.maximum(spread / safe, 0.0) + (WANDERS * usual) ** 2)
        is_far = bool(((total > 0.0) & (np.abs(off / safe) > FAR * deviation)).any())
        more = 1.0 / (SURE_S if aircraft > 1 else SURE_ALONE_S)
        return Watch(total, square, off, spread, self.doubt + more if is_far else 0.0)
