"""All that the gateway can send on MAVLink links to vehicles, each only if it was asked for on the command line.

    --heartbeat       HEARTBEAT once a second to every peer that was heard in the last minute: type GCS, autopilot INVALID.
    --request-rates   to each vehicle, for what does not come often enough (see adapters/rate_client.py):
                      COMMAND_LONG MAV_CMD_SET_MESSAGE_INTERVAL for GLOBAL_POSITION_INT 5 Hz, GPS_RAW_INT 2 Hz,
                      ATTITUDE 10 Hz, VFR_HUD 2 Hz, SYSTEM_TIME 1 Hz, EXTENDED_SYS_STATE 1 Hz;
                      COMMAND_LONG MAV_CMD_REQUEST_MESSAGE for HOME_POSITION;
                      REQUEST_DATA_STREAM instead of the first, only to an autopilot that does not know it.
    --fetch-mission   to each vehicle, once, and again when its mission changes or it reboots (see adapters/mission_client.py):
                      MISSION_REQUEST_LIST, MISSION_REQUEST_INT for each item, MISSION_ACK.

We are system 254 or, where somebody has that number, the next free one down to 245, component 190 (a mission planner);
never 255, which can hold off a vehicle's ground-station failsafe. MAVLink 2, but MAVLink 1 to a peer that speaks nothing
else; with a key all is signed. What comes back of our own through a router is not heard. (Two more things can be sent:
the empty datagram of a `udpout` link, and what `--publish` publishes.)

Pure: frames and times in, frames out; no thread, no socket, no clock.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from adapters import Arrival, Source
from adapters.mavlink_frames import V1, V2, Frame, encode, fields, parse
from adapters.mission_client import (
    MISSION_CURRENT,
    MISSION_TRAFFIC,
    SECOND,
    Ask,
    MissionClient,
    target_system,
    tells_of_a_change,
)
from adapters.rate_client import COMMAND_ACK, RateClient, read_ack
from adapters.roles import INVALID_AUTOPILOT, is_vehicle
from adapters.signing import Signer, SigningGuard

COMPONENT = 190  # MAV_COMP_ID_MISSIONPLANNER
SYSTEMS = tuple(range(254, 244, -1))
LISTEN_FIRST_NS = 2 * SECOND  # so that whoever has our number on a link is heard before we take it
_HEARTBEAT_NS = SECOND
_GONE_NS = 60 * SECOND
_VEHICLES_AT_MOST = 256
_SENT_REMEMBERED = 256
_REBOOT_MS = 3000  # further back than any link's jitter
_WRAPS_MS = 2**32 - 600_000

HEARTBEAT, _read_heartbeat = fields("HEARTBEAT", "type", "autopilot")
_BOOT_TIMES = {30: slice(0, 4), 33: slice(0, 4), 2: slice(8, 12)}  # ATTITUDE, GLOBAL_POSITION_INT, SYSTEM_TIME
STATION_HEARTBEAT = {
    "type": 6, "autopilot": INVALID_AUTOPILOT, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3,
}  # fmt: skip


@dataclass(slots=True)
class _Peer:
    source: Source
    first_heard: int | None = None
    last_heard: int = 0
    speaks_version_2: bool = False
    heartbeat_due_at: int = 0
    sequence: int = 0


@dataclass(slots=True)
class _Vehicle:
    key: tuple[int, int, int]  # source, system, component
    rates: RateClient | None = None
    mission: MissionClient | None = None
    boot_ms: int = 0
    said: deque[bytes] = field(default_factory=lambda: deque(maxlen=64))  # what tells it from others of its number

    def has_rebooted(self, message: int, payload: bytes) -> bool:
        """Whether its time since boot has begun anew."""
        told = int.from_bytes(payload[_BOOT_TIMES[message]].ljust(4, b"\0"), "little")
        is_back = told < self.boot_ms - _REBOOT_MS
        rebooted = is_back and self.boot_ms < _WRAPS_MS
        self.boot_ms = told if is_back else max(self.boot_ms, told)
        return rebooted


class Manners:
    """What we send, and when, to the sources of a live session: `add` a source, `hear` what came, send what is `due`.

    With a key only frames that are signed with it are heeded. Bounded, whatever comes. `counters`: what was sent, by kind;
    `notes`: (level, text), what was asked and what came of it, to be told to a person once and then cleared by the caller.
    """

    def __init__(
        self,
        *,
        heartbeat: bool = False,
        request_rates: bool = False,
        fetch_mission: bool = False,
        key: bytes | None = None,
    ) -> None:
        self.counters: Counter[str] = Counter()
        self.notes: list[tuple[str, str]] = []
        self._heartbeat, self._request_rates, self._fetch_mission = heartbeat, request_rates, fetch_mission
        self._is_silent = not (heartbeat or request_rates or fetch_mission)
        self._heeded = _HEEDED if request_rates or fetch_mission else frozenset((HEARTBEAT,))
        self._signer = None if key is None else Signer(key)
        self._guard = None if key is None else SigningGuard(key, live=True)
        self._peers: dict[int, _Peer] = {}
        self._vehicles: dict[tuple[int, int, int], _Vehicle] = {}
        self._system: int | None = None  # ours, once taken
        self._taken: set[int] = set()  # numbers that others have, among those that could be ours
        self._sent: deque[bytes] = deque(maxlen=_SENT_REMEMBERED)

    def add(self, source: Source) -> None:
        """A source that is new; only MAVLink ones matter."""
        if source.kind == "mavlink" and not self._is_silent:
            self._peers[source.number] = _Peer(source)

    def hear(self, arrivals: Iterable[Arrival]) -> None:
        """What came in. Never raises, whatever the bytes."""
        if self._is_silent:
            return
        for arrival in arrivals:
            peer, data = self._peers.get(arrival.source), arrival.data
            if peer is None or len(data) < 8:
                continue
            if data[0] == V2 and len(data) >= 12:
                sender, sequence, message = (
                    (arrival.source, data[5], data[6]),
                    data[4],
                    int.from_bytes(data[7:10], "little"),
                )
                peer.speaks_version_2 = True
            elif data[0] == V1:
                sender, sequence, message = (arrival.source, data[3], data[4]), data[2], data[5]
            else:
                continue
            if sender[1] in _OURS and self._is_our_own(sender[1], data):
                continue
            peer.last_heard = arrival.received_at
            if peer.first_heard is None:
                peer.first_heard = arrival.received_at
            vehicle = self._vehicles.get(sender)
            if message in self._heeded:
                self._heed(sender, vehicle, message, arrival)
            if vehicle is not None and vehicle.rates is not None:
                vehicle.rates.hear(message, sequence)

    def due(self, now: int) -> list[tuple[int, bytes]]:
        """(source, frame) of all that is to be sent now; `now` is a stamp, ns since 1970 UTC."""
        if self._is_silent:
            return []
        frames: list[tuple[int, bytes]] = []
        for peer in self._peers.values():
            if self._is_there(peer, now) and now >= peer.heartbeat_due_at and self._heartbeat:
                peer.heartbeat_due_at = now + _HEARTBEAT_NS
                self._send(frames, peer, ("HEARTBEAT", STATION_HEARTBEAT), now)
        for vehicle in self._vehicles.values():
            number, system, component = vehicle.key
            for ask in self._asks(vehicle, now):
                values = {"target_system": system, "target_component": component, **ask[1]}
                self._send(frames, self._peers[number], (ask[0], values), now)
        return frames

    def _is_there(self, peer: _Peer, now: int) -> bool:
        """Whether a peer has been listened to for long enough, and is not gone."""
        return (
            peer.first_heard is not None
            and now - peer.first_heard >= LISTEN_FIRST_NS
            and now - peer.last_heard <= _GONE_NS
        )

    def _is_our_own(self, system: int, data: bytes) -> bool:
        """Whether this is one of our frames that a router brings back; somebody else with our number makes us take another."""
        if data in self._sent:
            return True
        self._taken.add(system)
        if system == self._system:
            self._system = None
            self.notes.append(("info", f"Somebody else is system {system}: we take another number."))
        return False

    def _heed(self, sender: tuple[int, int, int], vehicle: _Vehicle | None, message: int, arrival: Arrival) -> None:
        """A frame that can change what is to be sent."""
        frame, now = parse(arrival.data), arrival.received_at
        if frame is None or frame.verdict != "good" or frame.system == 0:
            return
        if self._guard is not None and self._guard.judge(arrival.data, arrival.source, now) is not None:
            return
        if message in MISSION_TRAFFIC:
            self._hear_mission(frame, vehicle, now)
        elif message == HEARTBEAT:
            kind, autopilot = _read_heartbeat(frame.payload)
            if vehicle is None and is_vehicle(kind, autopilot):
                self._meet(sender, now)
        elif vehicle is None:
            return
        elif message == COMMAND_ACK and vehicle.rates is not None:
            command, result, target = read_ack(frame.payload)
            if target in (0, self._system):
                vehicle.rates.hear_ack(command, result, now)
        elif message == MISSION_CURRENT and vehicle.mission is not None:
            if vehicle.mission.hear_current(frame.payload):
                vehicle.mission.want(now)
        elif message in _BOOT_TIMES:
            if message != _SYSTEM_TIME and vehicle.mission is not None:
                vehicle.said.append(frame.payload)
            if vehicle.has_rebooted(message, frame.payload):
                self._begin_anew(vehicle, now)

    def _meet(self, sender: tuple[int, int, int], now: int) -> None:
        if len(self._vehicles) >= _VEHICLES_AT_MOST:
            self.counters["heartbeats of vehicles too many to be asked"] += 1
            return
        vehicle = self._vehicles[sender] = _Vehicle(sender)
        self._begin_anew(vehicle, now)

    def _begin_anew(self, vehicle: _Vehicle, now: int) -> None:
        number, system, component = vehicle.key
        name = f"System {system} on {self._peers[number].source.origin}"
        if component != 1:
            name = f"Component {component} of s{name[1:]}"
        self._gather_notes(vehicle)
        vehicle.said.clear()
        vehicle.rates = RateClient(name, now) if self._request_rates else None
        vehicle.mission = MissionClient(name, now) if self._fetch_mission else None

    def _hear_mission(self, frame: Frame, sender: _Vehicle | None, now: int) -> None:
        """Mission traffic: an answer to us, or what others do with a vehicle, over whichever link it is heard."""
        target = target_system(frame.message, frame.payload)
        if target == self._system:
            if sender is not None and sender.mission is not None:
                sender.mission.hear(frame.message, frame.payload, now)
            return
        changed = sender is not None and tells_of_a_change(frame.message, frame.payload)
        for vehicle in self._vehicles.values():
            if vehicle.mission is not None and vehicle.key[1] in (frame.system, target):
                vehicle.mission.hear_others(now)
                if changed and vehicle.key[1] == frame.system:
                    vehicle.mission.want(now)

    def _asks(self, vehicle: _Vehicle, now: int) -> list[Ask]:
        if not self._is_there(self._peers[vehicle.key[0]], now):
            return []
        asks: list[Ask | None] = []
        if vehicle.rates is not None:
            asks.append(vehicle.rates.due(now))
        if vehicle.mission is not None:
            if vehicle.mission.is_ready(now) and self._is_read_elsewhere(vehicle, vehicle.mission):
                vehicle.mission.share(now)
            asks.append(vehicle.mission.due(now))
        self._gather_notes(vehicle)
        return [ask for ask in asks if ask is not None]

    def _is_read_elsewhere(self, vehicle: _Vehicle, mission: MissionClient) -> bool:
        """Whether the same vehicle is being asked, or was asked for this mission, over another link."""
        for other in self._vehicles.values():
            if other is vehicle or other.key[1:] != vehicle.key[1:] or other.mission is None:
                continue
            finished_at = other.mission.finished_at
            is_read = other.mission.is_active or (finished_at is not None and finished_at >= mission.wanted_since)
            if is_read and not set(vehicle.said).isdisjoint(other.said):
                return True
        return False

    def _gather_notes(self, vehicle: _Vehicle) -> None:
        for client in (vehicle.rates, vehicle.mission):
            if client is not None and client.notes:
                self.notes += client.notes
                client.notes.clear()

    def _send(self, frames: list[tuple[int, bytes]], peer: _Peer, ask: Ask, now: int) -> None:
        """Make the frame; nothing where every number that could be ours is somebody else's."""
        system = self._our_number()
        if system is None:
            self.counters["not sent, no free system number"] += 1
            return
        name, values = ask
        version = 2 if self._signer is not None or peer.speaks_version_2 else 1
        frame = encode(name, values, system=system, component=COMPONENT, sequence=peer.sequence, version=version)
        peer.sequence = peer.sequence + 1 & 255
        if self._signer is not None and self._guard is not None:
            frame = self._signer.sign(frame, peer.source.number & 255, now, self._guard.newest)
        self._sent.append(frame)
        self.counters[f"{name} sent"] += 1
        frames.append((peer.source.number, frame))

    def _our_number(self) -> int | None:
        if self._system is None:
            self._system = next((number for number in SYSTEMS if number not in self._taken), None)
            if self._system is None and not self.counters["not sent, no free system number"]:
                text = "Nothing is sent: every system number from 245 to 254 is somebody's on these links."
                self.notes.append(("warning", text))
        return self._system


_SYSTEM_TIME = 2
_OURS = frozenset(SYSTEMS)
_HEEDED = frozenset((HEARTBEAT, COMMAND_ACK, MISSION_CURRENT, *MISSION_TRAFFIC, *_BOOT_TIMES))
