"""What the filter works on: measurements in their order, jobs of them, and the events that they leave behind."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gateway.align import Fix, Plot, Polar
from gateway.estimators.modes import Mixture
from gateway.frozen import made_swiftly
from gateway.fuse.headings import Heading

Floats = NDArray[np.float64]
Measure = Fix | Plot
Near = tuple[int, Polar, Polar]  # radar, range, azimuth, elevation, and their sigmas
Neighbour = Callable[[Fix], Near | None]  # what a track's radar measured at a report's time
Belief = Mixture | Floats | None  # what an estimator keeps of a track beside mean and covariance, of one track

NEVER = -(1 << 62)


class Doubt(IntEnum):
    """Whether velocities of an aircraft's reports are known not to be those of its positions."""

    NONE = 0
    LATELY = 1  # they turned wrong, and none of them was worked in: they are left out
    ALL_ALONG = 2  # and what they told the track before is dropped


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """How far a measurement's k components were from where they were expected, (k,) each, NaN = not measured."""

    innovation: Floats  # metres, m/s, or radians
    by_scatter: Floats  # in units of what it should scatter by
    change: Floats  # of `innovation` since the last measurement of this source, by sqrt 2; NaN where there is none
    change_by_scatter: Floats

    @classmethod
    def after(cls, before: Residual | None, innovation: Floats, by_scatter: Floats) -> Residual:
        """The residual that follows another one of the same source, or none."""
        if before is None:
            unknown = np.full_like(innovation, np.nan)
            return cls(innovation, by_scatter, unknown, unknown)
        change, by_scatter_too = innovation - before.innovation, by_scatter - before.by_scatter
        return cls(innovation, by_scatter, _HALF_ROOT * change, _HALF_ROOT * by_scatter_too)


_HALF_ROOT = math.sqrt(0.5)


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """A track's state after one of its measurements, and when each kind of source last saw it."""

    measure: Measure
    mean: Floats  # (9,)
    covariance: Floats  # (9, 9)
    memory: Floats  # (w, 3) past innovations of the position source
    gps_at: int
    radar_at: int
    interval: int  # ns, the longest of the last few between measurements
    outlying: bool
    height_at: int  # when the vertical was last measured
    barometric: Fix | None  # the last report with a pressure altitude
    callsign: str | None
    belief: Belief  # only the estimator that made it reads it
    far_off: int = 0  # measurements in a row, this one included, that were far from where the track was expected
    far_since: int = NEVER  # when the last one before them was valid
    restarted: str | None = None  # why the filter began anew with this measurement; None = it went on
    restarted_at: int = NEVER  # when it last did
    doubts: int = 0  # velocities of reports that must fit before they are believed again
    score: float = 0.0  # how much speaks for one thing that flies (agreement.py); infinite = confirmed

    residual: Residual | None = None  # None: of the first measurement, and of an estimator that does not tell
    latest: Mapping[int, Residual] = field(default_factory=dict)  # of each radar, this one included; 0 = of reports

    @property
    def at(self) -> int:
        """When the state holds."""
        return self.measure.at

    @property
    def heard_at(self) -> int:
        """When a source last saw the track; dead reckoning is none."""
        return max(self.gps_at, self.radar_at)

    @property
    def mixture(self) -> Mixture | None:
        """The modes' states, where the estimator has modes; mean and covariance are then their mixture's."""
        return self.belief if isinstance(self.belief, Mixture) else None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Job:
    """Measurements of one track, in order, to be worked in after a state; without a state the first one starts it."""

    track: int
    base: Event | None
    measures: Sequence[Measure]
    neighbour: Neighbour
    fresh: int = -1  # serial of the measurement that asked for it
    headings: tuple[Heading, ...] = ()  # where its aircraft says it goes
    doubt: Doubt = Doubt.NONE


def rank(measure: Measure) -> tuple[int, int, str, int]:
    """The order in which measurements are worked in: by validity; at one instant by source, then by arrival."""
    if isinstance(measure, Fix):
        return measure.at, 0, measure.aircraft, measure.serial
    return measure.at, 1, f"{measure.radar:05d}/{measure.number:05d}", measure.serial
