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
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.estimators.kalman import VELOCITY
from gateway.fuse.events import Event, Measure
from gateway.fuse.evidence import ENOUGH, PLOT, REPORT, Part, Sums, evidence
from gateway.fuse.scatter import left_of_plots, left_of_reports, rows_of
from gateway.settings import PositionSource, RadarSite

Floats = NDArray[np.float64]

SURE = 12.0  # evidence that is sure of a single noise; of many, the logarithm of their number more
LASTING = 0.3  # a receiver whose reports scatter by less than this share of what is stated has errors that last
TOGETHER_AT_LEAST, TOGETHER_ENOUGH = 3, 4.0 * ENOUGH  # aircraft, and squares of theirs, which are many soon
MANY, WAIT_NS = 64, 5 * SECOND  # measurements that are judged at once, or all that came in so long
KEPT_PLOTS, KEPT_REPORTS = 6, 3  # of each track and source, to hold the next ones against
KEPT_NS = 30 * SECOND
SOURCES_AT_MOST = 4096  # the least lately heard are forgotten
FORGOTTEN_NS = 3600 * SECOND  # and those that were not heard for so long

Key = tuple[str, str, bool]  # source, part, whether the site file sets its noise
Group = tuple[int, int]  # track, and radar or 0 for reports
ALL = "GPS"  # the source that all aircraft together are


@dataclass(frozen=True, slots=True)
class Finding:
    """A source that is inconsistent with its settings: what is said of it, and under which heading it is said once."""

    topic: str
    text: str


@dataclass(frozen=True, slots=True)
class Told:
    """What a second's measurements tell of one noise: the sums of `evidence`, and what is stated of it."""

    measure: Measure
    part: Part
    sigma: float
    added: Floats  # (9,)


@dataclass(frozen=True, slots=True)
class Consistency:
    """What is known of each source and part, the least lately heard first; and the measurements of the last second."""

    sums: Mapping[Key, Sums] = field(default_factory=dict)
    waiting: tuple[tuple[int, Event], ...] = ()
    heard: Mapping[str, int] = field(default_factory=dict)  # when each source was last
    recent: Mapping[Group, tuple[Event, ...]] = field(default_factory=dict)

    def hearing(self, events: Iterable[tuple[int, Event]]) -> Consistency:
        """The same with new measurements waiting to be judged, each with its track."""
        return Consistency(self.sums, (*self.waiting, *events), self.heard, self.recent)

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
        groups, recent = self._grouped(at)
        told: dict[Key, Told] = {}
        for plots in (False, True):
            chosen = [group for key, group in groups.items() if (key[1] != 0) == plots]
            if chosen:
                told |= _told(chosen, position, radars)
        sums, heard = dict(self.sums), dict(self.heard)
        for key, one in told.items():
            sums[key] = sums.pop(key, Sums()).plus(one.added.tolist())
            heard[key[0]] = one.measure.at
        sure = SURE + math.log(max(len(sums), 1))
        for key, one in _together(told, sums, sure).items():
            sums[key] = sums.pop(key, Sums()).plus(one.added.tolist())
            told[key], heard[key[0]] = one, one.measure.at
        found = _findings(told, sums, sure)
        _forget(sums, heard, at)
        return Consistency(sums, heard=heard, recent=recent), found

    def _grouped(self, at: int) -> tuple[dict[Group, tuple[list[Event], int]], dict[Group, tuple[Event, ...]]]:
        """What waited, in order behind what was kept of the same track and source (how many); and what is kept of it now.

        What comes too late to be in order tells nothing.
        """
        arrived: dict[Group, list[Event]] = {}
        for track, event in sorted(self.waiting, key=lambda one: one[1].measure.serial):
            source = event.measure.radar if isinstance(event.measure, Plot) else 0
            arrived.setdefault((track, source), []).append(event)
        recent = {key: kept for key, kept in self.recent.items() if kept[-1].at > at - KEPT_NS}
        groups = {}
        for key, events in arrived.items():
            known = recent.pop(key, ())
            row = list(known)
            for event in sorted(events, key=lambda one: one.at):
                if not row or event.at > row[-1].at:
                    row.append(event)
            if len(row) > len(known):
                groups[key] = row, len(known)
            recent[key] = tuple(row[-(KEPT_PLOTS if key[1] else KEPT_REPORTS) :])
        return groups, recent


def _told(
    groups: Sequence[tuple[list[Event], int]],
    position: PositionSource,
    radars: Mapping[int, RadarSite],
) -> dict[Key, Told]:
    """What the new measurements of some groups of one kind, reports or plots, tell."""
    rows, events = rows_of(groups), [event for group, _ in groups for event in group]
    is_plot = isinstance(events[0].measure, Plot)
    speed_mps = np.sqrt(np.square([event.mean[VELOCITY] for event in events]).sum(axis=1)) if is_plot else np.empty(0)
    left = left_of_plots(rows, speed_mps) if is_plot else left_of_reports(rows)
    fresh = np.flatnonzero(rows.new)
    left, new = left.of(fresh), [events[row] for row in fresh.tolist()]
    stated = np.array([_stated(event.measure) for event in new])
    said = [_said(event.measure, position, radars) for event in new]
    sources = [_source(event.measure) for event in new]
    found: dict[Key, Told] = {}
    for number, part in enumerate(PLOT if is_plot else REPORT):
        amounts = evidence(left, new, stated[:, number], part)
        keys = [
            (source, part.name, math.isclose(sigma, one[number], rel_tol=1e-9))
            for source, sigma, one in zip(sources, stated[:, number].tolist(), said, strict=True)
        ]
        places = {key: place for place, key in enumerate(dict.fromkeys(keys))}
        added = np.zeros((len(places), amounts.shape[1]))
        np.add.at(added, [places[key] for key in keys], amounts)
        last = {key: row for row, key in enumerate(keys)}
        for key, place in places.items():
            row = last[key]
            found[key] = Told(new[row].measure, part, float(stated[row, number]), added[place])
    return found


def _together(told: Mapping[Key, Told], sums: Mapping[Key, Sums], sure: float) -> dict[Key, Told]:
    """All aircraft whose noise the site file states as one source, but for those that already are known to be off."""
    found = {}
    for part in REPORT:
        chosen = [key for key, one in told.items() if key[2] and one.part is part]
        if len(chosen) >= TOGETHER_AT_LEAST:
            added = [told[key].added for key in chosen if sums[key].factor(sure) is None]
            first = told[chosen[0]]
            whole = np.sum(added, axis=0) if added else np.zeros_like(first.added)
            found[ALL, part.name, True] = Told(first.measure, part, first.sigma, whole)
    return found


def _findings(told: Mapping[Key, Told], sums: Mapping[Key, Sums], sure: float) -> list[Finding]:
    """What is sure of sources that were just heard; of single aircraft only what is not so of all."""
    found = {}
    for key, one in told.items():
        factor = sums[key].factor(sure, TOGETHER_ENOUGH if key[0] == ALL else ENOUGH)
        least = 0.0 if isinstance(one.measure, Plot) else LASTING
        if factor is not None and (factor > 1.0 or (key[2] and factor > least)):
            found[key] = _finding(key, one, factor)
    for part in REPORT:
        if (ALL, part.name, True) in found:
            found = {key: one for key, one in found.items() if key[1:] != (part.name, True) or key[0] == ALL}
    return list({key[:2]: one for key, one in found.items()}.values())


def _forget(sums: dict[Key, Sums], heard: dict[str, int], at: int) -> None:
    while len(sums) > SOURCES_AT_MOST:
        oldest = next(iter(sums))
        del sums[oldest]
        heard.pop(oldest[0], None)
    gone = {source for source, last in heard.items() if last < at - FORGOTTEN_NS}
    if gone:
        for key in [key for key in sums if key[0] in gone]:
            del sums[key]
        for source in gone:
            del heard[source]


def _source(measure: Measure) -> str:
    return f"GPS of {measure.aircraft}" if isinstance(measure, Fix) else f"radar {measure.radar}"


def _stated(measure: Measure) -> tuple[float, ...]:
    """The stated sigma of each part."""
    return measure.sigma if isinstance(measure, Plot) else (float(measure.sigma_m[0]), measure.velocity_sigma_mps)


def _said(measure: Measure, position: PositionSource, radars: Mapping[int, RadarSite]) -> tuple[float, ...]:
    """The sigma of each part that the site file sets, NaN = none."""
    if isinstance(measure, Fix):
        return position.sigma_m, position.velocity_sigma_mps
    radar = radars.get(measure.radar)
    if radar is None:
        return math.nan, math.nan, math.nan
    return radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad


def _finding(key: Key, told: Told, factor: float) -> Finding:
    source, name, is_set = key
    part, stated = told.part, told.sigma / told.part.per_unit
    topic = f"scatter of {name}, {source}"
    text = f"{source}: its {name} scatters {factor:.2g} times as much as "
    if source == ALL:
        text = f"{source}: the {name} of the aircraft here scatters {factor:.2g} times as much as "
    if not is_set:
        return Finding(
            topic, f"{text}its stream says ({stated:.3g} {part.unit}): tracks are less sure than they are told to be"
        )
    measure = told.measure
    table = f"the [[radar]] number {measure.radar}" if isinstance(measure, Plot) else "[position]"
    text += f"the stated {stated:.3g} {part.unit}: set {part.key} = {stated * factor:.2g} in {table} of the site file"
    return Finding(topic, text)
