"""What has become of a track's past: the states that nothing can change any more, for those who look back over whole tracks."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.fuse.events import Event
from gateway.fuse.lanes import Lanes


@dataclass(frozen=True, slots=True)
class Settled:
    """Some of a track's states, in order, now that they have left the history. A track's follow each other without a gap.

    `over`: they are the last before the track ends, or before its filter forgets everything. A track that comes back
    to its last state tells that state again.
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
            left.append(Settled(track, lane.events[:gone], kept is None or not kept.events))
    return left


def remaining(lanes: Lanes) -> list[Settled]:
    """What the lanes still hold at the end of a session."""
    return settled(lanes, Lanes())
