"""When a filter has lost its track, so that it begins anew where the measurements are, under the same track number.

A measurement that lies far out pulls no more than a bounded amount, and one in between that fits shows that the filter is
right. Where several in a row lie far out, whatever their source, it is the filter that is wrong: it would follow all the
same, but slowly, and at a speed that nothing flies. A state that is no number, or is surer than sure, is lost at once.

What is lost again soon after may have been begun with a velocity that is not that of the positions (another sign, another
unit, or none where the aircraft flies). Then velocities of its reports are left out until they fit what their positions say.

What took in velocities that are known to be wrong by now is sure of a wrong speed, and follows positions too slowly to be
lost: it begins anew without them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix
from gateway.estimators.kalman import Estimate
from gateway.fuse.events import Doubt, Event, Measure

Floats = NDArray[np.float64]

IN_A_ROW = 5  # far measurements that no good one came between
FEW, LONG_S = 3, 10.0  # or so many over so long: with seconds between them a filter catches up by chance, at any speed
# What a hard manoeuvre does to a filter that is sure of itself is not a loss: 1 g for as long as nothing fits, and 30 m.
MANOEUVRE_MPS2, NEAR_M = 10.0, 30.0

AGAIN_S, AGAIN_INTERVALS = 10.0, 8  # lost again within so long, or so many intervals between measurements
DOUBTS = 10  # velocities in a row that must fit before they are believed again
KNOWN_MPS, FITS_SIGMA = 10.0, 3.0  # a velocity that is not known so well fits anything

MISLED = "velocities that are not those of its positions led it"

_MOVING, _SPEEDS = np.arange(6), np.arange(3, 6)


def far_row(base: Event) -> tuple[int, int]:
    """How many far measurements in a row there are with this one of a track, and when the last good one was valid."""
    return base.far_off + 1, base.far_since if base.far_off else base.at


def may_be_lost(event: Event) -> bool:
    """Whether so many measurements in a row were far away that their distance decides."""
    return event.far_off >= IN_A_ROW or (event.far_off >= FEW and event.at - event.far_since >= LONG_S * SECOND)


def can_begin(measure: Measure) -> bool:
    """Whether a measurement alone gives a place: a report, or a plot that lacks nothing."""
    return isinstance(measure, Fix) or not any(map(math.isnan, measure.polar))


def why(event: Event, first: Estimate) -> str | None:
    """Why a filter begins anew with a measurement: states with it worked in, and begun from it alone (1, 9); None = not."""
    if not is_sound(Estimate(event.mean[None], event.covariance[None])):
        return "its covariance was no longer positive"
    axes = 2 if isinstance(event.measure, Fix) and not event.measure.has_height else 3
    off_m = float(np.linalg.norm(first.mean[0, :axes] - event.mean[:axes]))
    since_s = (event.at - event.far_since) / SECOND
    if off_m <= NEAR_M + 0.5 * MANOEUVRE_MPS2 * since_s * since_s:
        return None
    away = f"{off_m:.0f} m" if off_m < 1000.0 else f"{off_m / 1000.0:.1f} km"
    return f"its last {event.far_off} measurements were all far from where it was expected, the newest by {away}"


def lost_again(event: Event) -> bool:
    """Whether a filter that is lost began anew only lately."""
    return event.at - event.restarted_at <= max(int(AGAIN_S * SECOND), AGAIN_INTERVALS * event.interval)


def is_misled(base: Event, doubt: Doubt) -> bool:
    """Whether a track's state comes of velocities that are known to be wrong: it never began without them."""
    return doubt is Doubt.ALL_ALONG and not base.doubts


def believed(base: Event, measure: Measure) -> Measure:
    """A measurement as the filter takes it: without its velocity while velocities of this track's reports are doubted."""
    return without_velocity(measure) if base.doubts else measure


def without_velocity(measure: Measure) -> Measure:
    """A report without its velocity; a plot has none."""
    if not isinstance(measure, Fix):
        return measure
    nothing = np.full(3, math.nan)
    local = None if measure.local is None else replace(measure.local, velocity_mps=nothing)
    return replace(measure, velocity_mps=nothing, local=local)


def doubts_after(doubts: int, measure: Measure, mean: Floats, covariance: Floats) -> int:
    """Doubts that are left after a measurement and the state with its position worked in: none after so many that fit."""
    if not isinstance(measure, Fix) or np.isnan(measure.velocity_mps).any():
        return doubts
    variance = covariance[_SPEEDS, _SPEEDS]
    if variance.max() > KNOWN_MPS**2:
        return DOUBTS
    off = np.abs(measure.velocity_mps - mean[_SPEEDS])
    fits = (off <= FITS_SIGMA * np.sqrt(variance + measure.velocity_sigma_mps**2)).all()
    return doubts - 1 if fits else DOUBTS


def is_sound(after: Estimate) -> bool:
    """Whether some states (n, 9) are numbers, and all variances of their positions and velocities positive."""
    variance = after.covariance[:, _MOVING, _MOVING]
    return bool((variance > 0.0).all()) and math.isfinite(float(after.mean.sum()) + float(after.covariance.sum()))
