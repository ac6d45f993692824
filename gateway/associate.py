"""Associate: which radar track is which aircraft (paper 003, 2.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]




@dataclass(frozen=True, slots=True)
class Change:
    """A pair that became one, or was lost; with the place where it was so, in the runway frame."""

    at: int
    kind: Literal["associated", "lost"]
    aircraft: str
    radar_track: str
    runway_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Associated:
    """The gates that were checked in this step (k rows), the pairs that are one now, and what changed."""

    check_time: Ints  # (k,) ns, the validity of the GPS report
    check_aircraft: tuple[str, ...]
    check_radar_track: tuple[str, ...]
    check_difference: Floats  # (k, 3) radar minus GPS: range m, azimuth rad, elevation rad; NaN = not compared
    check_gate: Floats  # (k, 3)
    check_hit: NDArray[np.bool_]  # (k,)
    check_counter: Ints  # (k,) after the check
    pairs: tuple[tuple[str, str], ...]  # (aircraft, radar track)
    changes: tuple[Change, ...]
