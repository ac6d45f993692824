"""Whether sources scatter as much as the settings say: a running test of what the filter did not expect.

Looked at are changes from one innovation to the next of the same track and source, over the last thousand or so of each
source and component. A filter that lags behind a manoeuvre, and a source with a constant error, are wrong in the same way for
seconds: changes do not see that, noise they do.

too small   they are larger than innovations should scatter by (S), each bounded: a turn's first second is a large change
too large   they are smaller than the stated noise alone (R). However a target moves and whatever the filter thinks, a change
            holds the noise of both measurements: only noise that is less than stated makes it small

What a stream says of its own accuracy is only held against the first: a receiver's error that lasts is part of that, and the
track follows it. For the same reason nothing is said of a receiver whose reports hardly change against each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.align import Fix, Plot
from gateway.fuse.events import Event, Measure, Residual
from gateway.settings import PositionSource, RadarSite

Floats = NDArray[np.float64]

MEMORY = 1000.0  # measurements: older ones fade
LEAST = 60.0  # measurements before anything is said
# Standard deviations, so that among thousands of sources none is suspected by chance; the lower end of chi-square is the
# steeper one, and an honest source is some way above it.
SURE_TOO_SMALL, SURE_TOO_LARGE = 4.0, 3.0
TOO_SMALL, TOO_LARGE = 1.45, 0.72  # of squares: what a model of motion is off by is not the noise's fault
MOST, BOUNDED_MEAN = 4.0, 0.9205  # of squares, and the mean of a square of unit variance that is bounded so
LASTING = 0.3  # a receiver whose reports change by less than this share of what is stated has errors that last
SOURCES_AT_MOST = 4096  # the least lately heard are forgotten
FORGOTTEN_NS = 3_600_000_000_000  # and those that were not heard for so long


@dataclass(frozen=True, slots=True)
class Part:
    """Which components of a measurement share one noise, and where that is set: a key in a table of the site file."""

    name: str
    first: int
    last: int
    key: str
    unit: str
    per_unit: float = 1.0  # of what is inside for one in the file


REPORT = (
    Part("position", 0, 3, "sigma_m", "m"),
    Part("velocity", 3, 6, "velocity_sigma_mps", "m/s"),
)
PLOT = (
    Part("range", 0, 1, "range_sigma_m", "m"),
    Part("azimuth", 1, 2, "azimuth_sigma_deg", "degrees", math.pi / 180.0),
    Part("elevation", 2, 3, "elevation_sigma_deg", "degrees", math.pi / 180.0),
)


@dataclass(frozen=True, slots=True)
class Sums:
    """Faded sums over the changes of one component, by sqrt 2: how many, and their squares."""

    count: float = 0.0
    by_scatter: float = 0.0  # of innovations by what they should scatter by
    bounded: float = 0.0  # the same with each square at most MOST, by what that makes of a mean of 1
    by_noise: float = 0.0  # of innovations by the stated noise

    def then(self, residual: Residual, some: slice, sigma: float) -> Sums:
        """The same after some components of a measurement whose noise is stated as `sigma`."""
        by_scatter, by_noise = residual.change_by_scatter[None, some], residual.change[None, some]
        return self.plus(*_squares(by_scatter, by_noise, np.array([sigma]))[0])

    def plus(self, count: float, by_scatter: float, bounded: float, by_noise: float) -> Sums:
        """The same with the sums over a measurement's components, of which so many are known."""
        keep = 1.0 - count / MEMORY
        return Sums(
            keep * self.count + count,
            keep * self.by_scatter + by_scatter,
            keep * self.bounded + bounded,
            keep * self.by_noise + by_noise,
        )

    @property
    def factor(self) -> float | None:
        """How many times as much as stated it scatters, once that is sure; None = as stated, as far as can be told."""
        if self.count < LEAST:
            return None
        chance = math.sqrt(3.0 / self.count)  # changes that follow each other share a measurement
        if self.bounded / self.count > max(TOO_SMALL, 1.0 + SURE_TOO_SMALL * chance):
            return math.sqrt(self.by_scatter / self.count)
        if self.by_noise / self.count < min(TOO_LARGE, 1.0 - SURE_TOO_LARGE * chance):
            return math.sqrt(min(self.by_scatter, self.by_noise) / self.count)
        return None


def _squares(by_scatter: Floats, change: Floats, sigma: Floats) -> list[list[float]]:
    """What n measurements of some components (n, c) with stated noise (n,) add to `Sums`: n rows for `Sums.plus`."""
    known = by_scatter == by_scatter
    scatter = np.where(known, by_scatter * by_scatter, 0.0)
    noise = np.where(known, (change / sigma[:, None]) ** 2, 0.0)
    bounded = np.minimum(scatter, MOST) / BOUNDED_MEAN
    rows: list[list[float]] = np.stack([part.sum(axis=1) for part in (known, scatter, bounded, noise)], axis=1).tolist()
    return rows


@dataclass(frozen=True, slots=True)
class Finding:
    """A source that is inconsistent with its settings: what is said of it, and under which heading it is said once."""

    topic: str
    text: str


@dataclass(frozen=True, slots=True)
class Consistency:
    """What is known of each source and component, the least lately heard first; and the measurements of the last second."""

    sums: Mapping[tuple[str, str, bool], Sums] = field(
        default_factory=dict
    )  # source, part, whether the site file sets it
    waiting: tuple[Event, ...] = ()
    heard: Mapping[str, int] = field(default_factory=dict)  # when each source was last

    def hearing(self, events: Iterable[Event]) -> Consistency:
        """The same with new measurements waiting to be judged."""
        told = (event for event in events if event.residual is not None)
        return Consistency(self.sums, (*self.waiting, *told), self.heard)

    def judged(
        self, position: PositionSource, radars: Mapping[int, RadarSite], at: int = 0
    ) -> tuple[Consistency, list[Finding]]:
        """The same with what waited worked in, in order of arrival, and what is sure by now, once of each.

        Sources that were not heard for an hour before `at` are forgotten.
        """
        sums, heard, found = dict(self.sums), dict(self.heard), dict[tuple[str, str], Finding]()
        waiting = sorted(self.waiting, key=lambda event: event.measure.serial)
        parts = _parts([event for event in waiting if isinstance(event.measure, Fix)])
        parts |= _parts([event for event in waiting if isinstance(event.measure, Plot)])
        for event in waiting:
            measure = event.measure
            source = f"GPS of {measure.aircraft}" if isinstance(measure, Fix) else f"radar {measure.radar}"
            heard[source] = event.at
            usual = _usual(measure, position, radars)
            for (part, stated, added), said in zip(parts[measure.serial], usual, strict=True):
                is_set = said is not None and math.isclose(stated, said, rel_tol=1e-9)
                key = source, part.name, is_set
                after = sums[key] = sums.pop(key, NOTHING).plus(*added)
                if (source, part.name) not in found:
                    factor = after.factor
                    told_least = 0.0 if isinstance(measure, Plot) else LASTING
                    if factor is not None and (factor > 1.0 or (is_set and factor > told_least)):
                        found[source, part.name] = _finding(measure, source, part, stated, factor, is_set)
        while len(sums) > SOURCES_AT_MOST:
            oldest = next(iter(sums))
            del sums[oldest]
            heard.pop(oldest[0], None)
        gone = {source for source, last in heard.items() if last < at - FORGOTTEN_NS}
        if gone:
            sums = {key: one for key, one in sums.items() if key[0] not in gone}
            heard = {source: last for source, last in heard.items() if source not in gone}
        return Consistency(sums, heard=heard), list(found.values())


NOTHING = Sums()
Told = tuple[Part, float, list[float]]  # of one part of a measurement: the stated sigma, and what it adds to the sums


def _parts(events: Sequence[Event]) -> dict[int, list[Told]]:
    """What measurements of one kind tell, by their serial numbers: all of a second in one go."""
    if not events:
        return {}
    residuals = [event.residual for event in events if event.residual is not None]
    by_scatter = np.array([one.change_by_scatter for one in residuals])
    change = np.array([one.change for one in residuals])
    sigma = np.array([_stated(event.measure) for event in events])
    columns = []
    for number, part in enumerate(REPORT if isinstance(events[0].measure, Fix) else PLOT):
        some = slice(part.first, part.last)
        added = _squares(by_scatter[:, some], change[:, some], sigma[:, number])
        columns.append([(part, *one) for one in zip(sigma[:, number].tolist(), added, strict=True)])
    told = zip(*columns, strict=True)
    return {event.measure.serial: list(one) for event, one in zip(events, told, strict=True)}


def _stated(measure: Measure) -> tuple[float, ...]:
    """The stated sigma of each part."""
    return measure.sigma if isinstance(measure, Plot) else (float(measure.sigma_m[0]), measure.velocity_sigma_mps)


def _usual(measure: Measure, position: PositionSource, radars: Mapping[int, RadarSite]) -> tuple[float | None, ...]:
    """The sigma of each part that the site file sets."""
    if isinstance(measure, Fix):
        return position.sigma_m, position.velocity_sigma_mps
    radar = radars.get(measure.radar)
    if radar is None:
        return None, None, None
    return radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad


def _finding(measure: Measure, source: str, part: Part, sigma: float, factor: float, is_set: bool) -> Finding:
    topic = f"scatter of {part.name}, {source}"
    text = f"{source}: its {part.name} scatters {factor:.2g} times as much as "
    stated = sigma / part.per_unit
    if not is_set:
        return Finding(
            topic, f"{text}its stream says ({stated:.3g} {part.unit}): tracks are less sure than they are told to be"
        )
    table = f"the [[radar]] number {measure.radar}" if isinstance(measure, Plot) else "[position]"
    text += f"its stated {stated:.3g} {part.unit}: set {part.key} = {stated * factor:.2g} in {table} of the site file"
    return Finding(topic, text)
