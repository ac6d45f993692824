"""How good a track was on an approach, by what ICAO Annex 10 (volume I, 3.2) asks of a precision approach radar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.settings import Site

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Course:
    """An approach over its seconds (n,): deviations as `gateway.predict.approach` has them, m; ground speed, sink rate m/s."""

    time: NDArray[np.int64]
    distance_m: Floats
    above_m: Floats
    left_m: Floats
    height_m: Floats
    speed_mps: Floats
    sink_mps: Floats


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Against the truth over the approach, m; the shares are of seconds that were within Annex 10's limits."""

    seconds: int
    lateral_rmse_m: float
    vertical_rmse_m: float
    azimuth_within: float
    elevation_within: float


def azimuth_limit(range_m: ArrayLike, off_m: ArrayLike) -> Floats:
    """What a precision radar may be off to the side (n,), m: 0.6 % of the range and 10 % of the deviation, at least 9 m."""
    return np.asarray(np.maximum(0.006 * np.asarray(range_m) + 0.1 * np.abs(np.asarray(off_m)), 9.0))


def elevation_limit(range_m: ArrayLike, off_m: ArrayLike) -> Floats:
    """What it may be off upright (n,), m: 0.4 % of the range and 10 % of the deviation, at least 6 m."""
    return np.asarray(np.maximum(0.004 * np.asarray(range_m) + 0.1 * np.abs(np.asarray(off_m)), 6.0))


def radar_range(site: Site, course: Course) -> Floats:
    """Distance to the site's first radar, or to the aiming point where it has none (n,), m."""
    x, y = (site.radars[0].along_m, site.radars[0].left_m) if site.radars else (site.runway.aiming_point_x_m, 0.0)
    along = x - (site.runway.threshold_x_m - course.distance_m)
    return np.sqrt(along**2 + (course.left_m - y) ** 2 + course.height_m**2)


def accuracy_of(site: Site, course: Course, true: Course) -> Accuracy | None:
    """Of a course at the times of the true one; None where they have no second in common."""
    left, above = course.left_m - true.left_m, course.above_m - true.above_m
    known = np.isfinite(left) & np.isfinite(above)
    if not known.any():
        return None
    reach = radar_range(site, true)
    azimuth = np.abs(left) <= azimuth_limit(reach, true.left_m)
    elevation = np.abs(above) <= elevation_limit(reach, true.above_m)
    return Accuracy(
        int(known.sum()),
        float(np.sqrt(np.mean(left[known] ** 2))),
        float(np.sqrt(np.mean(above[known] ** 2))),
        float(azimuth[known].mean()),
        float(elevation[known].mean()),
    )
