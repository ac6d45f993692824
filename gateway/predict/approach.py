"""How far an aircraft on the approach is off its glide path and the runway's centreline.

The glide path is a straight line in space, as a landing radar sees it and as an ILS flies it: it meets the
runway's plane at `Runway.aiming_point_x_m` and rises at `Runway.glide_path_rad` from there, back along the
approach.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.settings import Runway

Floats = NDArray[np.float64]

ABEAM_LIMIT_RAD = math.radians(30.0)  # farther off the centreline than this nobody is on the approach


@dataclass(frozen=True, slots=True)
class Deviations:
    """Columns of the shape of the positions; NaN where the aircraft is not on the approach."""

    distance_m: Floats  # along the centreline to the threshold
    lateral_m: Floats  # positive: left of the centreline, as the pilot sees it
    lateral_rad: Floats  # the same, seen from the aiming point
    vertical_m: Floats  # positive: above the glide path
    vertical_rad: Floats  # the same, seen from the aiming point


def deviations(runway: Runway, runway_m: ArrayLike, along_mps: ArrayLike) -> Deviations:
    """Deviations from glide path and centreline at runway-frame positions (..., 3).

    `along_mps` (...) is the velocity along the landing direction. On the approach is who is before the
    threshold, within 30 degrees of the centreline seen from the aiming point, and coming closer.
    """
    place = np.asarray(runway_m, dtype=np.float64)
    x, y, z = place[..., 0], place[..., 1], place[..., 2]
    before_aim = runway.aiming_point_x_m - x
    lateral = np.arctan2(y, before_aim)
    on_approach = (x < runway.threshold_x_m) & (np.abs(lateral) <= ABEAM_LIMIT_RAD) & (np.asarray(along_mps) > 0.0)
    columns = (
        runway.threshold_x_m - x,
        y,
        lateral,
        z - before_aim * math.tan(runway.glide_path_rad),
        np.arctan2(z, before_aim) - runway.glide_path_rad,
    )
    return Deviations(*(np.where(on_approach, column, np.nan) for column in columns))
