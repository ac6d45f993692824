"""A fleet that talks: the telemetry of many vehicles over UDP, at an exact rate, with little work for the sender.

python -m bench.fleet PORT VEHICLES RATE SECONDS      prints, as JSON, how many datagrams were sent, and how late

Every datagram is one MAVLink 2 frame with its running sequence number, its time since boot and its right checksum; one
second of them is made at a time, in columns. Vehicles share senders as they would share a router: ten ports at most.
"""

from __future__ import annotations

import ctypes
import json
import math
import socket
import sys
import time
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import encode
from gateway.settings import DEMO_SITE

PEERS = 10
BEATS = 1000  # datagrams leave so often a second, each time those of one peer
_STRIDE = 128
_BOOTED_S = 100.0

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]

SLOW: dict[str, int] = {"HEARTBEAT": 1, "SYSTEM_TIME": 1, "GPS_RAW_INT": 5, "GLOBAL_POSITION_INT": 5}
"""Messages with a rate of their own, a second."""

REST = (
    *("SYS_STATUS", "RAW_IMU", "SCALED_IMU2", "SCALED_IMU3", "ATTITUDE", "VFR_HUD", "AHRS", "AHRS2"),
    *("LOCAL_POSITION_NED", "SERVO_OUTPUT_RAW", "RC_CHANNELS", "SCALED_PRESSURE", "NAV_CONTROLLER_OUTPUT"),
    *("POWER_STATUS", "MEMINFO", "WIND", "BATTERY_STATUS", "VIBRATION", "EKF_STATUS_REPORT"),
)
"""What fills the rate up, in equal shares, as an autopilot's streams do."""

_FIELDS: dict[str, dict[str, Any]] = {
    "HEARTBEAT": {"type": 1, "autopilot": 3, "base_mode": 217, "custom_mode": 10, "mavlink_version": 3},
    "SYSTEM_TIME": {"time_boot_ms": 1 << 30},
    "GPS_RAW_INT": {"fix_type": 3, "alt": 1_000_000, "alt_ellipsoid": 965_000, "h_acc": 1500, "v_acc": 2000},
    "GLOBAL_POSITION_INT": {"alt": 1_000_000, "vx": 0, "vy": 8000, "vz": 100, "hdg": 9000},
}  # of the others, and of other messages, each is some small number

_BOOT_AT = {"SYSTEM_TIME": 8} | dict.fromkeys(
    ("GLOBAL_POSITION_INT", "SCALED_IMU2", "SCALED_IMU3", "ATTITUDE", "LOCAL_POSITION_NED", "RC_CHANNELS", "SCALED_PRESSURE"), 0
)  # fmt: skip
_MICROSECONDS_AT = dict.fromkeys(("GPS_RAW_INT", "RAW_IMU", "SERVO_OUTPUT_RAW", "VIBRATION"), 0)
_PLACE_AT = {"GLOBAL_POSITION_INT": 4, "GPS_RAW_INT": 8}


@dataclass(frozen=True, slots=True)
class _Kind:
    """All rows of one message in the table of a second."""

    name: str
    rows: Integers
    vehicles: Integers
    size: int  # of the frame
    extra: int


class Fleet:
    """One second's datagrams in sending order, made anew for each second. Systems are numbered from 1."""

    def __init__(self, vehicles: int, rate: int, positions_hz: int = 5) -> None:
        self.vehicles, self.rate, self.began = vehicles, rate, time.time()
        self.peers = min(PEERS, vehicles)
        names, owners = self._order(positions_hz)
        self.table: Bytes = np.zeros((rate, _STRIDE), np.uint8)
        self.sizes: Integers = np.zeros(rate, np.int64)
        self._owners = owners
        self._ranks = _ranks(owners, vehicles)
        self._counts = np.bincount(owners, minlength=vehicles)
        self._sequence = np.zeros(vehicles, np.int64)
        self._kinds = [self._kind(name, np.flatnonzero(names == name)) for name in sorted(set(names.tolist()))]

    def _order(self, positions_hz: int) -> tuple[NDArray[np.str_], Integers]:
        """The message and the vehicle of each row: beats of one peer, in each beat its vehicles in turn."""
        each = self.rate // self.vehicles
        slow = {**SLOW, "GLOBAL_POSITION_INT": positions_hz}
        left = each - sum(slow.values())
        if left < 0 or self.rate % (self.vehicles * self.peers) or self.rate % BEATS:
            raise ValueError(f"{self.vehicles} vehicles cannot share {self.rate} messages/s evenly")
        rest = [name for name, _ in zip(cycle(REST), range(left), strict=False)]
        mix = sorted(
            [((turn + 0.5) / often, name) for name, often in slow.items() for turn in range(often)]
            + [((turn + 0.5) / max(left, 1), name) for turn, name in enumerate(rest)]
        )
        streams = []
        for peer in range(self.peers):
            members = range(peer, self.vehicles, self.peers)
            streams.append([(name, vehicle) for _, name in mix for vehicle in members])
        a_beat, rows = self.rate // BEATS, []
        places = [0] * self.peers
        for beat in range(BEATS):
            peer = beat % self.peers
            rows += streams[peer][places[peer] : places[peer] + a_beat]
            places[peer] += a_beat
        return np.array([name for name, _ in rows]), np.array([vehicle for _, vehicle in rows])

    def _kind(self, name: str, rows: Integers) -> _Kind:
        frame = encode(name, _values(name), system=1)
        owners = self._owners[rows]
        self.table[rows, : len(frame)] = np.frombuffer(frame, np.uint8)
        self.table[rows, 5] = owners + 1
        self.sizes[rows] = len(frame)
        return _Kind(name, rows, owners, len(frame), _extra(frame))

    def second(self, number: int) -> None:
        """Make the datagrams of this second since the start."""
        self.table[:, 4] = (self._sequence[self._owners] + self._ranks) & 255
        self._sequence += self._counts
        for kind in self._kinds:
            seconds = number + kind.rows / self.rate
            part = self.table[kind.rows, : kind.size]
            self._fill(part, kind, seconds)
            crc = _crc(part[:, 1 : kind.size - 2], kind.extra)
            part[:, kind.size - 2], part[:, kind.size - 1] = crc & 255, crc >> 8
            self.table[kind.rows, : kind.size] = part

    def _fill(self, part: Bytes, kind: _Kind, seconds: NDArray[np.float64]) -> None:
        since_boot = seconds + _BOOTED_S
        if kind.name in _BOOT_AT:
            _put(part, 10 + _BOOT_AT[kind.name], (since_boot * 1e3).astype("<u4"))
        if kind.name in _MICROSECONDS_AT:
            _put(part, 10 + _MICROSECONDS_AT[kind.name], (since_boot * 1e6).astype("<u8"))
        if kind.name == "SYSTEM_TIME":
            _put(part, 10, ((self.began + seconds) * 1e6).astype("<u8"))
        if kind.name in _PLACE_AT:
            # Side by side 2 km apart, eastwards at 80 m/s; who would be gone begins again in the west.
            runway, rows = DEMO_SITE.runway, int(math.sqrt(self.vehicles)) + 1
            north_m = 2000.0 * (kind.vehicles % rows - rows / 2)
            east_m = 2000.0 * (kind.vehicles // rows) - 30_000.0 + 80.0 * seconds
            latitude = math.degrees(runway.latitude_rad) + np.degrees(north_m / 6.37e6)
            longitude = math.degrees(runway.longitude_rad) + np.degrees(east_m / 6.37e6 / math.cos(runway.latitude_rad))
            at = 10 + _PLACE_AT[kind.name]
            _put(part, at, (latitude * 1e7).astype("<i4"))
            _put(part, at + 4, (longitude * 1e7).astype("<i4"))


def _values(name: str) -> dict[str, Any]:
    """Some value for every field of a message; none is 0 at the end, so that every frame of it has the same length."""
    message = next(one for one in dialect.mavlink_map.values() if one.msgname == name)
    lengths = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    values: dict[str, Any] = {}
    for field, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        value = _FIELDS.get(name, {}).get(field, 0.01 if kind in ("float", "double") else 7)
        values[field] = [value] * lengths[field] if lengths[field] else value
    return values


def _ranks(owners: Integers, vehicles: int) -> Integers:
    """The how-manieth of its vehicle each row is."""
    ranks = np.zeros(len(owners), np.int64)
    for vehicle in range(vehicles):
        rows = np.flatnonzero(owners == vehicle)
        ranks[rows] = np.arange(len(rows))
    return ranks


def _put(part: Bytes, at: int, values: NDArray[Any]) -> None:
    part[:, at : at + values.itemsize] = values[:, None].view(np.uint8)


def _word(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0x8408 if byte & 1 else 0)
    return byte


_WORDS = np.array([_word(byte) for byte in range(256)], np.uint16)


def _crc(body: Bytes, extra: int) -> NDArray[np.uint16]:
    """CRC-16/MCRF4XX of every row, then of the message's extra byte."""
    crc = np.full(len(body), 0xFFFF, np.uint16)
    columns = [*np.ascontiguousarray(body.T), np.full(len(body), extra, np.uint8)]
    for column in columns:
        crc = (crc >> 8) ^ _WORDS[(crc ^ column) & 255]
    return crc


def _extra(frame: bytes) -> int:
    body, crc = np.frombuffer(frame[1:-2], np.uint8)[None], int.from_bytes(frame[-2:], "little")
    return next(extra for extra in range(256) if int(_crc(body, extra)[0]) == crc)


def send(fleet: Fleet, port: int, seconds: int) -> dict[str, float]:
    """Send for so many seconds to a port of this machine; what was sent, and by how much the slowest beat was late."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(fleet.peers)]
    for one in sockets:
        one.connect(("127.0.0.1", port))
    many = ctypes.CDLL(None, use_errno=True).sendmmsg
    # struct iovec and struct mmsghdr of a 64-bit Linux, word by word
    vectors, messages = np.zeros((fleet.rate, 2), np.uint64), np.zeros((fleet.rate, 8), np.uint64)
    vectors[:, 0], vectors[:, 1] = fleet.table.ctypes.data + np.arange(fleet.rate) * _STRIDE, fleet.sizes
    messages[:, 2], messages[:, 3] = vectors.ctypes.data + np.arange(fleet.rate) * 16, 1
    sent, late_s, a_beat = 0, 0.0, fleet.rate // BEATS
    began = time.monotonic() + 0.1
    for second in range(seconds):
        fleet.second(second)
        for beat in range(BEATS):
            wait_s = began + second + beat / BEATS - time.monotonic()
            if wait_s > 0:
                time.sleep(wait_s)
            late_s = max(late_s, -wait_s)
            first, left = beat * a_beat, a_beat
            while left:
                at = messages.ctypes.data + first * 64
                done = many(sockets[beat % fleet.peers].fileno(), ctypes.c_void_p(at), left, 0)
                if done < 0:
                    raise OSError(ctypes.get_errno(), "sendmmsg")
                first, left, sent = first + done, left - done, sent + done
    return {"sent": sent, "latest_beat_s": late_s, "cpu_s": time.process_time()}


if __name__ == "__main__":
    _port, _vehicles, _rate, _seconds = (int(word) for word in sys.argv[1:5])
    print(json.dumps(send(Fleet(_vehicles, _rate), _port, _seconds)))
