"""A vehicle that answers as autopilots do, and a field with some of them: frames and times in, frames out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from adapters import Arrival, Source
from adapters.mavlink_frames import encode, message_name, parse
from adapters.signing import Signer
from gateway.runtime.manners import Manners

SECOND = 10**9
START = 1_790_000_000 * SECOND
STEP_NS = SECOND // 50
NAMES = {33: "GLOBAL_POSITION_INT", 24: "GPS_RAW_INT", 30: "ATTITUDE", 74: "VFR_HUD", 2: "SYSTEM_TIME", 0: "HEARTBEAT"}
STREAMS = {6: 33, 2: 24, 10: 30, 11: 74, 12: 2}
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


def message(
    name: str, system: int = 1, component: int = 1, sequence: int = 0, version: int = 2, **values: Any
) -> bytes:
    """A frame; fields that are not given are zero."""
    kind = next(one for one in dialect.mavlink_map.values() if one.msgname == name)
    zeros = {
        one: b"" if _type(kind, one) == "char" else [0] * length if length else 0
        for one, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    }
    return encode(name, zeros | values, system=system, component=component, sequence=sequence, version=version)


def _type(kind: Any, field_name: str) -> str:
    return str(kind.fieldtypes[kind.fieldnames.index(field_name)])


def read(frame: bytes, key: bytes | None = None) -> Any:
    """The message in a frame, as pymavlink reads it."""
    link = dialect.MAVLink(None)
    link.signing.secret_key = key
    (found,) = link.parse_buffer(frame) or [None]
    return found


@dataclass
class ScriptedVehicle:
    """`rates`: Hz by message id; `intervals`: how it answers SET_MESSAGE_INTERVAL by message id (default accepted)."""

    system: int = 1
    rates: dict[int, float] = field(default_factory=lambda: {0: 1.0})
    items: int = 0
    intervals: dict[int, int] = field(default_factory=dict)
    answers_511: int | None = ACCEPTED  # None: with silence
    home: int | None = ACCEPTED
    answers_missions: bool = True
    version: int = 2
    signer: Signer | None = None
    boot_at: int = START - 60 * SECOND
    asked: list[Any] = field(default_factory=list)
    now: int = START
    _sequence: int = 0
    _due: dict[int, int] = field(default_factory=dict)

    def say(self, name: str, **values: Any) -> bytes:
        """Its next frame."""
        self._sequence = self._sequence + 1 & 255
        frame = message(name, self.system, 1, self._sequence, self.version, **values)
        return frame if self.signer is None else self.signer.sign(frame, 0, self.now)

    def step(self, now: int) -> list[bytes]:
        """What it sends by itself."""
        self.now = now
        frames = []
        for number, rate in sorted(self.rates.items()):
            due = self._due.setdefault(number, now)
            if rate and now >= due:
                self._due[number] = due + round(SECOND / rate)
                frames.append(self._telemetry(number, (now - self.boot_at) // 10**6))
        return frames

    def _telemetry(self, number: int, boot_ms: int) -> bytes:
        if number == 0:
            return self.say("HEARTBEAT", type=1, autopilot=3, system_status=4, mavlink_version=3)
        timed = {"time_boot_ms": boot_ms} if number in (33, 30, 2) else {}
        return self.say(NAMES.get(number, "EXTENDED_SYS_STATE"), **timed)

    def hear(self, frame: bytes) -> list[bytes]:
        """Its answers to a frame."""
        heard = read(frame, None if self.signer is None else self.signer.key)
        kind = heard.get_type()
        if kind == "HEARTBEAT":
            return []
        assert heard.target_system == self.system
        self.asked.append(heard)
        me = {"target_system": heard.get_srcSystem(), "target_component": heard.get_srcComponent()}
        if kind == "COMMAND_LONG":
            return self._command(heard, me)
        if kind == "REQUEST_DATA_STREAM":
            self.rates[STREAMS[heard.req_stream_id]] = heard.req_message_rate
        if kind == "MISSION_REQUEST_LIST" and self.answers_missions:
            return [self.say("MISSION_COUNT", count=self.items, **me)]
        if kind == "MISSION_REQUEST_INT" and self.answers_missions:
            place = {"x": 310000000, "y": 1040000000, "z": 100}
            return [self.say("MISSION_ITEM_INT", seq=heard.seq, command=16, frame=3, **place, **me)]
        return []

    def _command(self, heard: Any, me: dict[str, int]) -> list[bytes]:
        number = int(heard.param1)
        if heard.command == 512:
            if self.home is None:
                return []
            answer = (
                [self.say("HOME_POSITION", q=[1, 0, 0, 0], latitude=1, longitude=1)] if self.home == ACCEPTED else []
            )
            return [self.say("COMMAND_ACK", command=512, result=self.home, **me), *answer]
        result = self.answers_511 if self.answers_511 != ACCEPTED else self.intervals.get(number, ACCEPTED)
        if result is None:
            return []
        if result == ACCEPTED:
            assert 1e6 / heard.param2 > self.rates.get(number, 0.0) - 1e-6, "a rate is lowered"
            self.rates[number] = 1e6 / heard.param2
            self._due[number] = self.now
        return [self.say("COMMAND_ACK", command=511, result=result, **me)]


@dataclass
class Field:
    """Manners and vehicles, each on a source of its own (or several on one), with losses in both directions."""

    manners: Manners
    vehicles: dict[int, list[ScriptedVehicle]]
    loss: float = 0.0
    random: Random = field(default_factory=lambda: Random(1))
    now: int = START
    sent: list[tuple[int, int, bytes]] = field(default_factory=list)  # when, source, frame

    def __post_init__(self) -> None:
        for number in self.vehicles:
            self.manners.add(Source(number, "mavlink", f"mavlink-{number}", f"udpin:127.0.0.1:{14550 + number}"))

    def run(self, seconds: float) -> Field:
        """Let time pass."""
        waiting: list[tuple[int, bytes]] = []
        for _ in range(round(seconds * SECOND / STEP_NS)):
            self.now += STEP_NS
            heard = waiting + [
                (number, frame)
                for number, those in self.vehicles.items()
                for one in those
                for frame in one.step(self.now)
            ]
            waiting = []
            self.hear(heard)
            for number, frame in self.manners.due(self.now):
                self.sent.append((self.now, number, frame))
                target = getattr(self._read(number, frame), "target_system", None)
                for vehicle in self.vehicles[number]:
                    if target in (None, vehicle.system) and not self._is_lost():
                        waiting += [(number, answer) for answer in vehicle.hear(frame)]
        return self

    def _read(self, number: int, frame: bytes) -> Any:
        signer = self.vehicles[number][0].signer if self.vehicles[number] else None
        return read(frame, None if signer is None else signer.key)

    def hear(self, frames: list[tuple[int, bytes]]) -> None:
        """Frames that come in now."""
        self.manners.hear([Arrival(self.now, number, frame) for number, frame in frames if not self._is_lost()])

    def _is_lost(self) -> bool:
        return self.random.random() < self.loss

    def kinds(self, since: int = 0) -> list[str]:
        """What was sent, by name, without heartbeats."""
        sent = [parse(frame) for when, _, frame in self.sent if when >= since]
        return [message_name(one.message) for one in sent if one is not None and one.message != 0]

    def told(self) -> str:
        """All notes so far."""
        return "\n".join(text for _, text in self.manners.notes)


@pytest.fixture(scope="session")
def scripted() -> type[ScriptedVehicle]:
    """The vehicle."""
    return ScriptedVehicle


@pytest.fixture(scope="session")
def flying_field() -> type[Field]:
    """The field."""
    return Field


@pytest.fixture(scope="session")
def frame_of() -> Callable[..., bytes]:
    """Makes a frame."""
    return message
