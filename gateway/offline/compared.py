"""A rebuilt path held against the positions that were told."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.tied_path import at_times
from gateway.offline.carrying import Place, level_m
from gateway.offline.parameters import Times

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Compared:
    """The rebuilt path beside the positions that were told of the same times; distances are level, m."""

    time: Times  # (m,)
    place_m: Floats  # (m, 2) told: east and north of lift-off
    height_m: Floats  # (m,) told, above the first of them
    off_m: Floats  # (m,) the rebuilt path's distance
    off_open_m: Floats  # (m,) the open path's
    height_rmse_m: float

    @property
    def rmse_m(self) -> float:
        """Of the rebuilt path."""
        return math.sqrt(float(np.mean(self.off_m**2)))

    @property
    def open_rmse_m(self) -> float:
        """Of the path through the air."""
        return math.sqrt(float(np.mean(self.off_open_m**2)))

    @property
    def length_m(self) -> float:
        """Of the way over the ground, by the positions."""
        return float(np.linalg.norm(np.diff(self.place_m, axis=0), axis=1).sum())


def compared_with(
    places: tuple[Times, Floats], time: Times, open_m: Floats, path_m: Floats, height_m: Floats, lift_off: Place
) -> Compared | None:
    """The paths open and rebuilt, (n, 3) and (n, 2) m, beside positions; None of fewer than two."""
    told_at, values = places
    within = (told_at >= time[0]) & (told_at <= time[-1])
    if np.count_nonzero(within) < 2:
        return None
    at_s = (told_at[within] - time[0]) * 1e-9
    time_s = (time - time[0]) * 1e-9
    told = level_m(values[within, 0], values[within, 1], lift_off)
    off, off_alone = (np.linalg.norm(at_times(at_s, time_s, one) - told, axis=1) for one in (path_m, open_m[:, :2]))
    high = np.where(np.isnan(values[within, 2]), values[within, 3], values[within, 2])
    high = high - high[0]
    lower = np.interp(at_s, time_s, height_m) - high
    height_rmse = math.sqrt(float(np.mean((lower - lower[0]) ** 2)))
    return Compared(told_at[within], told, high, off, off_alone, height_rmse)
