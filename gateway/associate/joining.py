"""Joining: radar tracks of several radars that are one target, with or without a position source (paper 004, figure 1).

Once a second the tracklets of all radars are compared. Each pair has a counter, as a report and a radar track have: up on a hit,
down on a miss, as it is where it is not plain which is meant. Full, the two are one; empty, they are not any more.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from gateway.associate.ledger import FAST_HITS
from gateway.associate.pairing import Pair, Systematic, judged
from gateway.associate.tracklets import Tracklets, tracklets
from gateway.frames import RadarFrame
from gateway.track import Key, RadarTracks


@dataclass(frozen=True, slots=True)
class Together:
    """The stage's state: the counters of pairs of radar tracks, and the pairs that are one."""

    counts: Mapping[Pair, int] = field(default_factory=dict)
    one: frozenset[Pair] = frozenset()
    seen: Tracklets | None = None  # what is to be compared, and was just now, until it is used


def looked(state: Together, at: int, tracks: RadarTracks, radars: Mapping[int, RadarFrame]) -> Together:
    """The state with what is to be compared: where each radar track was a moment before an instant."""
    return replace(
        state, seen=tracklets(tracks if len({key[0] for key in tracks.plots}) > 1 else RadarTracks(), at, radars)
    )


def compared(state: Together, tracks: RadarTracks, systematic: Mapping[int, Systematic]) -> Together:
    """The state after the check of what was looked at; without that the same.

    `systematic`: 1 sigma of what radars may still be off by, of those of which it is known.
    """
    seen = state.seen
    if seen is None:
        return state
    alive = frozenset(seen.keys)
    counts = {
        pair: value for pair, value in state.counts.items() if pair[0] in tracks.plots and pair[1] in tracks.plots
    }
    verdicts = judged(seen, state.one, systematic)
    for pair in counts.keys() - verdicts.keys():
        if pair[0] in alive and pair[1] in alive:
            verdicts[pair] = False
    for pair, hit in verdicts.items():
        if hit is not None:
            counts[pair] = min(counts.get(pair, 0) + 1, FAST_HITS) if hit else max(counts.get(pair, 0) - 1, 0)
    counts = {pair: value for pair, value in counts.items() if value}
    kept = frozenset(pair for pair in state.one if pair in counts)
    return Together(counts, _made(kept, counts, alive), seen)


def _made(one: frozenset[Pair], counts: Mapping[Pair, int], alive: frozenset[Key]) -> frozenset[Pair]:
    """The pairs that are one, with those that now are: of each radar at most one track that still has plots."""
    full = sorted(pair for pair, value in counts.items() if value == FAST_HITS and pair not in one)
    if not full:
        return one
    made = set(one)
    pair_of = {end: pair for pair in sorted(one) for end in _ends(pair)}
    for pair in full:
        former = {pair_of[end] for end in _ends(pair) if end in pair_of}
        if alive.issuperset(pair) and not any(alive.issuperset(old) for old in former):
            made -= former
            made.add(pair)
            pair_of.update(dict.fromkeys(_ends(pair), pair))
    return frozenset(made)


def _ends(pair: Pair) -> tuple[tuple[Key, int], tuple[Key, int]]:
    """Each radar track of a pair, with the other radar."""
    return (pair[0], pair[1][0]), (pair[1], pair[0][0])


def together(keys: Iterable[Key], one: frozenset[Pair]) -> list[list[Key]]:
    """Radar tracks that are one target, directly or by way of others, in groups; those of a single one are left out."""
    wanted = set(keys)
    next_to: dict[Key, list[Key]] = {}
    for pair in sorted(one):
        if wanted.issuperset(pair):
            for key, other in (pair, pair[::-1]):
                next_to.setdefault(key, []).append(other)
    groups, seen = [], set[Key]()
    for key in sorted(next_to):
        if key in seen:
            continue
        group, waiting = [], [key]
        while waiting:
            if (here := waiting.pop()) not in seen:
                seen.add(here)
                group.append(here)
                waiting += next_to[here]
        groups.append(sorted(group))
    return groups
