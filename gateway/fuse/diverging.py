"""When a filter has lost its track, so that it begins anew where the measurements are, under the same track number.

A measurement that lies far out pulls no more than a bounded amount, and one in between that fits shows that the filter is
right. Where several in a row lie far out, whatever their source, it is the filter that is wrong: it would follow all the
same, but slowly, and at a speed that nothing flies. A state that is no number, or is surer than sure, is lost at once.
"""

from __future__ import annotations

import math

import numpy as np

from gateway.align import SECOND, Fix
from gateway.estimators.kalman import POSITION, Estimate
from gateway.fuse.events import Event, Measure

IN_A_ROW = 5  # far measurements that no good one came between
FEW, LONG_S = 3, 8.0  # or so many over so long: with seconds between them a filter catches up by chance, at any speed

_MOVING = np.arange(6)


def far_row(base: Event, measure: Measure) -> tuple[int, int]:
    """How many far measurements in a row there are with this one, and since when."""
    return base.far_off + 1, base.far_since if base.far_off else measure.at


def is_lost(event: Event) -> bool:
    """Whether too many measurements in a row were far away."""
    return event.far_off >= IN_A_ROW or (event.far_off >= FEW and event.at - event.far_since >= LONG_S * SECOND)


def is_sound(after: Estimate) -> bool:
    """Whether all of some states are numbers, and all variances of positions and velocities positive."""
    variance = after.covariance[:, _MOVING, _MOVING]
    return bool((variance > 0.0).all()) and math.isfinite(float(after.mean.sum()) + float(after.covariance.sum()))


def row_of(states: Estimate, row: int) -> Estimate:
    """One of some states."""
    return Estimate(states.mean[row : row + 1], states.covariance[row : row + 1])


def can_begin(measure: Measure) -> bool:
    """Whether a measurement alone gives a place: a report, or a plot that lacks nothing."""
    return isinstance(measure, Fix) or not any(map(math.isnan, measure.polar))


def why(was: Estimate, now: Estimate, far_off: int) -> str:
    """What is told of a filter that begins anew: states (1, 9) with the measurement worked in, and begun from it alone."""
    if not is_sound(was):
        return "its covariance was no longer positive"
    off_m = float(np.linalg.norm(now.mean[0, POSITION] - was.mean[0, POSITION]))
    away = f"{off_m:.0f} m" if off_m < 1000.0 else f"{off_m / 1000.0:.1f} km"
    return f"its last {far_off} measurements were all far from where it was expected, the newest by {away}"
