"""What has become of a track's past: the states that nothing can change any more, for those who look back over whole tracks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

from gateway.fuse.events import Event
from gateway.fuse.lanes import Lane, Lanes


@dataclass(frozen=True, slots=True)
class Settled:
    """Some of a track's states, in order, now that they have left the history. A track's follow each other without a gap.

    `over`: they are the last before the track ends, or before its filter forgets everything, or before the number goes on
    with another filter. A track that comes back to its last state tells that state again. A track goes by the number that
    people knew it by.
    """

    track: int
    events: tuple[Event, ...]
    over: bool


def settled(before: Lanes, after: Lanes) -> list[Settled]:
    """What has left the lanes between two of their states, when nothing else has happened to them."""
    left = []
    for track, lane in before.lanes.items():
        kept = after.lanes.get(track)
        gone = len(lane.events) - (0 if kept is None else len(kept.events))
        if gone:
            is_over = kept is None or not kept.events
            left += _by_number(lane, gone, is_over) if lane.taken else [Settled(track, lane.events[:gone], is_over)]
    return left


def _by_number(lane: Lane, gone: int, is_over: bool) -> list[Settled]:
    """The first of a lane's events, under the numbers that people knew it by then."""
    left: list[Settled] = []
    numbers = [lane.number_at(event.at) for event in lane.events[: gone + 1]]
    for number, members in groupby(range(gone), key=lambda place: numbers[place]):
        places = list(members)
        events = lane.events[places[0] : places[-1] + 1]
        ends = numbers[places[-1] + 1] != number if places[-1] + 1 < len(numbers) else is_over
        left.append(Settled(number, events, ends))
    return left


def remaining(lanes: Lanes) -> list[Settled]:
    """What the lanes still hold at the end of a session."""
    return settled(lanes, Lanes())
