"""Checks: when each report is compared, and what late data make to be compared and counted again."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.associate.combining import MultiRadar
from gateway.associate.gates import SILENT_S, Comparison, Nearby, Setting, compare, compare_again
from gateway.associate.joining import Together
from gateway.associate.ledger import FAST_CHECKS_S, Change, Ledger, Spans, count
from gateway.track import Key, RadarTracks, name_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FORGOTTEN_S = 60.0  # twice the time after which an aircraft's track ends, and after which it is nobody's rival


@dataclass(frozen=True, slots=True)
class Associated:
    """The gates that were checked in this step (k rows), the pairs that are one now, and what changed."""

    check_time: Ints  # (k,) ns, the validity of the GPS report
    check_aircraft: tuple[str, ...]
    check_radar_track: tuple[str, ...]
    check_difference: Floats  # (k, 3) radar minus GPS: range m, azimuth rad, elevation rad; NaN = not compared
    check_gate: Floats  # (k, 3)
    check_counter: Ints  # (k,) after the check
    pairs: tuple[tuple[str, str], ...]  # (aircraft, radar track)
    changes: tuple[Change, ...]
    radars: MultiRadar = field(default_factory=MultiRadar)  # what several radars alone have of aircraft


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """A report's comparisons, the ledger before it, and what it changed."""

    fix: Fix
    comparisons: tuple[Comparison, ...]
    alive: frozenset[Key]
    before: Ledger
    after: Ledger
    changes: tuple[Change, ...]

    @property
    def order(self) -> tuple[int, str]:
        """Checks are folded in order of validity."""
        return self.fix.at, self.fix.aircraft


Compared = tuple[Fix, tuple[Comparison, ...], frozenset[Key]]  # a report, its comparisons, the tracks with plots then


@dataclass(frozen=True, slots=True)
class Association:
    """The stage's state: recent checks in order, the ledger after them, and the reports that still wait for plots."""

    ledger: Ledger = Ledger()
    checks: tuple[Check, ...] = ()
    waiting: tuple[Fix, ...] = ()  # in order of validity
    chosen: Mapping[str, tuple[Fix, ...]] = field(default_factory=dict)  # each aircraft's reports of both, in order
    together: Together = Together()  # radar tracks of several radars

    @property
    def due(self) -> Fix | None:
        """The next report to be checked."""
        return self.waiting[0] if self.waiting else None

    def gap_s(self, fix: Fix) -> float:
        """How long before a report the last one before it of the same aircraft was checked; only a short gap matters."""
        before = [other.at for other in self.chosen.get(fix.aircraft, ()) if other.at < fix.at]
        return (fix.at - before[-1]) / SECOND if before else math.inf


def await_plots(state: Association, fix: Fix) -> Association:
    """The same with a report waiting to be checked; the earliest of each second of each aircraft is."""
    known = state.chosen.get(fix.aircraft, ())
    second = fix.at // SECOND
    rival = next((other for other in reversed(known) if other.at // SECOND == second), None)
    if not fix.comparable or (rival is not None and (rival.at, rival.serial) <= (fix.at, fix.serial)):
        return state
    waiting = state.waiting if rival is None else tuple(other for other in state.waiting if other is not rival)
    place = bisect_right(waiting, (fix.at, fix.aircraft), key=_validity)
    others = [other for other in known if other is not rival]
    insort(others, fix, key=_validity)
    return Association(
        state.ledger,
        state.checks,
        (*waiting[:place], fix, *waiting[place:]),
        {**state.chosen, fix.aircraft: tuple(others)},
        state.together,
    )


def _validity(fix: Fix) -> tuple[int, str]:
    return fix.at, fix.aircraft


def check_due(state: Association, until: int, near: Nearby, setting: Setting) -> tuple[Association, list[Check]]:
    """The same with the waiting reports up to an instant checked, up to the first that makes, ends or moves a pair.

    And the checks that were made. A report goes wherever among the checks its validity belongs.
    """
    made: list[Check] = []
    spans = state.ledger.spans
    before, behind, ledger, done = state.checks, list[Check](), state.ledger, 0
    for fix in state.waiting:
        if fix.at > until or ledger.spans != spans:
            break
        done += 1
        compared = (fix, *compare(fix, near, setting))
        last = behind[-1] if behind else before[-1] if before else None
        if last is None or last.order < (fix.at, fix.aircraft):
            ledger = _fold(behind, ledger, [compared], state, setting)
            made.append(behind[-1])
            continue
        checks = (*before, *behind)
        place, tail = _among(checks, compared)
        before, behind = checks[:place], []
        ledger = _fold(behind, checks[place].before if place < len(checks) else ledger, tail, state, setting)
        made += [check for check in behind if check.fix is fix]
    checks = (*before, *behind)
    return Association(ledger, checks, state.waiting[done:], state.chosen, state.together), made


def _among(checks: Sequence[Check], compared: Compared) -> tuple[int, list[Compared]]:
    """From which check on a late report changes them, and what is to be counted from there."""
    fix, second = compared[0], compared[0].at // SECOND
    place = bisect_left(checks, (fix.at, fix.aircraft), key=lambda check: check.order)
    same = [i for i, c in enumerate(checks) if c.fix.aircraft == fix.aircraft and c.fix.at // SECOND == second]
    start = min([place, *same])  # a report of the same second was checked already: begin where either stands
    tail = [(c.fix, c.comparisons, c.alive) for i, c in enumerate(checks[start:], start) if i not in same]
    tail.insert(sum(i not in same for i in range(start, place)), compared)
    return start, tail


def check_again(state: Association, plot: Plot, key: Key, tracks: RadarTracks, setting: Setting) -> Association:
    """The same after a plot of a radar track that came when checks it touches were done already."""
    wait = int(setting.options.association_wait_s * SECOND)
    if not state.checks or state.checks[-1].fix.at < plot.at - wait:
        return state
    first = bisect_left(state.checks, (plot.at - wait, ""), key=lambda check: check.order)
    last = bisect_right(state.checks, (plot.at + int(SILENT_S * SECOND), "\uffff"), key=lambda check: check.order)
    renewed: dict[int, Compared] = {}
    for place in range(first, last):
        check = state.checks[place]
        compared = compare_again(check.fix, key, check.comparisons, check.alive, tracks, setting)
        if compared is not None:
            renewed[place] = (check.fix, *compared)
    if not renewed:
        return state
    start = min(renewed)
    later = range(start, len(state.checks))
    tail = [renewed.get(i, (state.checks[i].fix, state.checks[i].comparisons, state.checks[i].alive)) for i in later]
    checks = list(state.checks[:start])
    ledger = _fold(checks, state.checks[start].before, tail, state, setting)
    return replace(state, checks=tuple(checks), ledger=ledger)


def pruned(state: Association, before: int) -> Association:
    """The same without checks older than an instant and spans that ended before it (the latest of each track stays).

    Aircraft that were last counted long before it, and have no radar track, are forgotten with their counters.
    """
    checks = tuple(check for check in state.checks if check.fix.at >= before)
    if len(checks) == len(state.checks) and not (state.chosen or state.ledger.counts):
        return state
    spans = state.ledger.spans
    latest = {span.key: span.index for span in spans}
    kept = Spans(s for s in spans if s.until is None or s.until >= before or s.index == latest[s.key])
    ledger = _without_gone(replace(state.ledger, spans=kept if len(kept) < len(spans) else spans), before)
    since = before - int(FAST_CHECKS_S * SECOND)
    chosen = {aircraft: tuple(fix for fix in fixes if fix.at >= since) for aircraft, fixes in state.chosen.items()}
    chosen = {aircraft: fixes for aircraft, fixes in chosen.items() if fixes}
    return Association(ledger, checks, state.waiting, chosen, state.together)


def _without_gone(ledger: Ledger, before: int) -> Ledger:
    """The ledger without the counters of aircraft that nobody can remember."""
    since = before - int(FORGOTTEN_S * SECOND)
    kept = {
        aircraft: counts
        for aircraft, counts in ledger.counts.items()
        if aircraft in ledger.spans.by_aircraft or any(one.at >= since for one in counts.values())
    }
    return ledger if len(kept) == len(ledger.counts) else replace(ledger, counts=kept)


def missing(state: Association, tracks: RadarTracks) -> frozenset[Key]:
    """The radar tracks that the ledger knows and that have no plots any more."""
    ledger = state.ledger
    known = {*ledger.spans.by_key, *(key for counts in ledger.counts.values() for key in counts)}
    return frozenset(known - tracks.plots.keys())


def forgotten(state: Association, gone: frozenset[Key]) -> Association:
    """The same without radar tracks that are no more: their pairs, spans and counters are dropped."""
    if not gone:
        return state
    ledger = state.ledger
    counts = {
        aircraft: {key: count for key, count in counts.items() if key not in gone}
        for aircraft, counts in ledger.counts.items()
    }
    counts = {aircraft: left for aircraft, left in counts.items() if left}
    return replace(state, ledger=Ledger(counts, Spans(span for span in ledger.spans if span.key not in gone)))


def _fold(
    checks: list[Check], ledger: Ledger, compared: Sequence[Compared], state: Association, setting: Setting
) -> Ledger:
    """The ledger after some more checks, in order of validity, which are put behind those before them."""
    for fix, comparisons, alive in compared:
        after, changes = count(ledger, fix, comparisons, alive, state.gap_s(fix), setting)
        checks.append(Check(fix, comparisons, alive, ledger, after, changes))
        ledger = after
    return ledger


def table(
    checks: Sequence[Check], ledger: Ledger, changes: Sequence[Change], radars: Sequence[MultiRadar] = ()
) -> Associated:
    """Some checks as columns, with the pairs of a ledger."""
    rows = [(check, comparison) for check in checks for comparison in check.comparisons]
    counters = [check.after.value(check.fix.aircraft, comparison.key) for check, comparison in rows]
    return Associated(
        check_time=np.array([check.fix.at for check, _ in rows], dtype=np.int64),
        check_aircraft=tuple(check.fix.aircraft for check, _ in rows),
        check_radar_track=tuple(name_of(comparison.key) for _, comparison in rows),
        check_difference=np.array([comparison.difference for _, comparison in rows]).reshape(-1, 3),
        check_gate=np.array([comparison.gate for _, comparison in rows]).reshape(-1, 3),
        check_counter=np.array(counters, dtype=np.int64),
        pairs=ledger.spans.named_pairs,
        changes=tuple(changes),
        radars=MultiRadar.of(radars),
    )
