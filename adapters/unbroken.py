"""Frames that come without a gap, counted many at once: by far the most of what comes in thick.

Where the sequence numbers of all components of a system run on by one, nothing was lost, doubled or late. All that one by
one would find out then is the last number, and how many frames there were of each message.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adapters.arrivals import Arrivals, Integers, are_first
from adapters.frame_batches import NO_HEAD, Heads
from adapters.listening import Listened
from adapters.vehicles import Component


class _Sent(NamedTuple):
    """What one component sent in a batch: its frames' places, their messages, and whether their numbers run on."""

    source: int
    system: int
    component: Component | None
    places: NDArray[np.intp]
    messages: Heads
    first: int
    runs_on: bool

    def is_unbroken(self, arrivals: Arrivals) -> bool:
        """Whether all of it can be counted at once."""
        component = self.component
        return (
            component is not None
            and self.runs_on
            and component.sequence.goes_on(self.first)
            and arrivals.received_at[self.places[-1]] < component.rates.until
        )


def count_unbroken(
    arrivals: Arrivals, heads: Heads, listened: Mapping[int, Listened]
) -> tuple[list[Component], NDArray[np.int64]]:
    """Count the frames of all systems whose numbers run on: their components, and which of these sent each frame, else -1.

    `heads`: of each arrival. Left alone are whole sources of which anything has no head, and whole systems with a gap, a new
    component, components that share a counter, or rates that are due.
    """
    sent = list(_by_component(arrivals.source, heads, listened))
    broken = set(arrivals.source[heads == NO_HEAD].tolist())
    uneven = {(one.source, one.system) for one in sent if not one.is_unbroken(arrivals)}
    components: list[Component] = []
    senders = np.full(len(arrivals), -1)
    newest: dict[tuple[int, int], tuple[int, Component]] = {}
    for one in sent:
        component, key = one.component, (one.source, one.system)
        if component is None or one.source in broken or key in uneven:
            continue
        messages = one.messages.tolist()
        component.sequence.run_on(one.first, messages)
        component.rates.hear_all(messages)
        heard = listened[one.source]
        heard.counters["frames"] += len(messages)
        heard.known_good.update(messages)
        senders[one.places] = len(components)
        components.append(component)
        last = int(one.places[-1])
        if key not in newest or newest[key][0] < last:
            newest[key] = last, component
    for _, component in newest.values():
        component.sequence.be_newest()
    return components, senders


def _by_component(source: Integers, head: Heads, listened: Mapping[int, Listened]) -> Iterator[_Sent]:
    senders = source << 16 | head >> 8 & 0xFFFF
    order = np.argsort(senders, kind="stable")
    senders, head = senders[order], head[order]
    sequence, messages = head & 255, head >> 24
    is_first = are_first(senders)
    begins = np.flatnonzero(is_first)
    goes_on = is_first.copy()
    goes_on[1:] |= sequence[1:] - sequence[:-1] & 255 == 1
    runs_on = np.logical_and.reduceat(goes_on, begins).tolist()
    bounds = pairwise((*begins.tolist(), len(order)))
    for sender, (begin, end), first, runs in zip(
        senders[begins].tolist(), bounds, sequence[begins].tolist(), runs_on, strict=True
    ):
        number = sender >> 16
        component = listened[number].components.get(sender & 0xFFFF)
        yield _Sent(number, sender & 255, component, order[begin:end], messages[begin:end], first, runs)
