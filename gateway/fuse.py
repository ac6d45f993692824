"""Fuse: one state for each aircraft from everything that saw it (paper 003, 2.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Ended:
    """A system track that is no more, and why."""

    at: int
    track: int
    reason: str


@dataclass(frozen=True, slots=True)
class Fused:
    """A step's track updates, n rows in writing order; a row for a (track, time) already written corrects it."""

    time: Ints  # (n,) ns, when the state holds
    received: Ints  # (n,) ns, when the observation behind it was heard; -1 = none
    track: Ints  # (n,)
    aircraft: tuple[str | None, ...]
    radar_track: tuple[str | None, ...]  # "1/3", several with a space between
    updated_by: tuple[str, ...]  # "gps", "radar", "coast"
    state: tuple[str, ...]  # "gps only", "radar only", "fused", "coasting"
    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats  # above the ellipsoid
    altitude_msl_m: Floats
    velocity_mps: Floats  # (n, 3) east, north, up at that point
    covariance: Floats  # (n, 36) row-major over east, north, up position and velocity at that point
    modes: Floats  # (n, 3) straight, left, right; NaN = the estimator has none
    runway_m: Floats  # (n, 3) position in the runway frame
    bias_m: Floats  # (n, 3) estimated error of the position source, east north up; NaN = none
    ended: tuple[Ended, ...] = ()
