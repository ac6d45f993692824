"""Giving a vehicle a mission: a ground station's side of MAVLink's mission protocol, as a state machine without a link.

    we                                vehicle
                                <-    HEARTBEAT
    MISSION_COUNT n             ->
                                <-    MISSION_REQUEST_INT 0 (or MISSION_REQUEST)
    MISSION_ITEM_INT 0          ->
    ...                               up to n - 1
                                <-    MISSION_ACK

MISSION_COUNT is sent again where nothing answers it; from then on the vehicle asks again for what it lacks, and we only wait.
PX4 numbers items from 0; for all others item 0 is home. Source: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from adapters.mavlink_frames import Frame, fields
from adapters.mission_client import ANSWER_NS, SECOND, TRIES, Ask, outcome_name
from adapters.mission_writing import ABOVE_SEA, WAYPOINT, MissionItem, wire_fields
from adapters.roles import PX4, is_vehicle

HEARD_NS = 10 * SECOND  # a vehicle's heartbeat comes each second
SILENT_NS = 10 * SECOND  # an autopilot asks again sooner
_MOST_ITEMS = 65_535
_ACCEPTED, _INVALID_SEQUENCE = 0, 13

HEARTBEAT, _read_heartbeat = fields("HEARTBEAT", "type", "autopilot")
_TO = ("target_system", "target_component")
_REQUESTS = dict(fields(name, "seq", *_TO, "mission_type") for name in ("MISSION_REQUEST", "MISSION_REQUEST_INT"))
MISSION_ACK, _read_ack = fields("MISSION_ACK", "type", *_TO, "mission_type")


@dataclass(slots=True)
class MissionUpload:
    """One mission for the vehicle of a system number, or the first that is heard. Times are ns of one clock.

    `failure`: one sentence, once it has failed; `is_done`: the vehicle has all of it. `share` of it has been asked for.
    """

    items: Sequence[MissionItem]
    home: tuple[float, float, float]
    began_at: int
    wanted_system: int | None = None
    own_system: int = 254
    failure: str | None = None
    is_done: bool = False
    vehicle: tuple[int, int] | None = None
    _sent: tuple[MissionItem, ...] = ()
    _asks: list[Ask] = field(default_factory=list)
    _next: int = 0  # the furthest item that was asked for, and one more
    _tries: int = 0
    _due_at: int = 0
    _heard_at: int = 0

    @property
    def share(self) -> float:
        """From 0 to 1."""
        return self._next / len(self._sent) if self._sent else 0.0

    def hear(self, frame: Frame, now: int) -> None:
        """A good frame from the link."""
        if self.is_done or self.failure is not None:
            return
        if frame.message == HEARTBEAT and self.vehicle is None:
            self._meet(frame, now)
        elif (frame.system, frame.component) != self.vehicle:
            return
        elif frame.message in _REQUESTS:
            sequence, target, _, kind = _REQUESTS[frame.message](frame.payload)
            if target == self.own_system and kind == 0:
                self._give(sequence, now)
        elif frame.message == MISSION_ACK:
            result, target, _, kind = _read_ack(frame.payload)
            if target == self.own_system and kind == 0 and self._tries:
                self._end(result)

    def due(self, now: int) -> list[Ask]:
        """What to send now; `failure` is set where there is nothing more to be hoped for."""
        if self.is_done or self.failure is not None:
            return []
        if self.vehicle is None:
            if now - self.began_at > HEARD_NS:
                named = (
                    "No vehicle" if self.wanted_system is None else f"No vehicle with the number {self.wanted_system}"
                )
                self.failure = (
                    f"{named} was heard on the link within {HEARD_NS // SECOND} s; is it on, and is the link right?"
                )
            return []
        if self._next == 0 and now >= self._due_at:
            if self._tries == TRIES:
                self.failure = f"{self._name} was offered the mission {TRIES} times and does not answer."
                return []
            self._tries += 1
            self._due_at = now + ANSWER_NS
            self._asks.append(("MISSION_COUNT", {"count": len(self._sent), "mission_type": 0, **self._target}))
        elif self._next and now - self._heard_at > SILENT_NS:
            done = f"after item {self._next - 1} of {len(self._sent)}"
            self.failure = f"{self._name} fell silent {done}; it keeps the mission that it had. Try again."
        asks, self._asks = self._asks, []
        return asks

    @property
    def _name(self) -> str:
        return "The vehicle" if self.vehicle is None else f"Vehicle {self.vehicle[0]}"

    @property
    def _target(self) -> dict[str, int]:
        system, component = self.vehicle or (0, 0)
        return {"target_system": system, "target_component": component}

    def _meet(self, frame: Frame, now: int) -> None:
        kind, autopilot = _read_heartbeat(frame.payload)
        if not is_vehicle(kind, autopilot) or self.wanted_system not in (None, frame.system):
            return
        self.vehicle = (frame.system, frame.component)
        first = () if autopilot == PX4 else (MissionItem(WAYPOINT, *self.home, frame=ABOVE_SEA),)
        self._sent = (*first, *self.items)
        self._due_at = self._heard_at = now
        if len(self._sent) > _MOST_ITEMS:
            self.failure = f"A mission has at most {_MOST_ITEMS} items; this one has {len(self._sent)}."

    def _give(self, sequence: int, now: int) -> None:
        """The item that it asks for; what no mission of this length has is not answered, and the vehicle will ask again."""
        self._heard_at = now
        if sequence < len(self._sent):
            self._next = max(self._next, sequence + 1)
            self._asks.append(("MISSION_ITEM_INT", {**wire_fields(self._sent[sequence], sequence), **self._target}))

    def _end(self, result: int) -> None:
        if result == _ACCEPTED:
            self.is_done = self._next == len(self._sent)
            if not self.is_done:  # an acknowledgement of something else
                return
        elif result == _INVALID_SEQUENCE and self._next:  # of an item that came twice: it goes on asking
            return
        else:
            where = f" at item {self._next - 1}" if self._next else ""
            self.failure = (
                f"{self._name} refuses the mission{where}: {outcome_name(result)}. It keeps the one that it had."
            )
