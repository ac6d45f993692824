"""Evidence on one noise: sums that grow while measurements scatter otherwise than stated, and by how much they do.

For each noise run sums of evidence, for 1.5 times what is stated and for 1.5 times less: the logarithm of how much likelier
that makes what was measured. A sum that falls below nothing begins anew (Page's CUSUM), so that it does not matter since
when a setting is wrong. Where noise is as stated a sum reaches L by chance once in exp(L) measurements or more seldom.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.fuse.events import Event
from gateway.fuse.scatter import PAIR, Left

Floats = NDArray[np.float64]

WRONG = 1.5  # what is looked for, either way
# Squares beyond tell nothing: they are outliers, turns and lost tracks. Of noise that is less than stated small ones tell.
FAR_UP, FAR_DOWN = 12.0, 6.0
LEAST, FARTHEST = 1e-6, 144.0  # squares that tell by how much it is wrong
ENOUGH = (
    150.0  # of these tell it to a seventh; fewer that make sure of it were large by chance, and would tell too much
)
LOG_OF_SQUARE = -1.2704  # mean logarithm of a normal deviate's square
DISTURBED = 0.3  # of the noise's variance, by a hard manoeuvre that never ends: not yet taken for 1.5 times the noise


@dataclass(frozen=True, slots=True)
class Finding:
    """A source that is inconsistent with its settings: what is said of it, and under which heading it is said once."""

    topic: str
    text: str


@dataclass(frozen=True, slots=True)
class Part:
    """Which components of a measurement share one noise, and where that is set: a key in a table of the site file."""

    name: str
    first: int
    last: int
    key: str
    unit: str
    per_unit: float = 1.0  # of what is inside for one in the file
    by_filter: bool = (
        True  # whether a filter's surprise tells of more noise than stated: of velocities gusts tell the same
    )

    @property
    def components(self) -> slice:
        """Of a measurement's components, those of this part."""
        return slice(self.first, self.last)


REPORT = (
    Part("position", 0, 3, "sigma_m", "m"),
    Part("velocity", 3, 6, "velocity_sigma_mps", "m/s", by_filter=False),
)
PLOT = (
    Part("range", 0, 1, "range_sigma_m", "m"),
    Part("azimuth", 1, 2, "azimuth_sigma_deg", "degrees", math.pi / 180.0),
    Part("elevation", 2, 3, "elevation_sigma_deg", "degrees", math.pi / 180.0),
)


def summed(sums: Floats, added: Floats) -> Floats:
    """Sums (n, 9) with what some measurements told: three sums each, for more than stated, for less by the source itself, and
    for less by the filter; of each its level, how many squares came in since it was nothing, and the sum of their logarithms.
    """
    after = (sums + added).reshape(-1, 3, 3)
    return np.where(after[:, :, :1] > 0.0, after, 0.0).reshape(-1, 9)


def factors(sums: Floats, sure: float, enough: float = ENOUGH) -> Floats:
    """How many times as much as stated sources scatter, (n,), where evidence is above a level; NaN = as stated, or not sure.

    Of logarithms the mean is taken, which single large squares hardly move.
    """
    each = sums.reshape(-1, 3, 3)
    level, count, logs = each[:, :, 0], each[:, :, 1], each[:, :, 2]
    found = np.exp(0.5 * (logs / np.maximum(count, 1.0) - LOG_OF_SQUARE))
    found = np.where((level > sure) & (count >= enough), found, np.nan)
    return np.asarray(np.where(np.isnan(found[:, 0]), np.fmin(found[:, 1], found[:, 2]), found[:, 0]))


@dataclass(frozen=True, slots=True)
class Changes:
    """The filter's innovations, as changes from one of a source to the next, (n, k); NaN where there are none."""

    change: Floats  # as measured
    by_scatter: Floats  # in units of what they should scatter by


def changes_of(events: Sequence[Event], size: int) -> Changes:
    """Those of some events, of so many components each."""
    nothing = np.full(size, math.nan)
    told = [event.residual for event in events]
    change = np.concatenate([nothing if one is None else one.change for one in told])
    by_scatter = np.concatenate([nothing if one is None else one.change_by_scatter for one in told])
    return Changes(change.reshape(-1, size), by_scatter.reshape(-1, size))


def evidence(left: Left, changes: Changes, sigma: Floats, part: Part) -> Floats:
    """What each of n measurements tells of one part with stated noise (n,): (n, 9), to be `summed`.

    `left`: what `scatter` leaves over of them. Where that would be disturbed by manoeuvres the filter's innovations take its
    place, as changes from one to the next: by what they should scatter by (S) to find more noise than stated, and by the
    stated noise alone (R) to find less: however a target moves, they hold the noise of both measurements.
    """
    some = part.components
    own, share = np.square(left.by_noise[:, some]), left.share[:, some]
    calm = left.disturbed[:, some] < DISTURBED
    by_scatter = changes.by_scatter[:, some] if part.by_filter else np.full(own.shape, math.nan)
    change = changes.change[:, some] / sigma[:, None]
    columns = (
        *_counted(np.where(calm, own, np.square(by_scatter)), np.where(calm, share, PAIR), FAR_UP),
        *_counted(own, share, FAR_DOWN),
        *_counted(np.where(calm, math.nan, np.square(change)), np.full(share.shape, PAIR), FAR_DOWN),
    )
    return np.stack(columns, axis=1)


def _counted(square: Floats, share: Floats, far: float) -> tuple[Floats, Floats, Floats]:
    """Evidence of squares (n, c) for noise that is wrong one way or the other, how many there are, their logarithms, (n,)."""
    near, known = square < far, square < FARTHEST  # False for NaN
    times = WRONG if far == FAR_UP else 1.0 / WRONG
    told = np.where(near, share * (0.5 * (1.0 - 1.0 / times**2) * square - math.log(times)), 0.0)
    logs = np.log(np.where(known, np.maximum(square, LEAST), 1.0))
    return told.sum(axis=1), known.sum(axis=1, dtype=np.float64), logs.sum(axis=1)
