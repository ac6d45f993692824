"""Register: the systematic errors of radars and position sources. For now none is assumed and none is taken off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Registered:
    """What is taken off each radar's measurements: range m, azimuth rad, elevation rad; one row a radar."""

    radars: tuple[int, ...]
    correction: Floats  # (r, 3)
