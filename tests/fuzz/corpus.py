"""What the fuzzer begins with: valid frames of every message, radar datagrams, told lines, and a file of every kind."""

from __future__ import annotations

import io
import json
import math
import random
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from fastcrc.crc16 import mcrf4xx

from adapters.epoch import SessionEpoch
from adapters.landing_radar import MODES, STATES, Header, Plot, Status, encode
from adapters.mavlink import MavlinkObserver
from adapters.mavlink_frames import CRC_WORDS, V1, V2, Frame, definitions, parse
from adapters.mission_client import MISSION_TRAFFIC
from adapters.pcap import PcapWriter
from adapters.rate_client import COMMAND_ACK
from adapters.signing import sign, timestamp_at
from adapters.tlog import TlogReader, TlogWriter
from adapters.told import encode_plan
from gateway.observation import PlanPoint
from gateway.settings import DEMO_SITE

SECOND = 10**9
BEGIN = 1_790_000_000 * SECOND
KEY = bytes(range(32))  # of MAVLink's signatures
RADAR_KEYS = {7: b"the key of radar 7"}
EXCERPTS = Path(__file__).parents[1] / "data"
WANTED = sorted({*MavlinkObserver(SessionEpoch()).wanted, *MISSION_TRAFFIC, COMMAND_ACK})
_RUNWAY = replace(
    DEMO_SITE.runway,
    latitude_rad=math.radians(-35.363261),
    longitude_rad=math.radians(149.16523),
    height_m=604.0,
    landing_compass_rad=math.radians(353.0),
    geoid_separation_m=20.0,
)
SITE = replace(  # where the excerpts were recorded
    DEMO_SITE, runway=_RUNWAY, radars=tuple(replace(DEMO_SITE.radars[0], number=number) for number in (1, 2, 7))
)
EXTRA: dict[int, int] = {number: message.crc_extra for number, message in definitions().items()}
SIZE: dict[int, int] = {number: message.unpacker.size for number, message in definitions().items()}


def frame_bytes(
    message: int,
    payload: bytes,
    *,
    system: int = 1,
    component: int = 1,
    sequence: int = 0,
    version: int = 2,
    flags: int = 0,
) -> bytes:
    """A frame with a right checksum (of an unknown id: with the extra 0). Flag 1 takes a signature that is not there."""
    if version == 2:
        head = bytes((V2, len(payload), flags, 0, sequence, system, component)) + message.to_bytes(3, "little")
    else:
        head = bytes((V1, len(payload), sequence, system, component, message & 255))
    body = head + payload
    crc = mcrf4xx(body[1:])
    return body + (CRC_WORDS[crc & 255 ^ EXTRA.get(message, 0)] ^ crc >> 8).to_bytes(2, "little")


def telemetry() -> list[tuple[int, bytes]]:
    """Stamp and frame of a real flight's end."""
    with (EXCERPTS / "sitl-landing-excerpt.tlog").open("rb") as file:
        return list(TlogReader(file))


def frames(source: random.Random) -> list[Frame]:
    """Frames to mutate: those of a real flight, and every message that pymavlink knows, those that are read many times."""
    real = [frame for _, data in telemetry() if (frame := parse(data)) is not None and frame.verdict == "good"]
    made = []
    for message, size in SIZE.items():
        for _ in range(40 if message in WANTED else 1):
            payload = source.randbytes(size) if source.random() < 0.5 else bytes(size)
            made.append(parse(frame_bytes(message, payload)))
    return source.sample(real, 2000) + [frame for frame in made if frame is not None]


def radar_datagrams(source: random.Random) -> list[bytes]:
    """Plots and status of radars with and without a key."""
    found = []
    for sequence in range(60):
        radar = 7 if sequence % 3 == 0 else 1 + sequence % 3
        time = BEGIN + sequence * SECOND // 5
        plots = [
            Plot(
                source.randrange(6), time - 50_000_000, source.uniform(0, 6e4), source.uniform(-40, 40),
                source.uniform(0, 8), source.uniform(-99, 99), 20.0, 15.0, 0.001, 0.001,
            )
            for _ in range(source.randrange(5))
        ]  # fmt: skip
        key = RADAR_KEYS.get(radar)
        found.append(encode(Header("plots", radar, sequence, time), plots, key=key))
        state = Status(source.choice(STATES), source.choice(MODES), 0.2, -35.36, 149.16, 600.0, 173.0)
        found.append(encode(Header("status", radar, 1000 + sequence, time), [state], key=key))
    return found


def told_lines() -> list[bytes]:
    """Plans as people tell them."""
    points = [PlanPoint(number, "waypoint", -0.617, 2.603 + number / 1e4, None, 50.0) for number in range(4)]
    return [
        encode_plan(aircraft, points[:count]) for aircraft in ("*", "mavlink:1", "icao:000001") for count in (0, 1, 4)
    ]


@dataclass(frozen=True)
class Seed:
    """A whole file to mutate, and what it is."""

    name: str
    content: bytes


def files(source: random.Random) -> list[Seed]:
    """One file of each kind that can be replayed or told along, small enough to be read thousands of times."""
    flight = telemetry()
    some = flight[:1500]
    with_radar = flight[::8]
    dataflash = (EXCERPTS / "sitl-landing-excerpt.BIN").read_bytes()
    return [
        Seed("flight.tlog", _tlog(some)),
        Seed("signed.tlog", _tlog(_signed(some[:400]))),
        Seed("every.tlog", _tlog(_of_every_message(source))),
        Seed("landing.pcap", _pcap(_with_radar(with_radar, source))),
        Seed("landing.pcapng", _pcapng(_with_radar(with_radar, source))),
        Seed("flight.BIN", dataflash[:200_000]),
        Seed("flight.ulg", ulog()),
        Seed("mission.plan", plan()),
        Seed("mission.waypoints", WAYPOINTS),
    ]


def _tlog(records: list[tuple[int, bytes]]) -> bytes:
    sink = io.BytesIO()
    writer = TlogWriter(sink)
    for stamp, frame in records:
        writer.write(stamp, frame)
    return sink.getvalue()


def _signed(records: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    return [(stamp, sign(frame, KEY, 0, timestamp_at(stamp) + place)) for place, (stamp, frame) in enumerate(records)]


def _of_every_message(source: random.Random) -> list[tuple[int, bytes]]:
    made = [(BEGIN, frame_bytes(0, bytes((0, 0, 0, 0, 1, 3, 0, 4, 3))))]
    for place, message in enumerate(SIZE):
        version = 1 if message < 256 and place % 3 == 0 else 2
        made.append(
            (BEGIN + place * 10_000_000, frame_bytes(message, source.randbytes(SIZE[message]), version=version))
        )
    return made


Datagrams = list[tuple[int, bytes, str]]


def _with_radar(records: list[tuple[int, bytes]], source: random.Random) -> Datagrams:
    told = [(stamp, frame, "10.0.0.1:14550") for stamp, frame in records]
    begin = records[0][0]
    told += [
        (begin + place * SECOND // 10, data, "10.0.0.2:5000") for place, data in enumerate(radar_datagrams(source))
    ]
    return sorted(told, key=lambda one: one[0])


def _pcap(datagrams: Datagrams) -> bytes:
    sink = io.BytesIO()
    writer = PcapWriter(sink)
    for stamp, data, peer in datagrams:
        writer.write(stamp, data, peer)
    return sink.getvalue()


def _pcapng(datagrams: Datagrams) -> bytes:
    """Of packets as our own .pcap has them."""
    blocks = [_block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))]
    blocks.append(_block(1, struct.pack("<HHI", 101, 0, 65535) + struct.pack("<HHB3xHH", 9, 1, 6, 0, 0)))
    for stamp, data, peer in datagrams:
        packet = _pcap([(stamp, data, peer)])[40:]
        ticks = stamp // 1000
        head = struct.pack("<IIIII", 0, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet))
        blocks.append(_block(6, head + packet + bytes(-len(packet) % 4)))
    return b"".join(blocks)


def _block(kind: int, body: bytes) -> bytes:
    size = struct.pack("<I", len(body) + 12)
    return struct.pack("<I", kind) + size + body + size


_TOPICS: dict[str, tuple[str, Callable[[int], bytes]]] = {
    "vehicle_status": (
        "uint64_t timestamp;uint8_t arming_state;uint8_t nav_state;uint8_t system_type;uint8_t system_id;uint8_t component_id;",
        lambda at: struct.pack("<QBBBBB", at, 2, 3, 1, 1, 1),
    ),
    "vehicle_gps_position": (
        "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;int32_t alt_ellipsoid;"
        "float eph;float epv;uint8_t fix_type;uint8_t satellites_used;",
        lambda at: struct.pack(
            "<QQiiiiffBB", at, BEGIN // 1000 + at, -353632610, 1491652300, 584000, 604000, 1.0, 1.5, 3, 9
        ),
    ),
    "vehicle_global_position": (
        "uint64_t timestamp;double lat;double lon;float alt;",
        lambda at: struct.pack("<Qddf", at, -35.36, 149.16 + at / 1e12, 600.0),
    ),
    "vehicle_attitude": ("uint64_t timestamp;float[4] q;", lambda at: struct.pack("<Qffff", at, 1, 0, 0, 0)),
    "wind": (
        "uint64_t timestamp;float windspeed_north;float windspeed_east;",
        lambda at: struct.pack("<Qff", at, 3.0, -2.0),
    ),
}


def ulog() -> bytes:
    """A short .ulg of the topics that matter most."""
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    for number, (name, (columns, _)) in enumerate(_TOPICS.items()):
        parts.insert(1 + number, _ulog_message("F", f"{name}:{columns}".encode()))
    parts += [_ulog_message("A", struct.pack("<BH", 0, number) + name.encode()) for number, name in enumerate(_TOPICS)]
    for step in range(60):
        for number, (_, entry) in enumerate(_TOPICS.values()):
            parts.append(_ulog_message("D", struct.pack("<H", number) + entry(step * 200_000)))
    return b"".join(parts)


def _ulog_message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def plan() -> bytes:
    """A .plan with an item of each kind that is understood."""

    def simple(latitude: float) -> dict[str, object]:
        return {
            "type": "SimpleItem", "command": 16, "frame": 3, "params": [0, 0, 0, None, latitude, 149.16, 50],
        }  # fmt: skip

    transects = {"type": "ComplexItem", "TransectStyleComplexItem": {"Items": [simple(-35.37), simple(-35.38)]}}
    landing = {
        "type": "ComplexItem", "complexItemType": "fwLandingPattern", "altitudesAreRelative": True,
        "landingApproachCoordinate": [-35.34, 149.16, 60], "landCoordinate": [-35.36, 149.16, 0],
    }  # fmt: skip
    items = [simple(-35.36), transects, landing]
    mission = {"firmwareType": 3, "plannedHomePosition": [-35.36, 149.16, 584], "items": items}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission}, indent=1).encode()


WAYPOINTS = b"QGC WPL 110\n" + b"".join(
    b"%d\t0\t3\t16\t0\t0\t0\t0\t-35.36\t149.%d\t50\t1\n" % (number, 16 + number) for number in range(8)
)
