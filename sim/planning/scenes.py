"""The paper's case with threats drawn by seed: 20 km x 20 km, eight threats at least 3 km from each other and the ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.sensors import stream

Floats = NDArray[np.float64]

START_M, GOAL_M = np.array([1_000.0, 2_000.0]), np.array([18_000.0, 18_000.0])
SIDE_M, THREATS, APART_M = 20_000.0, 8, 3_000.0


def draw_threats(seed: int) -> Floats:
    """Places (8, 2) of a seed's threats, m, uniform where they may be. Source: 002-3 (the print lost the paper's own)."""
    chance = stream(seed, "threats")
    taken = [START_M, GOAL_M]
    while len(taken) < THREATS + 2:
        place = chance.uniform(0.0, SIDE_M, 2).round()  # whole metres: the same in a file
        if np.hypot(*(np.stack(taken) - place).T).min() >= APART_M:
            taken.append(place)
    return np.stack(taken[2:])
