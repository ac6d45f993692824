"""The ledger: counters of hits and misses, the pairs that are one, and since when (paper 003, eq 8)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from gateway.align import SECOND, Fix
from gateway.associate.gates import NOWHERE, Comparison, Setting
from gateway.frames import turn
from gateway.track import Key, name_of

FAST_CHECKS_S = 2.0  # checks closer together than this need FAST_HITS of them: their errors are alike
FAST_HITS = 5
RIVAL_AGE_S = 30.0  # an aircraft that was last checked longer ago than this is nobody's rival
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


def aircraft_of(spans: Sequence[Span], key: Key, at: int) -> str | None:
    """Which aircraft a radar track is at an instant, or None."""
    for span in spans:
        if span.key == key and span.since <= at and (span.until is None or at < span.until):
            return span.aircraft
    return None


def ordinal_of(spans: Sequence[Span], key: Key, at: int) -> int:
    """How many times a radar track had become an aircraft by an instant: 0 before the first."""
    return max((span.index for span in spans if span.key == key and span.since <= at), default=0)


def count(
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
        elif old.value > 1 or pairs.get(pair[1]) == aircraft:
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
    checked_at = {**ledger.checked_at, aircraft: fix.at}
    forgotten = {owner for owner, at in checked_at.items() if fix.at - at > RIVAL_AGE_S * SECOND}
    for key in _assign(counts, pairs, aircraft, full, alive, forgotten):
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
    return Ledger(counts, pairs, spans, checked_at), tuple(changes)


def _of(counts: Mapping[tuple[str, Key], Count], aircraft: str) -> list[tuple[str, Key]]:
    return [pair for pair in counts if pair[0] == aircraft]


def _assign(
    counts: Mapping[tuple[str, Key], Count],
    pairs: Mapping[Key, str],
    aircraft: str,
    full: int,
    alive: frozenset[Key],
    forgotten: set[str],
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
        out = owned | forgotten | {aircraft}
        rivals += [c.distance for (owner, key), c in counts.items() if key == best and owner not in out]
        if all(rival >= RIVAL_RATIO * distance for rival in rivals):
            taken.append(best)
    return taken


def _latest_index(spans: Sequence[Span], key: Key) -> int:
    return max((span.index for span in spans if span.key == key), default=0)
