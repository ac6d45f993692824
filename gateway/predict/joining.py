"""Lines between two points of a plan: who is beside the one that it should be on comes back to it first, as autopilots do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.predict.thinking import Motions

Floats = NDArray[np.float64]

AHEAD_S = 8.0  # so far ahead the line is met
STEEPEST = 1.0  # tangent of the angle to the line at which it is come back to at most
BESIDE_S = 0.3  # who is no farther to one side is on it


def joining(now: Motions, begins: Floats, goal: Floats) -> Floats:
    """Where n aircraft come back to the lines that begin at (n, 2) and lead to their goals (n, 2).

    NaN = nowhere: there is no line, it is flown on already, or its end is nearer.
    """
    line = goal - begins
    length = np.sqrt(line[:, 0] * line[:, 0] + line[:, 1] * line[:, 1])
    along = line / np.maximum(length, 1.0)[:, None]
    off = now.position - begins
    done = off[:, 0] * along[:, 0] + off[:, 1] * along[:, 1]
    aside = np.abs(off[:, 1] * along[:, 0] - off[:, 0] * along[:, 1])
    met = done + np.maximum(AHEAD_S * now.speed, aside / STEEPEST)
    comes_back = (aside > BESIDE_S * now.speed) & (met > 0.0) & (met < length)  # false for NaN
    return np.where(comes_back[:, None], begins + met[:, None] * along, np.nan)
