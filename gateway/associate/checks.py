"""Checks: when each report is compared, and what late data make to be compared and counted again."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.associate.gates import SILENT_S, Comparison, Setting, compare
from gateway.associate.ledger import Change, Count, Ledger, count
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
    check_hit: NDArray[np.bool_]  # (k,)
    check_counter: Ints  # (k,) after the check
    pairs: tuple[tuple[str, str], ...]  # (aircraft, radar track)
    changes: tuple[Change, ...]


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

    @property
    def due(self) -> Fix | None:
        """The next report to be checked."""
        return self.waiting[0] if self.waiting else None


def await_plots(state: Association, fix: Fix) -> Association:
    """The same with a report waiting to be checked; the earliest of each second of each aircraft is."""
    second = fix.at // SECOND

    def same(other: Fix) -> bool:
        return other.aircraft == fix.aircraft and other.at // SECOND == second

    rival = next((other for other in state.waiting if same(other)), None)
    done = next((check.fix for check in state.checks if same(check.fix)), None)
    earlier = [
        other for other in (rival, done) if other is not None and (other.at, other.serial) <= (fix.at, fix.serial)
    ]
    if earlier or not fix.comparable:
        return state
    waiting = [other for other in state.waiting if other is not rival]
    place = bisect_right(waiting, (fix.at, fix.aircraft), key=lambda other: (other.at, other.aircraft))
    return replace(state, waiting=(*waiting[:place], fix, *waiting[place:]))


def check_due(state: Association, tracks: RadarTracks, setting: Setting) -> Association:
    """The same with the first waiting report checked, wherever among the checks its validity belongs."""
    fix, rest = state.waiting[0], state.waiting[1:]
    second = fix.at // SECOND
    kept = tuple(c for c in state.checks if not (c.fix.aircraft == fix.aircraft and c.fix.at // SECOND == second))
    place = bisect_left(kept, (fix.at, fix.aircraft), key=lambda check: check.order)
    if len(kept) < len(state.checks):  # a report of the same second was checked already: begin where either stands
        place = min(
            place, next(i for i, (a, b) in enumerate(zip((*kept, None), state.checks, strict=False)) if a is not b)
        )
    before = state.checks[place].before if place < len(state.checks) else state.ledger
    tail: list[Compared] = [(check.fix, check.comparisons, check.alive) for check in kept[place:]]
    own = bisect_left(kept, (fix.at, fix.aircraft), key=lambda check: check.order) - place
    tail.insert(own, (fix, *compare(fix, tracks, setting)))
    return _fold(replace(state, waiting=rest, checks=kept[:place], ledger=before), tail, setting)


def check_again(state: Association, plot: Plot, tracks: RadarTracks, setting: Setting) -> Association:
    """The same after a plot that came when checks it touches were done already."""
    wait = int(setting.options.association_wait_s * SECOND)
    first = bisect_left(state.checks, (plot.at - wait, ""), key=lambda check: check.order)
    last = bisect_right(state.checks, (plot.at + int(SILENT_S * SECOND), "\uffff"), key=lambda check: check.order)
    renewed: dict[int, Compared] = {}
    for place in range(first, last):
        check = state.checks[place]
        comparisons, alive = compare(check.fix, tracks, setting)
        same = len(comparisons) == len(check.comparisons) and alive == check.alive
        if not same or any(new.differs(old) for new, old in zip(comparisons, check.comparisons, strict=True)):
            renewed[place] = (check.fix, comparisons, alive)
    if not renewed:
        return state
    start = min(renewed)
    later = range(start, len(state.checks))
    tail = [renewed.get(i, (state.checks[i].fix, state.checks[i].comparisons, state.checks[i].alive)) for i in later]
    return _fold(replace(state, checks=state.checks[:start], ledger=state.checks[start].before), tail, setting)


def pruned(state: Association, before: int) -> Association:
    """The same without checks older than an instant and spans that ended before it (the latest of each track stays).

    Aircraft that were last checked long before it, and have no radar track, are forgotten with their counters.
    """
    checks = tuple(check for check in state.checks if check.fix.at >= before)
    if len(checks) == len(state.checks):
        return state
    spans = state.ledger.spans
    latest = {span.key: span.index for span in spans}
    kept = tuple(s for s in spans if s.until is None or s.until >= before or s.index == latest[s.key])
    return replace(state, checks=checks, ledger=_without_gone(replace(state.ledger, spans=kept), before))


def _without_gone(ledger: Ledger, before: int) -> Ledger:
    """The ledger without aircraft that nobody can remember: else each address that ever flew by would stay."""
    longest = int(FORGOTTEN_S * SECOND)
    gone = {aircraft for aircraft, at in ledger.checked_at.items() if at < before - longest}
    gone -= {*ledger.pairs.values(), *(span.aircraft for span in ledger.spans)}
    if not gone:
        return ledger
    checked_at = {aircraft: at for aircraft, at in ledger.checked_at.items() if aircraft not in gone}
    counts = {pair: count for pair, count in ledger.counts.items() if pair[0] not in gone}
    return replace(ledger, checked_at=checked_at, counts=counts)


def missing(state: Association, tracks: RadarTracks) -> frozenset[Key]:
    """The radar tracks that the ledger knows and that have no plots any more."""
    ledger = state.ledger
    known = {*ledger.pairs, *(key for _, key in ledger.counts), *(span.key for span in ledger.spans)}
    return frozenset(known - tracks.plots.keys())


def forgotten(state: Association, gone: frozenset[Key]) -> Association:
    """The same without radar tracks that are no more: their pairs, spans and counters are dropped."""
    if not gone:
        return state
    ledger = state.ledger
    counts = {pair: count for pair, count in ledger.counts.items() if pair[1] not in gone}
    spans = tuple(span for span in ledger.spans if span.key not in gone)
    pairs = {key: aircraft for key, aircraft in ledger.pairs.items() if key not in gone}
    return replace(state, ledger=replace(ledger, counts=counts, pairs=pairs, spans=spans))


def _fold(state: Association, compared: Sequence[Compared], setting: Setting) -> Association:
    """The state after some more checks, in order of validity."""
    checks, ledger = list(state.checks), state.ledger
    for fix, comparisons, alive in compared:
        after, changes = count(ledger, fix, comparisons, alive, setting)
        checks.append(Check(fix, comparisons, alive, ledger, after, changes))
        ledger = after
    return replace(state, checks=tuple(checks), ledger=ledger)


def table(checks: Sequence[Check], ledger: Ledger, changes: Sequence[Change]) -> Associated:
    """Some checks as columns, with the pairs of a ledger."""
    rows = [(check, comparison) for check in checks for comparison in check.comparisons]
    counters = [check.after.counts.get((check.fix.aircraft, c.key), Count(0, 0.0, 0)).value for check, c in rows]
    return Associated(
        check_time=np.array([check.fix.at for check, _ in rows], dtype=np.int64),
        check_aircraft=tuple(check.fix.aircraft for check, _ in rows),
        check_radar_track=tuple(name_of(comparison.key) for _, comparison in rows),
        check_difference=np.array([comparison.difference for _, comparison in rows]).reshape(-1, 3),
        check_gate=np.array([comparison.gate for _, comparison in rows]).reshape(-1, 3),
        check_hit=np.array([comparison.hit for _, comparison in rows], dtype=np.bool_),
        check_counter=np.array(counters, dtype=np.int64),
        pairs=tuple(sorted((aircraft, name_of(key)) for key, aircraft in ledger.pairs.items())),
        changes=tuple(changes),
    )
