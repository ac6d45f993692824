"""What a vehicle answers to commands, mission transfers and questions for parameters: MAVLink messages in, messages out.

COMMAND_LONG, COMMAND_INT   COMMAND_ACK, and what the command asks for (`_COMMANDS`)
SET_MODE                    COMMAND_ACK of it, as ArduPilot answers
REQUEST_DATA_STREAM         other rates on this link; nothing is answered
MISSION_*, PARAM_*          `adapters.mission_server`, `adapters.parameter_server`
SET_POSITION_TARGET_GLOBAL_INT   go there, where it gives a place
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from adapters import mission_server, parameter_server
from adapters.mavlink_frames import Frame, fields, message_name
from adapters.mission_server import MissionServer, Said, Station
from adapters.mission_writing import ABOVE_HOME, ABOVE_SEA
from adapters.rate_client import REQUEST_MESSAGE, SET_MESSAGE_INTERVAL
from sim.vehicles.missions import TAKEN
from sim.vehicles.motion import Answer, Arm, ChangeSpeed, GoAround, GoTo, GoToItem, Order, SetMode, TakeOff, Vehicle
from sim.vehicles.telling import DEFAULT_HZ, STREAMS, Teller

_TO = ("target_system", "target_component")
_FIRST = ("param1", "param2", "param3", "param4")
LONG, _read_long = fields("COMMAND_LONG", *_FIRST, "param5", "param6", "param7", "command", *_TO)
INT, _read_int = fields("COMMAND_INT", *_FIRST, "x", "y", "z", "command", *_TO, "frame")
SET_MODE, _read_mode = fields("SET_MODE", "custom_mode", "target_system", "base_mode")
DATA_STREAM, _read_stream = fields("REQUEST_DATA_STREAM", "req_message_rate", *_TO, "req_stream_id", "start_stop")
TARGET, _read_target = fields(
    "SET_POSITION_TARGET_GLOBAL_INT", "lat_int", "lon_int", "alt", "type_mask", *_TO, "coordinate_frame"
)
HEARD = frozenset((LONG, INT, SET_MODE, DATA_STREAM, TARGET)) | mission_server.TRAFFIC | parameter_server.TRAFFIC

LIMITS = {
    "AIRSPEED_CRUISE": (10.0, 140.0),
    "CRUISE_SPEED": (0.5, 20.0),
    "LAND_ALT_LOW": (100.0, 10_000.0),
    "LAND_SPEED": (30.0, 200.0),
    "NAVL1_PERIOD": (5.0, 60.0),
    "ROLL_LIMIT_DEG": (10.0, 60.0),
    "RTL_ALT": (200.0, 300_000.0),
    "RTL_ALTITUDE": (10.0, 3000.0),
    "TKOFF_ALT": (10.0, 3000.0),
    "WPNAV_RADIUS": (50.0, 1000.0),
    "WPNAV_SPEED": (50.0, 5000.0),
    "WP_LOITER_RAD": (20.0, 10_000.0),
    "WP_RADIUS": (1.0, 3000.0),
}
"""What stations may set parameters to, in ArduPilot's units."""

_RESULTS = {"accepted": 0, "denied": 2, "unsupported": 3}
_NO_POSITION, _CUSTOM, _ABOVE_SEA_INT = 0x7, 1, 5
_ALL_STREAMS, _FORCED, _NOTICE = 0, 21196.0, 5
# missions, floats, item_int, command_int, global targets, MAVLink 2
_CAPABILITIES = 0x1 | 0x2 | 0x4 | 0x8 | 0x100 | 0x2000
_VERSION = 4 << 24 | 5 << 16 | 255  # as an ArduPilot 4.5 release tells it


class _Command(NamedTuple):
    parameters: tuple[float, float, float, float]
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    frame: int


@dataclass(slots=True)
class Answerer:
    """One vehicle's answers on one link. Times are the link's own, ns: they only time transfers out."""

    system: int
    teller: Teller
    missions: MissionServer = field(default_factory=lambda: MissionServer(TAKEN))
    _notes_told: int = 0

    @property
    def vehicle(self) -> Vehicle:
        """Who answers."""
        return self.teller.sayings.vehicle

    def hear(self, frame: Frame, now: int) -> list[Said]:
        """One of `HEARD`, for this vehicle."""
        message, payload, station = frame.message, frame.payload, (frame.system, frame.component)
        if message in mission_server.TRAFFIC:
            return self._transfer(message, payload, station, now)
        if message in parameter_server.TRAFFIC:
            values, change = parameter_server.hear_parameters(message, payload, self.vehicle.settings, LIMITS)
            if change is not None:
                self.vehicle.settings[change[0]] = change[1]
            return [Said("PARAM_VALUE", one) for one in values]
        if message == LONG:
            p1, p2, p3, p4, latitude, longitude, z, number, _, _ = _read_long(payload)
            return self._command(number, _Command((p1, p2, p3, p4), latitude, longitude, z, ABOVE_HOME), station)
        if message == INT:
            p1, p2, p3, p4, x, y, z, command, _, _, above = _read_int(payload)
            return self._command(command, _Command((p1, p2, p3, p4), x / 1e7, y / 1e7, z, above), station)
        if message == SET_MODE:
            number, _, _ = _read_mode(payload)
            return self._acknowledged(11, self.vehicle.order(self.mode(number)), station)
        if message == DATA_STREAM:
            self._set_stream(*_read_stream(payload))
        else:
            self._aim(*_read_target(payload))
        return []

    def due(self, now: int) -> list[Said]:
        """What a transfer that has come to a halt needs; and what the vehicle has to tell people."""
        news = self.vehicle.notes[self._notes_told :]
        self._notes_told += len(news)
        told = [Said("STATUSTEXT", {"severity": _NOTICE, "text": note.encode()[:50]}) for note in news]
        return told + self.missions.due(now)

    def _transfer(self, message: int, payload: bytes, station: Station, now: int) -> list[Said]:
        mission = self.vehicle.mission
        said, change = self.missions.hear(message, payload, station, now, mission.items)
        if change is not None and change.items is not None:
            mission.replace(change.items)
        if change is not None and change.current is not None:
            self.vehicle.order(GoToItem(change.current))
            said.append(Said("MISSION_CURRENT", self.teller.sayings.now("MISSION_CURRENT") or {}))
        if change is not None and change.guided is not None:
            item = change.guided
            self.vehicle.order(self.place(item.latitude_deg, item.longitude_deg, item.altitude_m, item.frame))
        return said

    def _command(self, number: int, command: _Command, station: Station) -> list[Said]:
        if number in (SET_MESSAGE_INTERVAL, REQUEST_MESSAGE, *_OLD_REQUESTS):
            return self._about_messages(number, command, station)
        make = _COMMANDS.get(number)
        if make is None:
            return self._acknowledged(number, Answer("unsupported"), station)
        answer = Answer()
        for order in make(self, command):
            answer = self.vehicle.order(order)
            if answer.result != "accepted":
                break
        return self._acknowledged(number, answer, station)

    def _about_messages(self, number: int, command: _Command, station: Station) -> list[Said]:
        which = _OLD_REQUESTS.get(number, command.parameters[0])
        name = message_name(int(which)) if 0 <= which < 1 << 24 else ""
        values: dict[str, Any] | None
        try:
            if number == SET_MESSAGE_INTERVAL:
                self.teller.set_interval(name, self._wanted_interval(name, command.parameters[1]))
                return self._acknowledged(number, Answer(), station)
            if name == "AUTOPILOT_VERSION":
                values = _version(self.system)
            elif name == "MESSAGE_INTERVAL":
                values = self._interval(command.parameters[1])
            elif name == "PROTOCOL_VERSION":
                values = {"version": 200, "min_version": 100, "max_version": 200, **_NO_HASHES}
            else:
                values = self.teller.sayings.now(name)
        except KeyError:
            return self._acknowledged(number, Answer("unsupported"), station)
        acknowledged = self._acknowledged(number, Answer("accepted" if values else "denied"), station)
        return [*acknowledged, Said(name, values)] if values else acknowledged

    def _wanted_interval(self, name: str, microseconds: float) -> float | None:
        """-1: not at all; 0: as by default. Raises KeyError for a message that has no default."""
        if microseconds == 0.0:
            return 1.0 / DEFAULT_HZ[name]
        return microseconds / 1e6 if microseconds > 0.0 else None

    def _interval(self, number: float) -> dict[str, Any]:
        which = int(number) if 0 <= number < 1 << 16 else -1
        every = self.teller.interval_s(message_name(which))
        return {"message_id": which, "interval_us": -1 if every is None else round(every * 1e6)}

    def _set_stream(self, rate_hz: int, _: int, __: int, stream: int, is_started: int) -> None:
        names = (
            STREAMS.get(stream, ()) if stream != _ALL_STREAMS else [one for some in STREAMS.values() for one in some]
        )
        for name in names:
            self.teller.set_interval(name, 1.0 / rate_hz if is_started and rate_hz else None)

    def _aim(self, x: int, y: int, altitude_m: float, mask: int, _: int, __: int, frame: int) -> None:
        if mask & _NO_POSITION == 0:
            self.vehicle.order(self.place(x / 1e7, y / 1e7, altitude_m, frame))

    def mode(self, number: float) -> SetMode:
        """The order to enter a mode by its number; one that there is not is called by it."""
        named = {told: name for name, told in self.vehicle.modes.items()}
        return SetMode(named.get(int(number), f"{number:g}") if math.isfinite(number) else f"{number:g}")

    def place(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float, frame: int, radius_m: float | None = None
    ) -> GoTo:
        """A place on the wire as an order; what is no number means the present one."""
        now, home = self.vehicle.moment, self.vehicle.home
        above = home.geoid_separation_m if frame in (ABOVE_SEA, _ABOVE_SEA_INT) else home.height_m
        height = above + altitude_m if math.isfinite(altitude_m) else None
        latitude = math.radians(latitude_deg) if math.isfinite(latitude_deg) else now.latitude_rad
        longitude = math.radians(longitude_deg) if math.isfinite(longitude_deg) else now.longitude_rad
        return GoTo(latitude, longitude, height, radius_m)

    def _acknowledged(self, command: int, answer: Answer, station: Station) -> list[Said]:
        if answer.why:
            self.vehicle.notes.append(answer.why[:1].upper() + answer.why[1:])
        values = {
            "command": command,
            "result": _RESULTS[answer.result],
            "progress": 0,
            "result_param2": 0,
            "target_system": station[0],
            "target_component": station[1],
        }
        return [Said("COMMAND_ACK", values)]


def _version(system: int) -> dict[str, Any]:
    return {
        "capabilities": _CAPABILITIES,
        "flight_sw_version": _VERSION,
        **dict.fromkeys(("middleware_sw_version", "os_sw_version", "board_version", "vendor_id", "product_id"), 0),
        **{f"{part}_custom_version": [0] * 8 for part in ("flight", "middleware", "os")},
        "uid": system,
    }


def _in_mode(name: str) -> Callable[[Answerer, _Command], list[Order]]:
    return lambda answerer, command: [SetMode(name)]


def _arm(answerer: Answerer, command: _Command) -> list[Order]:
    first, second, _, _ = command.parameters
    return [Arm(first == 1.0, second == _FORCED)]


def _set_mode(answerer: Answerer, command: _Command) -> list[Order]:
    base, number, _, _ = command.parameters
    is_custom = math.isfinite(base) and int(base) & _CUSTOM == _CUSTOM
    return [answerer.mode(number) if is_custom else SetMode(f"{base:g}")]


def _take_off(answerer: Answerer, command: _Command) -> list[Order]:
    is_above_sea = command.frame in (ABOVE_SEA, _ABOVE_SEA_INT)
    return [TakeOff(command.altitude_m - (answerer.vehicle.home.altitude_msl_m if is_above_sea else 0.0))]


def _reposition(answerer: Answerer, command: _Command) -> list[Order]:
    speed, _, radius, _ = command.parameters
    place = (command.latitude_deg, command.longitude_deg, command.altitude_m)
    orders: list[Order] = [answerer.place(*place, command.frame, radius if abs(radius) >= 1.0 else None)]
    return [ChangeSpeed(speed), *orders] if speed > 0.0 else orders


def _pause(answerer: Answerer, command: _Command) -> list[Order]:
    return [SetMode("AUTO" if command.parameters[0] == 1.0 else "LOITER")]


def _go_to_item(answerer: Answerer, command: _Command) -> list[Order]:
    number = command.parameters[0]
    return [GoToItem(int(number) if math.isfinite(number) else -1)]


_COMMANDS: Mapping[int, Callable[[Answerer, _Command], list[Order]]] = {  # by MAV_CMD
    17: _in_mode("LOITER"),
    20: _in_mode("RTL"),
    21: _in_mode("LAND"),
    22: _take_off,
    176: _set_mode,
    178: lambda answerer, command: [ChangeSpeed(command.parameters[1])],
    191: lambda answerer, command: [GoAround(command.parameters[0])],
    192: _reposition,
    193: _pause,
    224: _go_to_item,
    300: _in_mode("AUTO"),
    400: _arm,
}
_OLD_REQUESTS = {410: 242, 519: 300, 520: 148}  # commands from before REQUEST_MESSAGE, and what they ask for
_NO_HASHES = {"spec_version_hash": [0] * 8, "library_version_hash": [0] * 8}
