"""A vehicle's side of MAVLink's mission protocol, as a state machine without a link: messages in, messages out, time an argument.

    station                      we                          station                      we
    MISSION_REQUEST_LIST    ->                               MISSION_COUNT n          ->
                            <-   MISSION_COUNT n                                      <-   MISSION_REQUEST_INT 0
    MISSION_REQUEST_INT i   ->                               MISSION_ITEM_INT 0       ->
                            <-   MISSION_ITEM_INT i          ...                           up to n - 1
    ...                                                                               <-   MISSION_ACK accepted
    MISSION_ACK             ->
    MISSION_CLEAR_ALL       ->   MISSION_ACK                 MISSION_SET_CURRENT i    ->   MISSION_CURRENT i, or MISSION_ACK

MISSION_REQUEST is answered with MISSION_ITEM, the form with floats. MISSION_WRITE_PARTIAL_LIST (start, end) sends some items
anew; MISSION_REQUEST_PARTIAL_LIST is answered as MISSION_REQUEST_LIST. Giving is without memory: any station may ask for any
item at any time. Taking is from one station at a time; another one is denied meanwhile. An item that does not come is asked
for again 5 times, 1.5 s apart, then the transfer is cancelled. The old mission holds until the last item of the new one came.
There are no fences and no rally points: such a list is empty, and takes nothing.

Source: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from adapters.mavlink_frames import fields
from adapters.mission_client import ANSWER_NS, TRIES
from adapters.mission_writing import MissionItem, wire_fields

ACCEPTED, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE = 0, 2, 3, 4  # MAV_MISSION_RESULT
INVALID_X, INVALID_Y, INVALID_Z, INVALID_SEQUENCE, DENIED, CANCELLED = 10, 11, 12, 13, 14, 15
MOST_ITEMS = 724  # as many as ArduPilot keeps
_MISSION, _ALL = 0, 255
_GUIDED = 2  # `current` of an item that is a guided target

_GLOBAL_FRAMES = frozenset((0, 3, 5, 6, 10, 11))
_NO_PLACE_FRAMES = frozenset((2,))
_LARGEST_DEG = 214.0  # what a 32-bit number of degE7 holds; where an item has no place these are parameters
_TO = ("target_system", "target_component")
REQUEST_LIST, _read_list = fields("MISSION_REQUEST_LIST", *_TO, "mission_type")
REQUEST_PARTIAL, _read_partial = fields("MISSION_REQUEST_PARTIAL_LIST", *_TO, "mission_type")
REQUEST, _read_request = fields("MISSION_REQUEST", "seq", *_TO, "mission_type")
REQUEST_INT, _read_request_int = fields("MISSION_REQUEST_INT", "seq", *_TO, "mission_type")
COUNT, _read_count = fields("MISSION_COUNT", "count", *_TO, "mission_type")
WRITE_PARTIAL, _read_write = fields("MISSION_WRITE_PARTIAL_LIST", "start_index", "end_index", *_TO, "mission_type")
_ITEM = (
    *("param1", "param2", "param3", "param4", "x", "y", "z"),
    *("seq", "command", *_TO, "frame", "current", "autocontinue", "mission_type"),
)
ITEM, _read_item = fields("MISSION_ITEM", *_ITEM)
ITEM_INT, _read_item_int = fields("MISSION_ITEM_INT", *_ITEM)
CLEAR_ALL, _read_clear = fields("MISSION_CLEAR_ALL", *_TO, "mission_type")
SET_CURRENT, _read_set = fields("MISSION_SET_CURRENT", "seq", *_TO)
ACK, _ = fields("MISSION_ACK", *_TO)
_READ = {ITEM: _read_item, ITEM_INT: _read_item_int}
TRAFFIC = frozenset(
    (
        REQUEST_LIST,
        REQUEST_PARTIAL,
        REQUEST,
        REQUEST_INT,
        COUNT,
        WRITE_PARTIAL,
        ITEM,
        ITEM_INT,
        CLEAR_ALL,
        SET_CURRENT,
        ACK,
    )
)

Station = tuple[int, int]
"""System and component of who speaks."""

Items = tuple[MissionItem, ...]


class Said(NamedTuple):
    """A message to send: its name and fields, the station it is for included."""

    name: str
    values: dict[str, Any]


class Change(NamedTuple):
    """What a station has brought about: another mission, the item to go on with, or a place to go to outside of it."""

    items: Items | None = None
    current: int | None = None
    guided: MissionItem | None = None


@dataclass(slots=True)
class _Taking:
    """A transfer to us: from whom, which items, and when to ask again."""

    station: Station
    first: int
    count: int
    is_partial: bool
    due_at: int
    items: list[MissionItem] = field(default_factory=list)
    tries: int = 1


@dataclass(slots=True)
class MissionServer:
    """One vehicle's. `commands` are the MAV_CMD that it can carry out: a mission with another one is refused."""

    commands: frozenset[int]
    _taking: _Taking | None = None

    def hear(
        self, message: int, payload: bytes, station: Station, now: int, items: Items
    ) -> tuple[list[Said], Change | None]:
        """One of `TRAFFIC`, for us, who have this mission now: what to answer, and what it changes."""
        if message in (REQUEST_LIST, REQUEST_PARTIAL):
            kind = (_read_list if message == REQUEST_LIST else _read_partial)(payload)[-1]
            count = len(items) if kind == _MISSION else 0
            return [Said("MISSION_COUNT", {"count": count, "mission_type": kind, **_target(station)})], None
        if message in (REQUEST, REQUEST_INT):
            sequence, *_, kind = (_read_request if message == REQUEST else _read_request_int)(payload)
            return [_give(items, sequence, kind, station, is_float=message == REQUEST)], None
        if message == COUNT:
            count, *_, kind = _read_count(payload)
            return self._begin(_Taking(station, 0, count, False, now + ANSWER_NS), kind)
        if message == WRITE_PARTIAL:
            start, end, *_, kind = _read_write(payload)
            if not 0 <= start <= end < len(items):
                return [_acknowledge(INVALID_SEQUENCE, kind, station)], None
            return self._begin(_Taking(station, start, end - start + 1, True, now + ANSWER_NS), kind)
        if message in (ITEM, ITEM_INT):
            return self._take(message, payload, station, now, items)
        if message == CLEAR_ALL:
            return self._clear(_read_clear(payload)[-1], station)
        if message == SET_CURRENT:
            return _set_current(int(_read_set(payload)[0]), station, items)
        return [], None  # MISSION_ACK: what we gave has arrived

    def due(self, now: int) -> list[Said]:
        """What to send because nothing came."""
        taking = self._taking
        if taking is None or now < taking.due_at:
            return []
        if taking.tries == TRIES:
            self._taking = None
            return [_acknowledge(CANCELLED, _MISSION, taking.station)]
        taking.tries += 1
        taking.due_at = now + ANSWER_NS
        return [_request(taking)]

    def _begin(self, taking: _Taking, kind: int) -> tuple[list[Said], Change | None]:
        if kind != _MISSION:
            return [_acknowledge(ACCEPTED if taking.count == 0 else UNSUPPORTED, kind, taking.station)], None
        if self._taking is not None and self._taking.station != taking.station:
            return [_acknowledge(DENIED, kind, taking.station)], None
        if taking.count > MOST_ITEMS:
            return [_acknowledge(NO_SPACE, kind, taking.station)], None
        if taking.count == 0:
            return self._clear(kind, taking.station)
        self._taking = taking
        return [_request(taking)], None

    def _take(
        self, message: int, payload: bytes, station: Station, now: int, items: Items
    ) -> tuple[list[Said], Change | None]:
        p1, p2, p3, p4, x, y, z, sequence, command, _, _, frame, current, _, kind = _READ[message](payload)
        taking = self._taking
        latitude, longitude = (x / 1e7, y / 1e7) if message == ITEM_INT else (x, y)
        item = MissionItem(command, latitude, longitude, z, frame, (p1, p2, p3, p4))
        if kind != _MISSION:
            return [_acknowledge(UNSUPPORTED, kind, station)], None
        if current == _GUIDED:
            result = self._refusal(item)
            return [_acknowledge(result, kind, station)], Change(guided=item) if result == ACCEPTED else None
        if taking is None or taking.station != station:
            return [_acknowledge(INVALID_SEQUENCE if taking is None else DENIED, kind, station)], None
        wanted = taking.first + len(taking.items)
        if sequence != wanted:
            # a station that repeats itself is behind; one that is ahead has lost our question
            return ([] if sequence < wanted else [_request(taking)]), None
        refusal = self._refusal(item)
        if refusal != ACCEPTED:
            self._taking = None
            return [_acknowledge(refusal, kind, station)], None
        taking.items.append(item)
        taking.tries, taking.due_at = 1, now + ANSWER_NS
        if len(taking.items) < taking.count:
            return [_request(taking)], None
        self._taking = None
        after = items[taking.first + taking.count :] if taking.is_partial else ()
        return [_acknowledge(ACCEPTED, kind, station)], Change((*items[: taking.first], *taking.items, *after))

    def _refusal(self, item: MissionItem) -> int:
        if item.command not in self.commands:
            return UNSUPPORTED
        if item.frame not in _GLOBAL_FRAMES | _NO_PLACE_FRAMES:
            return UNSUPPORTED_FRAME
        north, east = (90.0, 180.0) if item.frame in _GLOBAL_FRAMES else (_LARGEST_DEG, _LARGEST_DEG)
        if not abs(item.latitude_deg) <= north:  # false for NaN too
            return INVALID_X
        if not abs(item.longitude_deg) <= east:
            return INVALID_Y
        return ACCEPTED if math.isfinite(item.altitude_m) else INVALID_Z

    def _clear(self, kind: int, station: Station) -> tuple[list[Said], Change | None]:
        changes = kind in (_MISSION, _ALL)
        if changes:
            self._taking = None
        return [_acknowledge(ACCEPTED, kind, station)], Change(()) if changes else None


def _set_current(sequence: int, station: Station, items: Items) -> tuple[list[Said], Change | None]:
    if sequence >= len(items):
        return [_acknowledge(INVALID_SEQUENCE, _MISSION, station)], None
    return [], Change(current=sequence)


def _give(items: Items, sequence: int, kind: int, station: Station, *, is_float: bool) -> Said:
    if kind != _MISSION or sequence >= len(items):
        return _acknowledge(INVALID_SEQUENCE, kind, station)
    item = items[sequence]
    values = wire_fields(item, sequence, is_float=is_float) | _target(station)
    return Said("MISSION_ITEM" if is_float else "MISSION_ITEM_INT", values)


def _target(station: Station) -> dict[str, int]:
    return {"target_system": station[0], "target_component": station[1]}


def _acknowledge(result: int, kind: int, station: Station) -> Said:
    return Said("MISSION_ACK", {"type": result, "mission_type": kind, **_target(station)})


def _request(taking: _Taking) -> Said:
    values = {"seq": taking.first + len(taking.items), "mission_type": _MISSION, **_target(taking.station)}
    return Said("MISSION_REQUEST_INT", values)
