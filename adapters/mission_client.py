"""Reading the mission of one vehicle: the asking side of MAVLink's mission protocol, as a state machine without a link.

    we                              vehicle
    MISSION_REQUEST_LIST     ->
                             <-     MISSION_COUNT n
    MISSION_REQUEST_INT 0    ->
                             <-     MISSION_ITEM_INT 0 (or MISSION_ITEM)
    ...                             up to n - 1
    MISSION_ACK accepted     ->

A vehicle serves one station at a time. So nothing is asked before 5 s without anybody else's mission traffic with it,
and when somebody's traffic appears in the middle we fall silent, and begin anew after 5 s. An answer is waited for 1.5 s
and asked for again 5 times; then that is said, and nothing more is asked until the mission changes or the vehicle reboots.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import fields

Ask = tuple[str, dict[str, Any]]
"""A message to send: its name and its fields, without whom it is for."""

SECOND = 10**9
QUIET_NS = 5 * SECOND
ANSWER_NS = 3 * SECOND // 2
TRIES = 6  # the first and 5 more
_ACCEPTED, _MISSION = 0, 0  # MAV_MISSION_ACCEPTED; MAV_MISSION_TYPE_MISSION: no fence, no rally points

MISSION_CURRENT, _read_current = fields("MISSION_CURRENT", "total", "seq")
MISSION_COUNT, _read_count = fields("MISSION_COUNT", "count", "target_system", "mission_type")
MISSION_ACK, _read_ack = fields("MISSION_ACK", "type", "target_system", "mission_type")
_ITEMS = dict(fields(name, "seq", "target_system", "mission_type") for name in ("MISSION_ITEM", "MISSION_ITEM_INT"))
_OF_OTHERS = dict(
    fields(name, "target_system", "target_component")
    for name in (
        "MISSION_REQUEST_LIST", "MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_REQUEST_PARTIAL_LIST",
        "MISSION_WRITE_PARTIAL_LIST", "MISSION_CLEAR_ALL", "MISSION_COUNT", "MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_ACK",
    )
)  # fmt: skip
MISSION_TRAFFIC = frozenset(_OF_OTHERS)


def target_system(message: int, payload: bytes) -> int:
    """The system that one of `MISSION_TRAFFIC` is for."""
    return int(_OF_OTHERS[message](payload)[0])


def tells_of_a_change(message: int, payload: bytes) -> bool:
    """Whether this message of a vehicle to another station ends an upload: what we know of its mission is old."""
    if message != MISSION_ACK:
        return False
    outcome, _, mission = _read_ack(payload)
    return bool(outcome == _ACCEPTED and mission == _MISSION)


@dataclass(slots=True)
class MissionClient:
    """One vehicle's mission. Times are stamps, ns. What there is to say once gathers in `notes` as (level, text)."""

    name: str
    began_at: int
    wanted_since: int = 0  # what was read before this is old
    is_wanted: bool = True
    is_active: bool = False
    finished_at: int | None = None
    notes: list[tuple[str, str]] = field(default_factory=list)
    _others_at: int = 0  # when somebody else's traffic was heard last
    _backed_off: bool = False  # said already
    _total: int | None = None
    _count: int | None = None
    _next: int = 0
    _tries: int = 0
    _due_at: int = 0
    _is_to_acknowledge: bool = False

    def hear_others(self, now: int) -> None:
        """Somebody else's mission traffic with this vehicle."""
        self._others_at = now
        if self.is_active:
            self.is_active = False
            if not self._backed_off:
                self._backed_off = True
                self.notes.append(
                    ("info", f"{self.name}: another station uses its mission; ours is read when it is done.")
                )

    def hear_current(self, payload: bytes) -> bool:
        """MISSION_CURRENT: whether it tells of another mission than before."""
        total = int(_read_current(payload)[0])
        changed = self._total is not None and total != self._total
        self._total = total
        return changed

    def want(self, now: int) -> None:
        """Its mission has changed, or may have: read it again."""
        self.is_wanted, self.is_active, self.wanted_since = True, False, now
        self._backed_off = False

    def share(self, now: int) -> None:
        """It is read over another link."""
        self.is_wanted, self.finished_at = False, now

    def hear(self, message: int, payload: bytes, now: int) -> None:
        """An answer to us."""
        if not self.is_active:
            return
        if message == MISSION_COUNT and self._count is None:
            count, _, mission = _read_count(payload)
            if mission == _MISSION:
                self._count = count
                self._go_on(now)
        elif message in _ITEMS and self._count is not None:
            sequence, _, mission = _ITEMS[message](payload)
            if mission == _MISSION and sequence == self._next:
                self._next += 1
                self._go_on(now)
        elif message == MISSION_ACK:
            outcome, _, mission = _read_ack(payload)
            if mission == _MISSION:
                self._end(now)
                self.notes.append(
                    ("warning", f"{self.name} does not give its mission (it answers {outcome_name(outcome)}).")
                )

    def due(self, now: int) -> Ask | None:
        """What to send now."""
        if self._is_to_acknowledge:
            self._is_to_acknowledge = False
            return "MISSION_ACK", {"type": _ACCEPTED}
        if not self.is_wanted:
            return None
        if not self.is_active:
            if not self.is_ready(now):
                return None
            self.is_active, self._count, self._next, self._tries, self._due_at = True, None, 0, 0, now
        if now < self._due_at:
            return None
        if self._tries == TRIES:
            asked = "its mission" if self._count is None else f"item {self._next} of its mission"
            self.notes.append(("warning", f"{self.name} was asked {TRIES} times for {asked} and does not answer."))
            self._end(now)
            return None
        self._tries += 1
        self._due_at = now + ANSWER_NS
        if self._count is None:
            return "MISSION_REQUEST_LIST", {}
        return "MISSION_REQUEST_INT", {"seq": self._next}

    def is_ready(self, now: int) -> bool:
        """Whether the next `due` begins a transfer."""
        quiet_since = max(self.began_at, self.wanted_since, self._others_at)
        return self.is_wanted and not self.is_active and now - quiet_since >= QUIET_NS

    def _go_on(self, now: int) -> None:
        """The answer has come: ask for the next at once, or end."""
        self._tries, self._due_at = 0, now
        if self._next == self._count:
            self._is_to_acknowledge = True
            self._end(now)
            items = "is empty" if not self._count else f"was read: {self._count} items"
            self.notes.append(("info", f"{self.name}: its mission {items}."))

    def _end(self, now: int) -> None:
        self.is_wanted = self.is_active = False
        self.finished_at = now


def outcome_name(code: int) -> str:
    """What a MISSION_ACK says, in words."""
    named = dialect.enums["MAV_MISSION_RESULT"].get(code)
    return str(code) if named is None else named.name.removeprefix("MAV_MISSION_").lower().replace("_", " ")
