"""Associate: which radar track is which aircraft (paper 003, 2.3).

At most once a second, each aircraft's GPS report is checked against every radar track near it: gates of three sigma in
range, azimuth and elevation about the GPS point, a counter for each pair, associated when the counter is full, lost when
it is empty. A check waits until plots can bracket it and holds from the report's own time; late data repeat the checks
they touch and what followed from these, so that the result is that of in-order processing.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot, Polar, bracket
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, turn
from gateway.settings import Options, Site
from gateway.track import GREATEST_SPEED_MPS, Key, Place, RadarTracks, name_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GATE_SIGMAS = 3.0
FAST_CHECKS_S = 2.0  # checks closer together than this need FAST_HITS of them: their errors are alike
FAST_HITS = 5
SILENT_S = 3.0  # a radar track without plots for this long gives its aircraft free
RIVAL_RATIO = 1.5  # a pair is taken only if every rival's mean distance is this many times its own


NOWHERE: Polar = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Change:
    """A pair that became one, or was lost; with the place where it was so, in the runway frame."""

    at: int
    kind: Literal["associated", "lost"]
    aircraft: str
    radar_track: str
    runway_m: tuple[float, float, float]


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
class Comparison:
    """One aircraft's report against one radar track."""

    key: Key
    hit: bool
    distance: float  # mean square of difference / gate over the compared components
    difference: Polar
    gate: Polar

    def differs(self, other: Comparison) -> bool:
        """Whether anything that the counters see is different."""
        return (self.key, self.hit, self.distance) != (other.key, other.hit, other.distance)


@dataclass(frozen=True, slots=True)
class Count:
    """A pair's counter and the mean distance of its hits."""

    value: int
    distance: float
    hits: int


@dataclass(frozen=True, slots=True)
class Span:
    """From when until when a radar track is an aircraft; until is None while it lasts."""

    key: Key
    aircraft: str
    since: int
    until: int | None = None
    index: int = 1  # the how manieth of this radar track


@dataclass(frozen=True, slots=True)
class Ledger:
    """What the checks so far have led to: counters by pair, the pairs that are one, and since when."""

    counts: Mapping[tuple[str, Key], Count] = field(default_factory=dict)
    pairs: Mapping[Key, str] = field(default_factory=dict)
    spans: tuple[Span, ...] = ()
    checked_at: Mapping[str, int] = field(default_factory=dict)  # when each aircraft was last checked


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


@dataclass(frozen=True, slots=True)
class Setting:
    """What a check needs to know of the place."""

    site: Site
    options: Options
    frame: RunwayFrame
    radars: Mapping[int, RadarFrame]


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
    tail.insert(own, (fix, *_compare(fix, tracks, setting)))
    return _fold(replace(state, waiting=rest, checks=kept[:place], ledger=before), tail, setting)


def check_again(state: Association, plot: Plot, tracks: RadarTracks, setting: Setting) -> Association:
    """The same after a plot that came when checks it touches were done already."""
    wait = int(setting.options.association_wait_s * SECOND)
    first = bisect_left(state.checks, (plot.at - wait, ""), key=lambda check: check.order)
    last = bisect_right(state.checks, (plot.at + int(SILENT_S * SECOND), "\uffff"), key=lambda check: check.order)
    renewed: dict[int, Compared] = {}
    for place in range(first, last):
        check = state.checks[place]
        comparisons, alive = _compare(check.fix, tracks, setting)
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
    """The same without checks older than an instant and spans that ended before it (the latest of each track stays)."""
    checks = tuple(check for check in state.checks if check.fix.at >= before)
    if len(checks) == len(state.checks):
        return state
    spans = state.ledger.spans
    latest = {span.key: span.index for span in spans}
    kept = tuple(s for s in spans if s.until is None or s.until >= before or s.index == latest[s.key])
    return replace(state, checks=checks, ledger=replace(state.ledger, spans=kept))


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


def aircraft_of(spans: Sequence[Span], key: Key, at: int) -> str | None:
    """Which aircraft a radar track is at an instant, or None."""
    for span in spans:
        if span.key == key and span.since <= at and (span.until is None or at < span.until):
            return span.aircraft
    return None


def ordinal_of(spans: Sequence[Span], key: Key, at: int) -> int:
    """How many times a radar track had become an aircraft by an instant: 0 before the first."""
    return max((span.index for span in spans if span.key == key and span.since <= at), default=0)


def _latest_index(spans: Sequence[Span], key: Key) -> int:
    return max((span.index for span in spans if span.key == key), default=0)


def _compare(fix: Fix, tracks: RadarTracks, setting: Setting) -> tuple[tuple[Comparison, ...], frozenset[Key]]:
    """One report against every radar track with plots near its time that is not far away; and which have such plots.

    Source: 003 2.3 eq 6. Deviation: sigma also holds the allowed systematic error of the position source.
    """
    wait = int(setting.options.association_wait_s * SECOND)
    first, last = fix.at - int(SILENT_S * SECOND), fix.at + wait
    alive, found = set(), []
    seen = {number: _seen_from(fix, radar, setting) for number, radar in setting.radars.items()}
    for key, plots in tracks.plots.items():
        if plots[0].at > last or plots[-1].at < first or key[0] not in seen:
            continue
        alive.add(key)
        there, spread = seen[key[0]]
        if not _is_far(fix.at, there, spread, tracks.places[key]):
            value, sigma = bracket(plots, fix.at, setting.options.association_wait_s)
            found.append(_judge(key, value, sigma, there, spread, setting.options.association))
    return tuple(found), frozenset(alive)


def _seen_from(fix: Fix, radar: RadarFrame, setting: Setting) -> tuple[Polar, Polar]:
    """A report's place as a radar would measure it, and its sigma there, systematic error included."""
    distance, azimuth, elevation = polar_from_xyz(radar.from_enu(fix.enu_m)).tolist()
    sigma_m = math.hypot(float(fix.sigma_m[0]), setting.site.position.systematic_m)
    upright_m = math.hypot(float(fix.sigma_m[2]), setting.site.position.systematic_m)
    level = max(distance * math.cos(elevation), 1.0)
    return (distance, azimuth, elevation), (sigma_m, sigma_m / level, upright_m / max(distance, 1.0))


def _is_far(at: int, there: Polar, spread: Polar, place: Place) -> bool:
    """Whether a radar track's latest range and azimuth leave no chance of a hit, so that nothing need be interpolated."""
    moved_m = GREATEST_SPEED_MPS * (abs(at - place.at) / SECOND + 1.0)
    away_m = abs(place.range_m - there[0])
    if away_m > moved_m + 4.0 * (spread[0] + place.range_sigma_m):
        return True
    away = (
        abs(math.remainder(place.azimuth_rad - there[1], 2.0 * math.pi))
        if place.azimuth_rad == place.azimuth_rad
        else 0.0
    )
    return away > moved_m / max(there[0], 300.0) + 4.0 * (spread[1] + place.azimuth_sigma_rad)


def _judge(key: Key, value: Polar, sigma: Polar, there: Polar, spread: Polar, rule: str) -> Comparison:
    """Hit or miss. `literal`: range and (azimuth or elevation); `default`: all that are present, at least two.

    Source: 003 2.3 eq 7. Deviation: `default`, because eq 7 takes an aircraft 3 degrees abeam for the one on final.
    """
    range_, azimuth, elevation = (value[component] - there[component] for component in range(3))
    if not math.isnan(azimuth):
        azimuth = math.remainder(azimuth, 2.0 * math.pi)
    difference = (range_, azimuth, elevation)
    wide, left, up = (GATE_SIGMAS * math.hypot(sigma[component], spread[component]) for component in range(3))
    gate = (wide, left, up)
    ratios = [abs(off) / limit for off, limit in zip(difference, gate, strict=True)]  # NaN where not compared
    compared = [ratio for ratio in ratios if not math.isnan(ratio)]
    if rule == "literal":
        hit = ratios[0] <= 1.0 and (ratios[1] <= 1.0 or ratios[2] <= 1.0)
    else:
        hit = len(compared) >= 2 and max(compared) <= 1.0
    distance = sum(ratio * ratio for ratio in compared) / len(compared) if compared else math.inf
    return Comparison(key, hit, distance, difference, gate)


def _fold(state: Association, compared: Sequence[Compared], setting: Setting) -> Association:
    """The state after some more checks, in order of validity."""
    checks, ledger = list(state.checks), state.ledger
    for fix, comparisons, alive in compared:
        after, changes = _count(ledger, fix, comparisons, alive, setting)
        checks.append(Check(fix, comparisons, alive, ledger, after, changes))
        ledger = after
    return replace(state, checks=tuple(checks), ledger=ledger)


def _count(
    ledger: Ledger, fix: Fix, comparisons: Sequence[Comparison], alive: frozenset[Key], setting: Setting
) -> tuple[Ledger, tuple[Change, ...]]:
    """The ledger after one check: counters up and down, pairs lost and made. Source: 003 2.3 eq 8."""
    counts, pairs, aircraft = dict(ledger.counts), dict(ledger.pairs), fix.aircraft
    gap_s = (fix.at - ledger.checked_at[aircraft]) / SECOND if aircraft in ledger.checked_at else math.inf
    full = setting.options.associate_at if gap_s >= FAST_CHECKS_S else max(setting.options.associate_at, FAST_HITS)
    here = tuple(turn(setting.frame.runway_from_enu, fix.enu_m).tolist())
    near = {comparison.key for comparison in comparisons}
    far = [
        Comparison(key, False, math.inf, NOWHERE, NOWHERE) for _, key in _of(counts, aircraft) if key in alive - near
    ]
    for comparison in (*comparisons, *far):
        pair = (aircraft, comparison.key)
        old = counts.get(pair, Count(0, 0.0, 0))
        if comparison.hit:
            hits = min(old.hits + 1, 10)
            mean = old.distance + (comparison.distance - old.distance) / hits
            counts[pair] = Count(min(old.value + 1, full), mean, hits)
        elif old.value > 1 or pair[1] in pairs:
            counts[pair] = Count(max(old.value - 1, 0), old.distance, old.hits)
        else:
            counts.pop(pair, None)
    changes = []

    def lose(key: Key) -> None:
        changes.append(Change(fix.at, "lost", aircraft, name_of(key), here))
        del pairs[key]
        counts.pop((aircraft, key), None)

    for key in [key for key, owner in pairs.items() if owner == aircraft]:
        if key in alive and counts.get((aircraft, key), Count(0, 0.0, 0)).value == 0:
            lose(key)
    for key in _assign(counts, pairs, aircraft, full, alive):
        for other in [k for k, owner in pairs.items() if owner == aircraft and k[0] == key[0]]:
            lose(other)  # its number changed: the old one is silent
        pairs[key] = aircraft
        changes.append(Change(fix.at, "associated", aircraft, name_of(key), here))
    spans = ledger.spans
    if changes:
        gone = tuple(
            replace(s, until=fix.at) if s.until is None and pairs.get(s.key) != s.aircraft else s for s in spans
        )
        now = {span.key for span in gone if span.until is None}
        begun = [(key, owner) for key, owner in pairs.items() if key not in now]
        spans = (*gone, *(Span(key, owner, fix.at, None, _latest_index(gone, key) + 1) for key, owner in begun))
    return Ledger(counts, pairs, spans, {**ledger.checked_at, aircraft: fix.at}), tuple(changes)


def _of(counts: Mapping[tuple[str, Key], Count], aircraft: str) -> list[tuple[str, Key]]:
    return [pair for pair in counts if pair[0] == aircraft]


def _assign(
    counts: Mapping[tuple[str, Key], Count], pairs: Mapping[Key, str], aircraft: str, full: int, alive: frozenset[Key]
) -> list[Key]:
    """The radar tracks, at most one of each radar, that this aircraft now becomes one with.

    One to one, and not first come: a pair waits while a rival for either side is nearly as near. An aircraft keeps a
    radar track that still has plots; one whose track fell silent takes the number that followed.
    """
    taken = []
    for radar in sorted({key[0] for key in alive}):
        held = [key for key, owner in pairs.items() if owner == aircraft and key[0] == radar and key in alive]
        if held:
            continue
        mine = [
            (counts[aircraft, key].distance, key) for (owner, key) in counts if owner == aircraft and key[0] == radar
        ]
        ready = [
            (d, key) for d, key in mine if key not in pairs and counts[aircraft, key].value >= full and key in alive
        ]
        if not ready:
            continue
        distance, best = min(ready)
        rivals = [d for d, key in mine if key != best and key not in pairs and key in alive]
        owned = {owner for key, owner in pairs.items() if key[0] == radar and key in alive}
        rivals += [
            c.distance for (owner, key), c in counts.items() if key == best and owner != aircraft and owner not in owned
        ]
        if all(rival >= RIVAL_RATIO * distance for rival in rivals):
            taken.append(best)
    return taken


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
