"""Whether sources scatter as much as the settings say: a running test of each source's noise, part by part.

What is looked at is what `scatter` leaves over of a measurement beside its neighbours; `evidence` sums up what that tells.
Something is said at a level that grows with the number of noises watched, so that among thousands none is suspected by
chance. Aircraft whose noise the site file states are also judged together: that is sooner sure.

What a stream says of its own accuracy is never found too careful: a receiver's error that lasts is part of it. For the same
reason nothing is said of a receiver whose reports hardly scatter.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.fuse.displacement import Displacements
from gateway.fuse.events import Event
from gateway.fuse.evidence import ENOUGH, REPORT, Finding, factors, summed
from gateway.fuse.mismatch import mismatches
from gateway.fuse.scatter import Rows, rows_of
from gateway.fuse.telling import OF, Key, Told, told_by
from gateway.settings import PositionSource, RadarSite

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SURE = 12.0  # evidence that is sure of a single noise; of many, the logarithm of their number more
# Evidence against a velocity (a leg is 2.5 at most) from which on what its aircraft scatters by is not judged, and forgotten.
SUSPECT, WRONG = 1.0, 4.0
LASTING = 0.3  # a receiver whose reports scatter by less than this share of what is stated has errors that last
TOGETHER_AT_LEAST, TOGETHER_ENOUGH = 3, 4.0 * ENOUGH  # aircraft, and squares of theirs, which are many soon
MANY, WAIT_NS = 64, 5 * SECOND  # measurements that are judged at once, or all that came in so long
SHARE, TRACKS_AT_LEAST = 200, 8  # of more measurements, of so many tracks or more each, each share has its own instant
AFTER_NS, SLOTS, SLOT_NS = SECOND // 32, 14, SECOND // 16  # when shares have theirs: never when others have their turns
NOTHING_DUE = 1 << 62
KEPT_PLOTS, KEPT_REPORTS = 6, 3  # of each track and source, to hold the next ones against
KEPT_NS = 30 * SECOND
NOISES_AT_MOST = 8192  # the least lately heard are forgotten
FORGOTTEN_NS = 3600 * SECOND  # and those that were not heard for so long

Share = tuple[tuple[int, Event], ...]  # measurements, each with its track
ALL = "GPS"  # the source that all aircraft together are


@dataclass(frozen=True, slots=True, eq=False)
class Consistency:
    """What is known of each noise; the measurements of the last second; and what the next ones are held against."""

    noises: Mapping[Key, int] = field(default_factory=dict)  # the row of each in what follows
    sums: Floats = field(default_factory=lambda: np.zeros((0, 9)))  # as `summed` has them
    heard: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))  # when each source was last
    waiting: Share = ()
    planned: tuple[tuple[int, Share], ...] = ()  # when which measurements are judged
    reports: Rows | None = None
    plots: Rows | None = None
    displacements: Displacements = Displacements()
    contradicted: frozenset[str] = frozenset()  # aircraft whose velocities are surely not those of their positions

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

    @property
    def due(self) -> int:
        """When the next measurements are judged."""
        return self.planned[0][0] if self.planned else NOTHING_DUE

    def planning(self, at: int) -> Consistency:
        """Once a second, the same with what waits to be judged: a share soon after this instant, the others within a second.

        A few measurements wait for others: many cost hardly more. Sources that were not heard for long are forgotten.
        """
        if len(self.waiting) < MANY and at // SECOND * SECOND % WAIT_NS:
            return self
        shares = _shares(self.waiting)
        slots = (at + AFTER_NS + place * SLOTS // len(shares) * SLOT_NS for place in range(len(shares)))
        reports, plots = (
            None if rows is None else rows.in_order().latest(count, at - KEPT_NS)
            for rows, count in ((self.reports, KEPT_REPORTS), (self.plots, KEPT_PLOTS))
        )
        return replace(
            self,
            waiting=(),
            planned=(*self.planned, *zip(slots, shares, strict=True)),
            reports=reports if reports is not None and len(reports.at) else None,
            plots=plots if plots is not None and len(plots.at) else None,
        )._remembered(at)

    def judged(
        self, position: PositionSource, radars: Mapping[int, RadarSite], at: int
    ) -> tuple[Consistency, list[Finding]]:
        """The same with what is due by an instant worked in, and what is sure by now of the sources just judged."""
        after, found = self, list[Finding]()
        while after.due <= at:
            (_, share), planned = after.planned[0], after.planned[1:]
            after, new = replace(after, planned=planned)._with(share, position, radars, at)
            found += new
        return after, found

    def again(self) -> Consistency:
        """The same where time was set back: what is known of noises stays, and no measurement is held against later ones."""
        return Consistency(self.noises, self.sums, self.heard, contradicted=self.contradicted)

    def _with(
        self, share: Share, position: PositionSource, radars: Mapping[int, RadarSite], at: int
    ) -> tuple[Consistency, list[Finding]]:
        """The same with some measurements worked in, and what is sure by now of their sources."""
        by_serial = sorted(share, key=lambda one: one[1].measure.serial)
        told, kept, found, after = list[Told](), list[Rows | None](), list[Finding](), self
        for known, count, is_plot in ((self.reports, KEPT_REPORTS, False), (self.plots, KEPT_PLOTS, True)):
            new = [one for one in by_serial if isinstance(one[1].measure, Plot) == is_plot]
            if new:
                fresh = rows_of(new)
                mine, others = (None, None) if known is None else known.parted(fresh.group)
                rows, events = fresh.merged(mine), [event for _, event in new]
                told += told_by(rows, events, position, radars)
                if not is_plot:
                    after, found = self._displaced(rows, events, told)
                latest = rows.latest(count, at - KEPT_NS)
                known = latest if others is None else latest.after(others)
            kept.append(known)
        after = replace(after, reports=kept[0], plots=kept[1])
        after, scattered = after._summed(told, at) if told else (after, [])
        return after._remembered(at), [*found, *scattered]

    def _displaced(
        self, rows: Rows, events: Sequence[Event], told: Sequence[Told]
    ) -> tuple[Consistency, list[Finding]]:
        """The same with new reports' displacements, and velocities that are surely wrong.

        What their positions scatter by is not known while velocities are suspected: evidence of it begins anew.
        """
        new = np.flatnonzero(rows.new)
        if not len(new):
            return self, []
        group, place = np.unique(rows.group[new], return_index=True)
        by_group = {
            one: events[row].measure for one, row in zip(group.tolist(), rows.event[new[place]].tolist(), strict=True)
        }
        rows = rows.of(np.isin(rows.group, group))
        aircraft = [measure.aircraft for measure in by_group.values() if isinstance(measure, Fix)]
        known = self.displacements.after(rows, aircraft)
        suspected = mismatches(known, SUSPECT)
        if not suspected:
            return replace(self, displacements=known, contradicted=frozenset()), []
        for names, level in ((suspected, 0.0), (mismatches(known, WRONG), -math.inf)):
            for one in told:
                one.evidence[[key[0].removeprefix(OF) in names for key in one.keys], ::3] = level
        wrong = mismatches(known, SURE + math.log(2.0 * len(known.aircraft)))
        after = replace(self, displacements=known, contradicted=frozenset(wrong))
        return after, [finding for findings in wrong.values() for finding in findings]

    def _summed(self, told: Sequence[Told], at: int) -> tuple[Consistency, list[Finding]]:
        """The same with evidence added to the sums, and what is sure by now."""
        everybody = [(ALL, one.part.name, True) for one in told if one.part in REPORT]
        every = (*(key for one in told for key in one.keys), *everybody)
        new = dict.fromkeys(key for key in every if key not in self.noises)
        noises = {**self.noises, **{key: len(self.noises) + row for row, key in enumerate(new)}} if new else self.noises
        sums = np.concatenate([self.sums, np.zeros((len(new), 9))])
        heard = np.concatenate([self.heard, np.full(len(new), at)])
        heard[[noises[key] for key in every]] = at
        after = replace(self, noises=noises, sums=sums, heard=heard)
        found: dict[tuple[str, str], Finding] = {}
        for one in told:
            rows = [noises[key] for key in one.keys]
            sums[rows] = summed(sums[rows], one.evidence)
            factor = factors(sums[rows], after.sure)
            of_all = _together(one, noises, sums, factor, after.sure)
            for place in np.flatnonzero(~np.isnan(factor)).tolist():
                key = one.keys[place]
                if not (key[2] and of_all) and (finding := _finding(one, place, key, float(factor[place]))):
                    found[key[0], key[1]] = finding
            if of_all:
                found[ALL, one.part.name] = of_all
        return after, list(found.values())

    def _remembered(self, at: int) -> Consistency:
        """The same without sources that were not heard for long, or of too many."""
        displacements = self.displacements.remembered(at, at - FORGOTTEN_NS, NOISES_AT_MOST)
        after = self if displacements is self.displacements else replace(self, displacements=displacements)
        keep = self.heard >= at - FORGOTTEN_NS
        if len(keep) > NOISES_AT_MOST:
            keep &= self.heard.argsort(kind="stable").argsort() >= len(keep) - NOISES_AT_MOST
        if keep.all():
            return after
        keys = [key for key, is_kept in zip(self.noises, keep.tolist(), strict=True) if is_kept]
        return replace(
            after, noises={key: row for row, key in enumerate(keys)}, sums=self.sums[keep], heard=self.heard[keep]
        )


def _shares(waiting: Share) -> list[Share]:
    """Measurements in shares of whole tracks, each of reports or of plots; few are one share."""
    if len(waiting) <= SHARE:
        return [waiting] if waiting else []
    found: list[Share] = []
    for is_plot in (False, True):
        by_track: dict[int, list[tuple[int, Event]]] = {}
        for one in waiting:
            if isinstance(one[1].measure, Plot) == is_plot:
                by_track.setdefault(one[0], []).append(one)
        tracks = [by_track[track] for track in sorted(by_track)]
        count = max(1, min(sum(map(len, tracks)) // SHARE, len(tracks) // TRACKS_AT_LEAST))
        cuts = [place * len(tracks) // count for place in range(count + 1)]
        parts = (tracks[first:last] for first, last in itertools.pairwise(cuts))
        found += [tuple(one for track in part for one in track) for part in parts if part]
    return found


def _together(told: Told, noises: Mapping[Key, int], sums: Floats, factor: Floats, sure: float) -> Finding | None:
    """All aircraft whose noise the site file states as one source, but for those that are known to be off: into `sums`."""
    is_set = np.array([key[2] for key in told.keys], dtype=np.bool_)
    row = noises.get((ALL, told.part.name, True))
    if row is None or is_set.sum() < TOGETHER_AT_LEAST:
        return None
    counted = is_set & np.isnan(factor) & np.isfinite(told.evidence[:, 0])
    added = told.evidence[counted].sum(axis=0, keepdims=True)
    sums[row] = summed(sums[row : row + 1], added)[0]
    (found,) = factors(sums[row : row + 1], sure, TOGETHER_ENOUGH).tolist()
    return _finding(told, int(is_set.argmax()), (ALL, told.part.name, True), found)


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
