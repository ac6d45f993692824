"""A way in the runway frame over time, as reports judge it, and the same a second apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SECOND = 1_000_000_000
_LONGEST_GAP_NS = 6 * _SECOND  # a landing radar's slowest scan: between two rows further apart nothing is known


@dataclass(frozen=True, slots=True)
class Flown:
    """Rows of a way at rising times (n,) ns: place (n, 3) m and velocity (n, 3) m/s in the runway frame."""

    time: Ints
    place_m: Floats
    velocity_mps: Floats


def resampled(way: Flown, times: Ints | None = None) -> Flown:
    """The way at times (m,) ns, by default each whole second; NaN where it has a gap or has not begun."""
    if times is None:
        times = np.arange(-(-way.time[0] // _SECOND), way.time[-1] // _SECOND + 1, dtype=np.int64) * _SECOND
    since = (way.time - way.time[0]).astype(np.float64)
    at = (times - way.time[0]).astype(np.float64)
    after = np.clip(np.searchsorted(way.time, times), 1, len(way.time) - 1)
    known = (way.time[after] - way.time[after - 1] <= _LONGEST_GAP_NS) & (at >= 0.0) & (at <= since[-1])
    place, velocity = (
        np.where(known[:, None], np.stack([np.interp(at, since, one) for one in columns.T], axis=-1), math.nan)
        for columns in (way.place_m, way.velocity_mps)
    )
    return Flown(times, place, velocity)
