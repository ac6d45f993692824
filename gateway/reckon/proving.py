"""Whether a vehicle's dead reckoning is as sure as it says: while positions are good, what goes on without them is compared.

Wings and wheels hold a velocity. Of copters, boats and submarines nothing does: what shakes them, how often they tell their
unit, and what their autopilot makes of it decide how well they are carried on, and no table knows that beforehand. So the
squares by which positions and velocities are off from the oldest hypothesis are averaged, of each vehicle; a vehicle whose
squares are what its covariance says denies walks, one whose are many times that must be surer by as much. What was proved
while it lay still says nothing of how it flies: when its unit shakes much more than it did, it is proved anew.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.reckon.tip import NOTHING, Tip

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

DEGREES = 4.0  # of freedom: position and velocity, level
PROVED = 100  # positions, half a second apart, that the oldest hypothesis was compared with
REMEMBERS = 400.0  # the mean is of so many, at most
ROUGHER = 10.0  # times the power of what it was proved in


def compared(tip: Tip, worst: Floats, is_old: Bools, unseen_mps2: Floats, trusted: Bools) -> Tip:
    """The tips with one more comparison: squared distances of positions from all hypotheses (n, h), whether each has gone on
    without for long enough (n, h), and what shakes the units (n, 3), m/s2 in a root Hz.
    """
    rows = np.arange(len(tip))
    oldest = np.argmin(tip.seeded[:, 1:], axis=1)
    square = worst[rows, 1 + oldest] / DEGREES
    power = np.mean(unseen_mps2**2, axis=1)
    again = (tip.proved > 0) & (power > ROUGHER * tip.rough)
    count = np.where(again, 0, tip.proved)
    counts = trusted & is_old[rows, oldest] & (tip.denied == NOTHING) & np.isfinite(square)
    share = np.where(counts, 1.0 / np.minimum(count + 1.0, REMEMBERS), 0.0)
    return replace(
        tip,
        proved=count + counts,
        times=np.where(counts, tip.times + share * (square - tip.times), tip.times),
        rough=np.where(counts, tip.rough + share * (power - tip.rough), tip.rough),
    )


def is_proved(tip: Tip) -> Bools:
    """Of which vehicles enough is known of how sure they are (n,)."""
    return tip.proved >= PROVED
