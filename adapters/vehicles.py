"""Who is who on MAVLink: which (source, system, component) is a vehicle, and which of them are the same vehicle.

A vehicle is a component whose HEARTBEAT names an autopilot and a type that moves. Before its first heartbeat component 1
is taken for a vehicle (by custom it is the autopilot), every other component is not.

The first vehicle of a system number is "mavlink:N". When the same number appears on a second source while the first is
alive, it is either the same vehicle over two links or another one: attitudes and positions are compared. One that was
heard on the other source too, bit for bit, makes them one. Twenty that were not, over more than 1.5 s, make them two, and
the second is "mavlink:N@2". A number that comes back on another source after 5 s of silence is the same vehicle.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import dataclass, field

from adapters.clock import SourceClock
from adapters.fixes import Fixes
from adapters.mavlink_frames import SequenceCheck
from adapters.plans import PlanBook
from gateway.observation import VehicleStatus

INVALID_AUTOPILOT = 8
# GCS, antenna tracker, onboard controller, gimbal, ADS-B, camera, charging station, FLARM, servo, ODID, battery,
# parachute, log, OSD, IMU, GPS, winch: they ride along or stand beside
STATIONS = frozenset((5, 6, 18, 26, 27, 30, 31, 32, 33, 34, 36, 37, 38, 39, 40, 41, 42))
_ALIVE_NS = 5 * 10**9
_TRIALS, _TRIAL_NS = 20, 1_500_000_000
_REMEMBERED = 256


@dataclass(slots=True)
class Vehicle:
    """One vehicle, over all links that carry it."""

    name: str
    system: int
    fixes: Fixes
    plan: PlanBook = field(default_factory=PlanBook)
    sources: set[int] = field(default_factory=set)
    last_heard: int = 0  # stamp
    first_heartbeat: int | None = None  # session time
    has_position_warning: bool = False
    has_sim_state: bool = False
    fix_notes: int = 0
    had_fix: bool = False
    status: VehicleStatus | None = None  # what its last heartbeat said
    last_attitude: int = -1  # time since boot, ns
    readings: dict[str, float] = field(default_factory=dict)  # what it last said, for people: "airspeed, m/s": 21.3
    words: dict[str, str] = field(default_factory=dict)  # and in words: "landed": "on ground"
    recent: deque[tuple[int, int, int, bytes]] = field(default_factory=lambda: deque(maxlen=512))

    def is_echo(self, frame: tuple[int, int, int, bytes]) -> bool:
        """Whether this frame was heard already, over another link. Remembers it."""
        if len(self.sources) < 2:
            return False
        if frame in self.recent:
            return True
        self.recent.append(frame)
        return False


@dataclass(slots=True)
class Component:
    """One (source, system, component): its clock, its sequence numbers, and what it is."""

    key: tuple[int, int, int]
    is_vehicle: bool
    clock: SourceClock = field(default_factory=SourceClock)
    sequence: SequenceCheck = field(default_factory=SequenceCheck)
    reboots_told: int = 0
    is_named_foreign: bool = False


@dataclass(slots=True)
class _Member:
    """One system number on one source."""

    vehicle: Vehicle | None = None
    tried: int = 0
    since: int = 0
    recent: deque[tuple[int, bytes]] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))


@dataclass(slots=True)
class Registry:
    """Every component and vehicle heard in a session. `origins`: what people call each source."""

    origins: dict[int, str]
    notes: list[tuple[str, str]]
    components: dict[tuple[int, int, int], Component] = field(default_factory=dict)
    _members: dict[tuple[int, int], _Member] = field(default_factory=dict)
    _vehicles: dict[int, list[Vehicle]] = field(default_factory=dict)

    def component(self, source: int, system: int, component: int) -> Component:
        """The component of this key; new ones begin with their role by custom."""
        key = (source, system, component)
        known = self.components.get(key)
        if known is None:
            known = self.components[key] = Component(key, is_vehicle=component == 1)
        return known

    def vehicle(
        self, source: int, system: int, evidence: tuple[int, bytes] | None, received_at: int, counters: Counter[str]
    ) -> Vehicle | None:
        """The vehicle of this number on this source; None as long as it is undecided which one it is.

        `evidence`: message id and payload of a frame that two vehicles would not send alike.
        """
        member = self._members.get((source, system))
        if member is None:
            member = self._members[source, system] = _Member(since=received_at)
        if evidence is not None:
            member.recent.append(evidence)
        vehicle = member.vehicle
        if vehicle is None:
            vehicle = member.vehicle = self._decide(source, system, member, evidence, received_at, counters)
            if vehicle is None:
                return None
            joins = bool(vehicle.sources) and received_at - vehicle.last_heard < _ALIVE_NS
            vehicle.sources.add(source)
            if joins:  # what told them to be one was heard on the other link
                return None
        vehicle.last_heard = received_at
        return vehicle

    def of_number(self, source: int, system: int) -> Vehicle | None:
        """The vehicle of a number: on this source, else the first of that number anywhere; None when there is none."""
        member = self._members.get((source, system))
        if member is not None and member.vehicle is not None:
            return member.vehicle
        return next(iter(self._vehicles.get(system, ())), None)

    def _decide(
        self,
        source: int,
        system: int,
        member: _Member,
        evidence: tuple[int, bytes] | None,
        received_at: int,
        counters: Counter[str],
    ) -> Vehicle | None:
        known = self._vehicles.get(system)
        if not known:
            return self._new(system, counters)
        alive = [vehicle for vehicle in known if received_at - vehicle.last_heard < _ALIVE_NS]
        if not alive:
            return max(known, key=lambda vehicle: vehicle.last_heard)
        same = self._same(system, member, alive)
        if same is not None:
            return same
        member.tried += evidence is not None
        if member.tried < _TRIALS or received_at - member.since < _TRIAL_NS:
            return None
        other = self._new(system, counters)
        there = ", ".join(self.origins[number] for number in sorted(alive[0].sources))
        text = f"Two vehicles say that they are system {system}: {alive[0].name} on {there}, "
        text += f"{other.name} on {self.origins[source]}."
        self.notes.append(("warning", text))
        return other

    def _same(self, system: int, member: _Member, alive: list[Vehicle]) -> Vehicle | None:
        """The living vehicle that has said something of what this member says."""
        said = set(member.recent)
        for vehicle in alive:
            for source in sorted(vehicle.sources):
                there = self._members[source, system]
                if not said.isdisjoint(there.recent):
                    return vehicle
        return None

    def _new(self, system: int, counters: Counter[str]) -> Vehicle:
        of_number = self._vehicles.setdefault(system, [])
        name = f"mavlink:{system}" if not of_number else f"mavlink:{system}@{len(of_number) + 1}"
        vehicle = Vehicle(name, system, Fixes(counters))
        of_number.append(vehicle)
        return vehicle
