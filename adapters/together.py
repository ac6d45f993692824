"""Many arrivals heard at once: the same as one by one, in less time.

Sequence numbers that run on are counted together (`unbroken`). What no stage reads is gathered (`gathering`), and most of it
is read side by side (`waiting`). All else is heard one by one, in its order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from adapters import Arrival
from adapters.arrivals import Arrivals, Integers, are_first
from adapters.epoch import SessionEpoch
from adapters.frame_batches import Head, Heads, Wanted, heads_of, payload_of, places_of, wanted
from adapters.gathering import PASSING, Gathered, Said
from adapters.listening import Listened
from adapters.mavlink import MavlinkObserver
from adapters.meters import SECOND
from adapters.told import ToldPlans
from adapters.unbroken import count_unbroken
from adapters.vehicles import Component
from adapters.waiting import Waiting
from gateway.observation import Heard

_PASSING = wanted(PASSING)
_State = tuple[int, tuple[int, int], bool]


@dataclass(frozen=True, slots=True)
class Together:
    """What a decoder needs to hear many at once. `hear`: an arrival, and whether it was refused; `hear_counted`: a good frame
    whose number was counted; `say`: what there is to tell a person.
    """

    mavlink: MavlinkObserver
    epoch: SessionEpoch
    plans: ToldPlans
    listened: Mapping[int, Listened]
    which: Wanted
    hear: Callable[[Arrival, Head], tuple[Heard | None, bool]]
    hear_counted: Callable[[Arrival, Component, int], Heard | None]
    say: Callable[[], tuple[tuple[str, str], ...]]

    def hear_all(self, arrivals: Arrivals) -> tuple[Said, list[int]]:
        """What those said that said anything, and which were refused."""
        heads = heads_of(arrivals.data) if arrivals.heads is None else arrivals.heads
        components, senders = count_unbroken(arrivals, heads, self.listened)
        hearing = _Hearing(self, arrivals, heads, components, senders)
        left = np.flatnonzero(places_of(heads, self.which) | (senders < 0))
        seconds = arrivals.received_at[left] // SECOND
        for places in np.split(left, np.flatnonzero(are_first(seconds))[1:]):
            hearing.hear_second(places)
        for number, stamp in arrivals.last_of_each():
            self.listened[number].last_heard = stamp
        return hearing.gathered.said, hearing.refused


class _Hearing:
    """Some arrivals, as they are heard."""

    def __init__(
        self, by: Together, arrivals: Arrivals, heads: Heads, components: list[Component], senders: Integers
    ) -> None:
        self.gathered, self.refused = Gathered(by.epoch, by.listened), list[int]()
        self._by, self._arrivals, self._heads = by, arrivals, heads
        self._components, self._senders = components, senders
        self._passes = places_of(heads, _PASSING) & (senders >= 0)
        self._waiting = Waiting(arrivals, heads, components, senders, by.listened, by.epoch)

    def hear_second(self, places: Integers) -> None:
        """Those that are left of one second of stamps; each stretch of them ends where it has changed how others are heard."""
        registry = self._by.mavlink.registry
        registry.catch_up = self._waiting.catch_up
        while len(places):
            state = self._state()
            until = self._hear_each(self._waiting.begin(places, may_wait=not state[-1]), state)
            many, said, last = self._waiting.read()
            if many:
                self.gathered.add_all(last, int(self._arrivals.received_at[last]), many, said)
            places = places[places > until]
        registry.catch_up = None
        self.gathered.close()

    def _state(self) -> _State:
        """What the reading of frames that wait depends on, beside their senders' clocks; and whether none may wait, or be
        gathered: at another speed a second of stamps is not one of the session, and dead reckoning goes by those.
        """
        by = self._by
        none_may = by.epoch.offset_s is None or by.epoch.speed != 1.0 or by.plans.waits
        return by.mavlink.registry.version, by.epoch.anchor, none_may

    def _hear_each(self, places: Integers, state: _State) -> int:
        """Hear frames one by one until one changes the state; the place up to which they were heard."""
        waiting, components, may_gather = self._waiting, self._components, not state[-1]
        heads, senders, passing = self._heads[places], self._senders[places], self._passes[places]
        for place, head, sender, passes, arrival in zip(
            places.tolist(), heads.tolist(), senders.tolist(), passing.tolist(), self._arrivals.at(places), strict=True
        ):
            waiting.at = place
            if sender < 0:
                self._hear(place, arrival, head)
            elif passes and may_gather:
                self._gather(place, arrival, components[sender], head >> 24)
            else:
                heard = self._by.hear_counted(arrival, components[sender], head >> 24)
                self.gathered.say(place, arrival.received_at, heard)
            if sender >= 0:
                waiting.note(sender)
            if self._state() != state:
                return int(place)
        waiting.at = len(self._arrivals)
        return waiting.at

    def _hear(self, place: int, arrival: Arrival, head: Head) -> None:
        heard, is_refused = self._by.hear(arrival, head)
        if is_refused:
            self.refused.append(place)
        self.gathered.say(place, arrival.received_at, heard)

    def _gather(self, place: int, arrival: Arrival, component: Component, message: int) -> None:
        received_at, number, data, _ = arrival
        counters = self._by.listened[number].counters
        found = self._by.mavlink.read(component, message, payload_of(data, message), received_at, counters)
        self.gathered.add(place, number, received_at, found)
        if notes := self._by.say():
            self.gathered.close(notes)
