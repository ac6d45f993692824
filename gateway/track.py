"""Track: which plots belong together. The radar's own numbers decide; plots without one wait for a later method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Tracked:
    """The radar tracks that are alive, and how many plots of this step no track took."""

    active: tuple[str, ...]  # "1/3": radar 1, track 3
    untracked: int
