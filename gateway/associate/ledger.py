"""The ledger: counters of hits and misses, the pairs that are one, and since when (paper 003, eq 8)."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeVar

from gateway.align import SECOND, Fix
from gateway.associate.gates import Comparison, Setting
from gateway.frames import turn
from gateway.track import Key, name_of

FAST_CHECKS_S = 2.0  # checks closer together than this need FAST_HITS of them: their errors are alike
FAST_HITS = 5
RIVAL_AGE_S = 30.0  # an aircraft that was last counted longer ago than this is nobody's rival
RIVAL_RATIO = 1.5  # a pair is taken only if every rival's mean distance is this many times its own


@dataclass(frozen=True, slots=True)
class Change:
    """A pair that became one, or was lost; with the place where it was so, in the runway frame."""

    at: int
    kind: Literal["associated", "lost"]
    aircraft: str
    radar_track: str
    runway_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Count:
    """A pair's counter, the mean distance of its hits, and when it was last counted."""

    value: int
    distance: float
    hits: int
    at: int


@dataclass(frozen=True, slots=True)
class Span:
    """From when until when a radar track is an aircraft; until is None while it lasts."""

    key: Key
    aircraft: str
    since: int
    until: int | None = None
    index: int = 1  # the how manieth of this radar track


class Spans(tuple[Span, ...]):
    """Spans in the order in which they began. Those of one radar track or aircraft are found without looking at all."""

    @cached_property
    def by_key(self) -> Mapping[Key, tuple[Span, ...]]:
        """Those of each radar track, in their order."""
        return _grouped(self, lambda span: span.key)

    @cached_property
    def by_aircraft(self) -> Mapping[str, tuple[Span, ...]]:
        """Those of each aircraft, in their order."""
        return _grouped(self, lambda span: span.aircraft)

    @cached_property
    def pairs(self) -> Mapping[Key, str]:
        """The radar tracks that are an aircraft now."""
        return {span.key: span.aircraft for span in self if span.until is None}

    @cached_property
    def named_pairs(self) -> tuple[tuple[str, str], ...]:
        """The same as (aircraft, radar track), in order of their names."""
        return tuple(sorted((aircraft, name_of(key)) for key, aircraft in self.pairs.items()))


Name = TypeVar("Name", bound=Hashable)


def _grouped(spans: Sequence[Span], name: Callable[[Span], Name]) -> Mapping[Name, tuple[Span, ...]]:
    groups: dict[Name, list[Span]] = {}
    for span in spans:
        groups.setdefault(name(span), []).append(span)
    return {one: tuple(group) for one, group in groups.items()}


Counts = Mapping[Key, Count]


@dataclass(frozen=True, slots=True)
class Ledger:
    """What the checks so far have led to: each aircraft's counters by radar track, and since when pairs are one."""

    counts: Mapping[str, Counts] = field(default_factory=dict)
    spans: Spans = Spans()

    @property
    def pairs(self) -> Mapping[Key, str]:
        """The radar tracks that are an aircraft now."""
        return self.spans.pairs

    def value(self, aircraft: str, key: Key) -> int:
        """A pair's counter, 0 where nothing was counted."""
        known = self.counts.get(aircraft, {}).get(key)
        return 0 if known is None else known.value


def aircraft_of(spans: Spans, key: Key, at: int) -> str | None:
    """Which aircraft a radar track is at an instant, or None."""
    for span in spans.by_key.get(key, ()):
        if span.since <= at and (span.until is None or at < span.until):
            return span.aircraft
    return None


def ordinal_of(spans: Spans, key: Key, at: int) -> int:
    """How many times a radar track had become an aircraft by an instant: 0 before the first."""
    return max((span.index for span in spans.by_key.get(key, ()) if span.since <= at), default=0)


def count(
    ledger: Ledger, fix: Fix, comparisons: Sequence[Comparison], alive: frozenset[Key], gap_s: float, setting: Setting
) -> tuple[Ledger, tuple[Change, ...]]:
    """The ledger after one check: counters up and down, pairs lost and made. Source: 003 2.3 eq 8.

    `gap_s`: how long before it this aircraft's last one was.
    """
    if not alive:
        return ledger, ()
    aircraft = fix.aircraft
    full = setting.options.associate_at if gap_s >= FAST_CHECKS_S else max(setting.options.associate_at, FAST_HITS)
    held = {span.key for span in ledger.spans.by_aircraft.get(aircraft, ()) if span.until is None}
    counts = _counted(ledger.counts.get(aircraft, {}), held, fix.at, comparisons, alive, full)
    lost = {key for key in held & alive if key not in counts or not counts[key].value}
    counts = {key: one for key, one in counts.items() if key not in lost}
    made = _assign(Ledger({**ledger.counts, aircraft: counts}, ledger.spans), fix, held - lost, full, alive, setting)
    # Where a track's number changed, the old one is silent.
    lost |= {key for key in held - lost if any(key[0] == new[0] for new in made)}
    counts = {key: one for key, one in counts.items() if key not in lost}
    others = {**ledger.counts, aircraft: counts}
    if not counts:
        del others[aircraft]
    if not (lost or made):
        return Ledger(others, ledger.spans), ()
    here = tuple(turn(setting.frame.runway_from_enu, fix.enu_m).tolist())
    changes = [Change(fix.at, "lost", aircraft, name_of(key), here) for key in sorted(lost)]
    changes += [Change(fix.at, "associated", aircraft, name_of(key), here) for key in made]
    gone = (replace(s, until=fix.at) if s.until is None and s.key in lost else s for s in ledger.spans)
    begun = (Span(key, aircraft, fix.at, None, _latest_index(ledger.spans, key) + 1) for key in made)
    return Ledger(others, Spans((*gone, *begun))), tuple(changes)


def _counted(
    known: Counts, held: set[Key], at: int, comparisons: Sequence[Comparison], alive: frozenset[Key], full: int
) -> dict[Key, Count]:
    """One aircraft's counters after its comparisons; a track that is alive and too far away to be compared is missed."""
    counts = dict(known)
    near = {comparison.key for comparison in comparisons}
    missed = [(key, False, math.inf) for key in known if key in alive and key not in near]
    for key, hit, distance in (*((one.key, one.hit, one.distance) for one in comparisons), *missed):
        old = counts.get(key, Count(0, 0.0, 0, at))
        if hit:
            hits = min(old.hits + 1, 10)
            counts[key] = Count(min(old.value + 1, full), old.distance + (distance - old.distance) / hits, hits, at)
        elif old.value > 1 or key in held:
            counts[key] = Count(max(old.value - 1, 0), old.distance, old.hits, at)
        else:
            counts.pop(key, None)
    return counts


def _assign(ledger: Ledger, fix: Fix, held: set[Key], full: int, alive: frozenset[Key], setting: Setting) -> list[Key]:
    """The radar tracks, at most one of each radar, that this aircraft now becomes one with.

    One to one, and not first come: a pair waits while a rival for either side is nearly as near. An aircraft keeps a
    radar track that still has plots, those of `held`; one whose track fell silent takes the number that followed.
    """
    taken, mine, pairs = [], ledger.counts[fix.aircraft], ledger.pairs
    since = fix.at - int(RIVAL_AGE_S * SECOND)
    for radar in sorted(setting.radars):
        if any(key[0] == radar and key in alive for key in held):
            continue
        free = [key for key in mine if key[0] == radar and key in alive and key not in pairs]
        ready = [(mine[key].distance, key) for key in free if mine[key].value >= full]
        if not ready:
            continue
        distance, best = min(ready)
        rivals = [mine[key].distance for key in free if key != best]
        out = {owner for key, owner in pairs.items() if key[0] == radar and key in alive} | {fix.aircraft}
        rivals += [
            counts[best].distance
            for owner, counts in ledger.counts.items()
            if best in counts and owner not in out and counts[best].at >= since
        ]
        if all(rival >= RIVAL_RATIO * distance for rival in rivals):
            taken.append(best)
    return taken


def _latest_index(spans: Spans, key: Key) -> int:
    return max((span.index for span in spans.by_key.get(key, ())), default=0)
