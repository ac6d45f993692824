"""Whether sources scatter as much as the settings say: a running test of each source's noise, part by part.

What is looked at is what `scatter` leaves over of a measurement beside its neighbours; `evidence` sums up what that tells.
Something is said at a level that grows with the number of noises watched, so that among thousands none is suspected by
chance. Aircraft whose noise the site file states are also judged together: that is sooner sure.

What a stream says of its own accuracy is never found too careful: a receiver's error that lasts is part of it. For the same
reason nothing is said of a receiver whose reports hardly scatter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.fuse.events import Event, Measure
from gateway.fuse.evidence import ENOUGH, PLOT, REPORT, Part, evidence, factors, summed
from gateway.fuse.scatter import Rows, left_of_plots, left_of_reports, rows_of
from gateway.settings import PositionSource, RadarSite

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SURE = 12.0  # evidence that is sure of a single noise; of many, the logarithm of their number more
LASTING = 0.3  # a receiver whose reports scatter by less than this share of what is stated has errors that last
TOGETHER_AT_LEAST, TOGETHER_ENOUGH = 3, 4.0 * ENOUGH  # aircraft, and squares of theirs, which are many soon
MANY, WAIT_NS = 64, 5 * SECOND  # measurements that are judged at once, or all that came in so long
KEPT_PLOTS, KEPT_REPORTS = 6, 3  # of each track and source, to hold the next ones against
KEPT_NS = 30 * SECOND
NOISES_AT_MOST = 8192  # the least lately heard are forgotten
FORGOTTEN_NS = 3600 * SECOND  # and those that were not heard for so long

Key = tuple[str, str, bool]  # source, part, whether the site file sets its noise
ALL = "GPS"  # the source that all aircraft together are


@dataclass(frozen=True, slots=True)
class Finding:
    """A source that is inconsistent with its settings: what is said of it, and under which heading it is said once."""

    topic: str
    text: str


@dataclass(frozen=True, slots=True)
class Told:
    """What new measurements tell of one part of each: whose noises these are, and the sums of `evidence`, (n, 9)."""

    part: Part
    keys: list[Key]
    measures: list[Measure]
    sigma: Floats  # (n,) as stated
    evidence: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Consistency:
    """What is known of each noise; the measurements of the last second; and what the next ones are held against."""

    noises: Mapping[Key, int] = field(default_factory=dict)  # the row of each in what follows
    sums: Floats = field(default_factory=lambda: np.zeros((0, 9)))  # as `summed` has them
    heard: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # when each source was last
    waiting: tuple[tuple[int, Event], ...] = ()
    reports: Rows | None = None
    plots: Rows | None = None

    def hearing(self, events: Iterable[tuple[int, Event]]) -> Consistency:
        """The same with new measurements waiting to be judged, each with its track."""
        return replace(self, waiting=(*self.waiting, *events))

    @property
    def levels(self) -> Floats:
        """The greatest evidence on each noise, (n,)."""
        return np.asarray(self.sums[:, ::3].max(axis=1, initial=0.0))

    @property
    def sure(self) -> float:
        """How much evidence is sure."""
        return SURE + math.log(max(len(self.noises), 1))

    def judged(
        self,
        position: PositionSource,
        radars: Mapping[int, RadarSite],
        at: int = 0,
    ) -> tuple[Consistency, list[Finding]]:
        """At a whole second, the same with what waited worked in, and what is sure by now of the sources just heard.

        A few measurements wait for others: many cost hardly more. Sources that were not heard for an hour are forgotten.
        """
        if len(self.waiting) < MANY and at % WAIT_NS:
            return self, []
        waiting = sorted(self.waiting, key=lambda one: one[1].measure.serial)
        told, kept = [], []
        for known, count, plots in ((self.reports, KEPT_REPORTS, False), (self.plots, KEPT_PLOTS, True)):
            new = [one for one in waiting if isinstance(one[1].measure, Plot) == plots]
            rows = rows_of(new).merged(known) if new else known
            if rows is not None and new:
                told += _told(rows, [event for _, event in new], position, radars)
            latest = None if rows is None else rows.latest(count, at - KEPT_NS)
            kept.append(latest if latest is not None and len(latest.at) else None)
        after = replace(self, waiting=(), reports=kept[0], plots=kept[1])
        after, found = after._summed(told, at) if told else (after, [])
        return after._remembered(at), found

    def _summed(self, told: Sequence[Told], at: int) -> tuple[Consistency, list[Finding]]:
        """The same with evidence added to the sums, and what is sure by now."""
        everybody = [(ALL, one.part.name, True) for one in told if one.part in REPORT]
        every = dict.fromkeys((*self.noises, *(key for one in told for key in one.keys), *everybody))
        noises = {key: row for row, key in enumerate(every)}
        added = np.zeros((len(noises), 9))
        rows = [np.array([noises[key] for key in one.keys], dtype=np.int64) for one in told]
        for one, place in zip(told, rows, strict=True):
            np.add.at(added, place, one.evidence)
        sums, heard = np.zeros((len(noises), 9)), np.full(len(noises), at)
        sums[: len(self.sums)], heard[: len(self.heard)] = self.sums, self.heard
        sums = summed(sums, added)
        heard[np.concatenate(rows)] = at
        after = replace(self, noises=noises, sums=sums, heard=heard)
        factor = factors(sums, after.sure)
        found: dict[tuple[str, str], Finding] = {}
        for one, place in zip(told, rows, strict=True):
            of_all = _together(one, place, noises, sums, added, factor, after.sure)
            for row in np.flatnonzero(~np.isnan(factor[place])).tolist():
                key = one.keys[row]
                if not (key[2] and of_all) and (finding := _finding(one, row, key, float(factor[place[row]]))):
                    found[key[0], key[1]] = finding
            if of_all:
                found[ALL, one.part.name] = of_all
        return after, list(found.values())

    def _remembered(self, at: int) -> Consistency:
        """The same without noises of sources that were not heard for long, or of too many."""
        keep = self.heard >= at - FORGOTTEN_NS
        if len(keep) > NOISES_AT_MOST:
            keep &= self.heard.argsort(kind="stable").argsort() >= len(keep) - NOISES_AT_MOST
        if keep.all():
            return self
        keys = [key for key, is_kept in zip(self.noises, keep.tolist(), strict=True) if is_kept]
        return replace(
            self, noises={key: row for row, key in enumerate(keys)}, sums=self.sums[keep], heard=self.heard[keep]
        )


def _told(rows: Rows, events: Sequence[Event], position: PositionSource, radars: Mapping[int, RadarSite]) -> list[Told]:
    """What new measurements of one kind, reports or plots, tell of each of their parts; `rows` names them by number."""
    is_plot = isinstance(events[0].measure, Plot)
    left = left_of_plots(rows) if is_plot else left_of_reports(rows)
    fresh = np.flatnonzero(rows.new)
    if not len(fresh):
        return []
    left, sigma = left.of(fresh), rows.sigma[fresh]
    new = [events[place] for place in rows.event[fresh].tolist()]
    measures = [event.measure for event in new]
    sources = [_source(measure) for measure in measures]
    said = np.array([_said(measure, position, radars) for measure in measures]).reshape(len(new), -1)
    found = []
    for number, part in enumerate(PLOT if is_plot else REPORT):
        stated = sigma[:, part.first]
        is_set = (np.abs(stated - said[:, number]) <= 1e-9 * stated).tolist()
        weighed = evidence(left, new, stated, part)
        some = np.flatnonzero(
            weighed.any(axis=1)
        )  # the first measurements of a source tell nothing: no noise is watched yet
        keys = [(sources[row], part.name, is_set[row]) for row in some.tolist()]
        found.append(Told(part, keys, [measures[row] for row in some.tolist()], stated[some], weighed[some]))
    return found


def _together(
    told: Told, place: Ints, noises: Mapping[Key, int], sums: Floats, added: Floats, factor: Floats, sure: float
) -> Finding | None:
    """All aircraft whose noise the site file states as one source, but for those that are known to be off: into `sums`."""
    chosen = np.unique(place[[key[2] for key in told.keys]])
    row = noises.get((ALL, told.part.name, True))
    if row is None or len(chosen) < TOGETHER_AT_LEAST:
        return None
    honest = chosen[np.isnan(factor[chosen])]
    sums[row] = summed(sums[row : row + 1], added[honest].sum(axis=0, keepdims=True))[0]
    (found,) = factors(sums[row : row + 1], sure, TOGETHER_ENOUGH).tolist()
    first = next(row for row, key in enumerate(told.keys) if key[2])
    return _finding(told, first, (ALL, told.part.name, True), found)


def _source(measure: Measure) -> str:
    return f"GPS of {measure.aircraft}" if isinstance(measure, Fix) else f"radar {measure.radar}"


def _said(measure: Measure, position: PositionSource, radars: Mapping[int, RadarSite]) -> tuple[float, ...]:
    """The sigma of each part that the site file sets, NaN = none."""
    if isinstance(measure, Fix):
        return position.sigma_m, position.velocity_sigma_mps
    radar = radars.get(measure.radar)
    if radar is None:
        return math.nan, math.nan, math.nan
    return radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad


def _finding(told: Told, row: int, key: Key, factor: float) -> Finding | None:
    """What is said of a noise that is so many times what is stated, if anything."""
    source, name, is_set = key
    part, measure = told.part, told.measures[row]
    least = 0.0 if isinstance(measure, Plot) else LASTING
    if not (factor > 1.0 or (is_set and factor > least)):  # NaN too
        return None
    stated = float(told.sigma[row]) / part.per_unit
    topic = f"scatter of {name}, {source}"
    text = f"{source}: its {name} scatters {factor:.2g} times as much as "
    if source == ALL:
        text = f"{source}: the {name} of the aircraft here scatters {factor:.2g} times as much as "
    if not is_set:
        return Finding(
            topic, f"{text}its stream says ({stated:.3g} {part.unit}): tracks are less sure than they are told to be"
        )
    table = f"the [[radar]] number {measure.radar}" if isinstance(measure, Plot) else "[position]"
    text += f"the stated {stated:.3g} {part.unit}: set {part.key} = {stated * factor:.2g} in {table} of the site file"
    return Finding(topic, text)
