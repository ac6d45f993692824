"""Who is who on MAVLink: which (source, system, component) is a vehicle, and which of them are the same vehicle.

What is a vehicle: roles.py. The first vehicle of a system number is "mavlink:N". When the same number appears on a second
source while the first is alive, it is either the same vehicle over two links or another one. A frame that was heard on
the other source too, bit for bit, makes them one; else what they say of their motion decides (likeness.py). Until then, for
10 s at most, the second source is not used. The second vehicle is "mavlink:N@2". A number that comes back on another
source after 5 s of silence is the same vehicle. Two that were taken for one and then fly more than 50 m apart for 3 s are
two from then on, and that is said.

Of a vehicle over several links, what carries a time is used from all of them, each time once. What carries none is used
from one link, for each kind of message the one that is the least delayed: else a late one would tell what is over.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from struct import Struct

from adapters.clock import SourceClock
from adapters.fixes import Fixes
from adapters.likeness import ATTITUDE, GLOBAL_POSITION_INT, Likeness, Trace
from adapters.meters import Rates
from adapters.roles import by_heartbeat, by_number, is_vehicle
from adapters.sequences import SequenceCheck, Siblings
from adapters.vehicle import Vehicle

SYSTEM_TIME = 2
_UTC = Struct("<QI")
# messages that begin with a time, and how many bytes of it: boot_ms or time_usec
_TIMED = {26: 4, 27: 8, 29: 4, ATTITUDE: 4, 31: 4, 32: 4, GLOBAL_POSITION_INT: 4, 63: 8, 105: 8, 116: 4, 129: 4, 340: 8}
_ALIVE_NS = 5 * 10**9
_TELLS_NS = 3 * 10**9  # after so long a silence another link's word is taken
_REMEMBERED = 256
_COMPONENTS_AT_MOST = 2048  # of a session; each holds a clock, some 9 kB


@dataclass(slots=True)
class Component:
    """One (source, system, component): its clock, its sequence numbers, and what it is."""

    key: tuple[int, int, int]
    is_vehicle: bool
    role: str
    clock: SourceClock
    sequence: SequenceCheck
    rates: Rates = field(default_factory=Rates)
    reboots_told: int = 0
    has_date_note: bool = False
    linked_to: Vehicle | None = None  # whose other links' clocks this one knows
    member: _Member | None = None

    @property
    def only_of(self) -> Vehicle | None:
        """The vehicle that it is part of, where no other link carries that one, and none may: nothing is compared then."""
        member = self.member
        if not self.is_vehicle or member is None or member.trace is not None or member.vehicle is None:
            return None
        return member.vehicle if len(member.vehicle.sources) == 1 else None

    @property
    def told_by(self) -> tuple[bool, int | None]:
        """What decides how its messages are read: whether it is a vehicle's, and of which autopilot."""
        vehicle = None if self.member is None else self.member.vehicle
        return self.is_vehicle, None if vehicle is None or vehicle.status is None else vehicle.status.autopilot

    def take_role(self, kind: int, autopilot: int) -> None:
        """What a HEARTBEAT says that this component is; it may change."""
        self.is_vehicle = is_vehicle(kind, autopilot)
        self.role = by_heartbeat(kind, autopilot, self.key[2])


@dataclass(slots=True)
class _Member:
    """One system number on one source. Its motion is followed only while it is compared with another source's."""

    source: int
    system: int
    vehicle: Vehicle | None = None
    trace: Trace | None = None
    recent: deque[tuple[int, bytes]] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))
    likenesses: dict[int, Likeness] = field(default_factory=dict)  # with the members on these sources


@dataclass(slots=True)
class Registry:
    """Every component and vehicle heard in a session. `origins`: what people call each source."""

    origins: dict[int, str]
    notes: list[tuple[str, str]]
    components: dict[tuple[int, int, int], Component] = field(default_factory=dict)
    version: int = 0  # another one wherever it may have changed what a component is, or whose
    catch_up: Callable[[], None] | None = None  # asked for before it matters when vehicles were heard last
    _is_full: bool = False
    _siblings: dict[tuple[int, int], Siblings] = field(default_factory=dict)
    _members: dict[int, dict[int, _Member]] = field(default_factory=dict)  # by system, then by source
    _vehicles: dict[int, list[Vehicle]] = field(default_factory=dict)

    def component(self, source: int, system: int, component: int) -> Component | None:
        """The component of this key; new ones begin with their role by custom. None for a new one where there are too many."""
        key = (source, system, component)
        known = self.components.get(key)
        if known is None:
            if len(self.components) >= _COMPONENTS_AT_MOST:
                if not self._is_full:
                    self._is_full = True
                    text = f"More than {_COMPONENTS_AT_MOST} senders speak MAVLink: new ones are counted, not heard."
                    self.notes.append(("warning", text))
                return None
            clock = SourceClock(key)
            sequence = SequenceCheck(self._siblings.setdefault(key[:2], Siblings()))
            known = self.components[key] = Component(key, component == 1, by_number(component), clock, sequence)
        return known

    def vehicles(self) -> list[Vehicle]:
        """All vehicles, in the order of their numbers."""
        return [vehicle for system in sorted(self._vehicles) for vehicle in self._vehicles[system]]

    def of_number(self, source: int, system: int) -> Vehicle | None:
        """The vehicle of a number: on this source, else the first of that number anywhere; None when there is none."""
        member = self._members.get(system, {}).get(source)
        if member is not None and member.vehicle is not None:
            return member.vehicle
        return next(iter(self._vehicles.get(system, ())), None)

    def hear(
        self, component: Component, message: int, payload: bytes, received_at: int, counters: Counter[str]
    ) -> Vehicle | None:
        """The vehicle that a message of a vehicle's component tells of; None where that is undecided, or was heard already."""
        member = component.member
        if member is None:
            member = component.member = self._member(*component.key[:2], received_at)
        if member.trace is not None:
            self._compare(member, message, payload, received_at, counters)
        vehicle = member.vehicle
        if vehicle is None:
            vehicle = self._decide(member, received_at, counters)
            if vehicle is None:
                counters["undecided"] += 1
                return None
            joins = bool(vehicle.sources) and received_at - vehicle.last_heard < _ALIVE_NS
            member.vehicle = vehicle
            vehicle.sources.add(member.source)
            self._follow(self._members[member.system], received_at)
            if joins:
                counters["undecided"] += 1
                return None  # what told them to be one was heard on the other link
        vehicle.last_heard = received_at
        if len(vehicle.sources) > 1 and self._is_echo(component, vehicle, message, payload, received_at):
            counters["heard twice"] += 1
            return None
        return vehicle

    def _member(self, source: int, system: int, received_at: int) -> _Member:
        members = self._members.setdefault(system, {})
        member = members.get(source)
        if member is None:
            member = members[source] = _Member(source, system)
            self._follow(members, received_at)
        return member

    def _follow(self, members: dict[int, _Member], received_at: int) -> None:
        """Follow the motion of those that are, or may be, one vehicle over several sources, and of no others."""
        self.version += 1
        open_question = len(members) > 1 and any(member.vehicle is None for member in members.values())
        for member in members.values():
            shared = member.vehicle is not None and len(member.vehicle.sources) > 1
            if not open_question and not shared:
                member.trace = None
                member.recent.clear()
                member.likenesses.clear()
            elif member.trace is None:
                member.trace = Trace(received_at)

    def _compare(self, member: _Member, message: int, payload: bytes, received_at: int, counters: Counter[str]) -> None:
        """Take a message in as evidence of who this is; two that have parted become two."""
        trace = member.trace
        assert trace is not None
        if message == SYSTEM_TIME:
            unix_usec, boot_ms = _UTC.unpack(payload[:12].ljust(12, b"\0"))
            if unix_usec:
                trace.hear_utc(unix_usec * 1000, boot_ms)
        if message not in (ATTITUDE, GLOBAL_POSITION_INT):
            return
        trace.hear(message, payload, received_at)
        if message == ATTITUDE or payload[4:12].strip(b"\0"):  # positions of all zeros two would send alike
            member.recent.append((message, payload))
        vehicle = member.vehicle
        for source, likeness in member.likenesses.items():
            likeness.compare()
            if vehicle is not None and source in vehicle.sources and likeness.have_parted():
                self._part(member, vehicle, counters)
                return

    def _decide(self, member: _Member, received_at: int, counters: Counter[str]) -> Vehicle | None:
        known = self._vehicles.get(member.system)
        if not known:
            return self._new(member.system, counters)
        if self.catch_up is not None:
            self.catch_up()
        alive = [vehicle for vehicle in known if received_at - vehicle.last_heard < _ALIVE_NS]
        if not alive:
            return max(known, key=lambda vehicle: vehicle.last_heard)
        said = set(member.recent)
        verdicts = []
        for vehicle in alive:
            for source in sorted(vehicle.sources):
                there = self._members[member.system][source]
                verdict = True if not said.isdisjoint(there.recent) else self._verdict(member, there, received_at)
                if verdict:
                    return vehicle
                verdicts.append(verdict)
        if None in verdicts:
            return None
        other = self._new(member.system, counters)
        links = ", ".join(self.origins[number] for number in sorted(alive[0].sources))
        text = f"Two vehicles say that they are system {member.system}: {alive[0].name} on {links}, "
        text += f"{other.name} on {self.origins[member.source]}."
        self.notes.append(("warning", text))
        return other

    def _verdict(self, member: _Member, there: _Member, received_at: int) -> bool | None:
        if member.trace is None or there.trace is None:
            return None
        likeness = member.likenesses.get(there.source)
        if likeness is None:
            likeness = member.likenesses[there.source] = Likeness(member.trace, there.trace)
        return likeness.verdict(received_at)

    def _part(self, member: _Member, vehicle: Vehicle, counters: Counter[str]) -> None:
        other = self._new(member.system, counters)
        text = f"{vehicle.name} was heard over several links, but on {self.origins[member.source]} it is "
        text += f"elsewhere: that is another vehicle of the same number, {other.name} from now on."
        self.notes.append(("warning", text))
        vehicle.sources.discard(member.source)
        other.sources.add(member.source)
        member.vehicle = other
        for key, component in self.components.items():
            if key[0] == member.source and key[1] == member.system:
                for sibling in component.clock.siblings:
                    sibling.siblings.remove(component.clock)
                component.clock.siblings.clear()
                component.linked_to = None
        self._follow(self._members[member.system], 0)

    def _is_echo(self, component: Component, vehicle: Vehicle, message: int, payload: bytes, received_at: int) -> bool:
        """Whether what a message of a vehicle over several links tells has been told over another, or is told better there."""
        source, _, number = component.key
        if component.linked_to is not vehicle:
            self._link(component, vehicle)
        if message == SYSTEM_TIME:
            return False  # each link's clock is its own
        size = _TIMED.get(message)
        if size is not None:
            return vehicle.is_told(source, number, message, payload[:size])
        key = (number, message)
        teller = vehicle.tellers.get(key)
        if teller is not None and teller[0] != source and received_at - teller[1] < _TELLS_NS:
            members = self._members[component.key[1]]
            mine, there = members[source].trace, members[teller[0]].trace
            if mine is None or there is None or mine.least is None or there.least is None or mine.least >= there.least:
                return True
        vehicle.tellers[key] = (source, received_at)
        return False

    def _link(self, component: Component, vehicle: Vehicle) -> None:
        """Let the clocks of one component over several links know of one another."""
        _, system, number = component.key
        component.linked_to = vehicle
        for source in sorted(vehicle.sources - {component.key[0]}):
            other = self.components.get((source, system, number))
            if other is not None and all(known is not other.clock for known in component.clock.siblings):
                component.clock.siblings.append(other.clock)
                other.clock.siblings.append(component.clock)
        members = self._members[system]
        member = members[component.key[0]]
        for source in vehicle.sources - {member.source}:
            there = members[source]
            paired = source in member.likenesses or member.source in there.likenesses
            if member.trace is not None and there.trace is not None and not paired:
                member.likenesses[source] = Likeness(member.trace, there.trace)

    def _new(self, system: int, counters: Counter[str]) -> Vehicle:
        of_number = self._vehicles.setdefault(system, [])
        name = f"mavlink:{system}" if not of_number else f"mavlink:{system}@{len(of_number) + 1}"
        vehicle = Vehicle(name, system, Fixes(counters))
        of_number.append(vehicle)
        return vehicle
