"""Arrivals to what was heard: the one door from bytes to observations, the same live and replayed.

A pure function of the arrivals so far: no clock is read here, so that a replay of the same arrivals says the same.

Counters of a MAVLink source, by reason:

    frames, not a frame, system 0                            what came
    crc error, definition differs, unknown id                what could not be read: damage, another dialect, no dialect of ours
    lost, duplicate, reordered, unsequenced                  by the sequence numbers of each (system, component)
    bad time, clock unsure, reboots                          times that are none, or of which boot is not known yet
    undecided, heard twice                                   over several links: not known yet whose, and told before
    too many components                                      more than 2048 senders: new ones are not heard
    signed, unchecked; unsigned, wrong signature, ...        without a key, and refused with one
    no fix, position out of range, repeated, ...             messages that say nothing

What links lose (kernel drops, resynced bytes) is counted with the links.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from adapters import Arrival, Source, declared, told
from adapters.arrivals import Arrivals
from adapters.epoch import SessionEpoch
from adapters.frame_batches import MANY, NO_HEAD, Head, frame_of, payload_of, wanted
from adapters.gathering import Said
from adapters.listening import Listened
from adapters.mavlink import MavlinkObserver
from adapters.mavlink_frames import Frame, parse
from adapters.meters import SECOND
from adapters.radar import LandingRadarReceiver, observations, refusal_advice
from adapters.radar import Taken as TakenDatagram
from adapters.radar_clocks import RadarClocks
from adapters.signing import advice
from adapters.together import Together
from adapters.vehicles import Component
from adapters.wellbeing import vehicles_health
from gateway.observation import Heard, Observation, WeatherArea
from gateway.picture import Health

Observations = tuple[Observation, ...]

HEALTH_AFTER_NS = SECOND // 4  # of each second: at its beginning there is much else to do


class FrameGuard(Protocol):
    """Who decides which MAVLink frames are believed."""

    def judge(self, frame: bytes, source: int, now: int) -> str | None:
        """Why a frame of a source is refused, or None: it is believed. `now` is its stamp. Never raises."""


class Decoder:
    """Decodes the arrivals of a session, source by source, in the order of their stamps.

    `keys`: the key of each radar number that has one. `live`: a keyed datagram that is more than 10 s from the session's
    time is refused; a replay does not repeat that. `signing`: which MAVLink frames are believed; None: all. After each
    arrival, `refused` is the reason why it was refused, or None: what was refused is to be recorded apart and not replayed;
    it has left no trace but its counter.
    """

    def __init__(
        self,
        sources: Sequence[Source] = (),
        *,
        keys: Mapping[int, bytes] | None = None,
        live: bool = False,
        signing: FrameGuard | None = None,
    ) -> None:
        self.refused: str | None = None
        self._epoch = SessionEpoch()
        self._mavlink = MavlinkObserver(self._epoch)
        self._wanted = self._mavlink.wanted
        self._signing = signing
        self._radar = LandingRadarReceiver(dict(keys or {}), live)
        self._listened: dict[int, Listened] = {}
        self._notes = self._mavlink.notes
        self._radar_clocks = RadarClocks(self._epoch, self._notes)
        self._plans = told.ToldPlans(self._mavlink.registry)
        self._health: tuple[int, int, Health] | None = None
        self._together = Together(
            self._mavlink,
            self._epoch,
            self._plans,
            self._listened,
            wanted(self._wanted),
            self._hear_and_judge,
            self._hear_counted,
            self._say,
        )
        for source in sources:
            self.add(source)

    def add(self, source: Source) -> None:
        """A source that is new."""
        self._listened[source.number] = Listened(source)
        self._mavlink.origins[source.number] = source.origin

    @property
    def wanted(self) -> frozenset[int]:
        """The MAVLink messages that say something here; all others are only counted."""
        return self._wanted

    @property
    def epoch_offset_s(self) -> int | None:
        """The session's epoch offset in whole seconds; None as long as no source's clock has settled."""
        return self._epoch.offset_s

    def session_time(self, received_at: int) -> int:
        """The session's time of a stamp, ns since 1970 UTC."""
        return self._epoch.session_time(received_at)

    def hear_many(self, arrivals: Sequence[Arrival]) -> tuple[Said, list[int]]:
        """The same as to hear each of them, in less time: what those said that said anything, and which were refused.

        Of many, what no stage reads (attitudes, inertial samples, air data) comes together, as one Heard for each second of
        stamps, behind what came before its last arrival.
        """
        if len(arrivals) >= MANY and self._signing is None:
            return self._together.hear_all(Arrivals.of(arrivals))
        said, refused = [], []
        for place, arrival in enumerate(arrivals):
            heard = self.hear(arrival)
            if heard is not None:
                said.append((place, heard))
            if self.refused is not None:
                refused.append(place)
        return said, refused

    def _hear_counted(self, arrival: Arrival, component: Component, message: int) -> Heard | None:
        """What a good frame says that was counted with those around it."""
        received_at, number, data, _ = arrival
        listened = self._listened[number]
        was_settled = self._epoch.offset_s is not None
        found = self._mavlink.read(component, message, payload_of(data, message), received_at, listened.counters)
        return self._as_heard(self._with_plans(found, received_at), listened, received_at, was_settled)

    def hear(self, arrival: Arrival, head: Head = NO_HEAD) -> Heard | None:
        """One MAVLink frame, radar datagram or told line; None where it observed nothing and there is nothing to say.

        `head`: as `heads_of` has it, where it was asked. Raises KeyError for a source that was not added, and nothing else.
        """
        received_at, number, data, _ = arrival
        listened = self._listened[number]
        listened.last_heard = received_at
        self.refused = None
        kind, was_settled = listened.source.kind, self._epoch.offset_s is not None
        if kind == "mavlink":
            if self._signing is not None and not self._believes(arrival, listened):
                return self._only_notes(received_at)
            is_wanted = head != NO_HEAD and head >> 24 in self._wanted
            if not is_wanted and listened.passes(data, head, self._wanted, received_at):
                return self._only_notes(received_at) if self._notes else None
            frame = frame_of(head, payload_of(data, head >> 24)) if is_wanted else parse(data)
            found = self._hear_mavlink(arrival, frame, listened)
        else:
            found = self._hear_radar(arrival, listened) if kind == "radar" else self._hear_told(arrival, listened)
        return self._as_heard(found, listened, received_at, was_settled)

    def _as_heard(self, found: Observations, listened: Listened, received_at: int, was_settled: bool) -> Heard | None:
        if not found and not self._notes:
            return None
        if not was_settled and self._epoch.offset_s:
            # The session's time leaps with this arrival: why is said in the time before, and the leap comes with the next.
            listened.counters["clock settling"] += len(found)
            return Heard(received_at, (), self._say())
        if found:
            listened.count(received_at, len(found))
        return Heard(self._epoch.session_time(received_at), found, self._say())

    def _hear_and_judge(self, arrival: Arrival, head: Head) -> tuple[Heard | None, bool]:
        heard = self.hear(arrival, head)
        return heard, self.refused is not None

    def feed(self, arrival: Arrival) -> Heard:
        """The same, and a Heard also where there is nothing in it."""
        return self.hear(arrival) or Heard(self._epoch.session_time(arrival.received_at))

    def watermark(self, received_at: int) -> Heard:
        """Nothing stamped at or before this is still to come."""
        return Heard(self._epoch.session_time(received_at), (), self._say())

    def health(self, received_at: int) -> Health:
        """How each source and each vehicle is doing; made once for each second of stamps. Changes no observation."""
        second, number = (received_at - HEALTH_AFTER_NS) // SECOND, len(self._listened)
        if self._health is None or self._health[:2] != (second, number):
            listened = [self._listened[number] for number in sorted(self._listened)]
            names = {one.source.number: one.source.name for one in listened}
            vehicles = vehicles_health(self._mavlink.registry, self._epoch, names, received_at)
            self._health = second, number, Health(tuple(one.health(received_at) for one in listened), vehicles)
        return self._health[2]

    def counters(self) -> dict[str, int]:
        """Totals by source and reason."""
        return {
            f"{listened.source.name} {reason}": total
            for _, listened in sorted(self._listened.items())
            for reason, total in sorted(listened.counters.items())
            if total
        }

    def _only_notes(self, received_at: int) -> Heard | None:
        return Heard(self._epoch.session_time(received_at), (), self._say()) if self._notes else None

    def _say(self) -> tuple[tuple[str, str], ...]:
        if not self._notes:
            return ()
        notes = tuple(self._notes)
        self._notes.clear()
        return notes

    def _believes(self, arrival: Arrival, listened: Listened) -> bool:
        assert self._signing is not None
        self.refused = reason = self._signing.judge(arrival.data, arrival.source, arrival.received_at)
        if reason is None:
            return True
        listened.counters[reason] += 1
        self._advise(listened, reason, advice(reason, listened.source.origin))
        return False

    def _advise(self, listened: Listened, reason: str, sentence: str) -> None:
        """Say, the first time that something of a source is refused for a reason, what there is to do."""
        if sentence and reason not in listened.advised:
            listened.advised.add(reason)
            self._notes.append(("warning", sentence))

    def _hear_mavlink(self, arrival: Arrival, frame: Frame | None, listened: Listened) -> Observations:
        if frame is None:
            listened.counters["not a frame"] += 1
            return ()
        listened.counters["frames"] += 1
        if frame.verdict == "good":
            listened.known_good.add(frame.message)
        elif frame.verdict == "bad checksum":  # always for one id, while framing goes on: not damage
            listened.counters["crc error" if frame.message in listened.known_good else "definition differs"] += 1
        else:
            listened.counters[frame.verdict] += 1
        if frame.signed and self._signing is None:
            listened.counters["signed, unchecked"] += 1
        found = self._mavlink.hear(arrival.source, frame, arrival.received_at, listened.counters)
        if (place := frame.component << 8 | frame.system) not in listened.components:
            component = self._mavlink.registry.components.get((arrival.source, frame.system, frame.component))
            if component is not None:
                listened.components[place] = component
        return self._with_plans(found, arrival.received_at)

    def _hear_told(self, arrival: Arrival, listened: Listened) -> Observations:
        now, plan = self._epoch.session_time(arrival.received_at), told.decode(arrival.data)
        if plan is not None:
            listened.counters["plans"] += 1
            return self._plans.hear(plan, now, arrival.received_at)
        said = declared.decode(arrival.data, now, arrival.received_at)
        if said is None:
            listened.counters["not understood"] += 1
            return ()
        listened.counters["weather" if isinstance(said, WeatherArea) else "declarations"] += 1
        self._notes.append(("info", declared.sentence(said)))
        return (said,)

    def _with_plans(self, found: Observations, received_at: int) -> Observations:
        """What was heard, and what was told that becomes of it."""
        return self._plans.joined(found, self._epoch.session_time(received_at), received_at) if self._plans else found

    def _hear_radar(self, arrival: Arrival, listened: Listened) -> Observations:
        origin = listened.source.origin if not arrival.peer else f"{arrival.peer} on {listened.source.origin}"
        now = self._epoch.session_time(arrival.received_at)
        self._radar.counters = listened.counters
        outcome = self._radar.hear(arrival.data, (arrival.source, arrival.peer), origin, now)
        if not isinstance(outcome, TakenDatagram):
            self.refused = outcome
            self._advise(listened, outcome, refusal_advice(outcome, origin))
            return ()
        self._notes.extend(outcome.notes)
        timing = self._radar_clocks.timing(outcome.datagram.header, arrival.received_at)
        return observations(outcome.datagram, arrival.received_at, timing)
