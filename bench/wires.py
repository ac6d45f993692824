"""Reading MAVLink: whole files as columns and live decoding, beside pymavlink's parser and mavlogfile, turn by turn.

python -m bench.wires MESSAGES RUNS        prints one JSON object

The recording is made here: MAVLink 2 messages of three vehicles in the mix in which SITL sends them, with values small
enough that zeros are cut as they are in real streams. What is measured, always the whole recording, in CPU time of one process:

    pymavlink       MAVLink(None).parse_char(frame) on one frame a call: its fastest way that checks checksums and resynchronises
                    (parse_buffer, and larger pieces, take longer: its buffer is cut again for every frame)
    mavlogfile      mavutil.mavlink_connection(file).recv_msg() to the end
    columns         adapters.columns.read_columns(file)
    live            datagrams of one frame each, TURN of them at a time, as a receiving thread hands them over: frames found and
                    checksums checked by `take`, fields unpacked by `fields`, as intake and decoder do where much comes in;
                    all fields of all messages, or those that the gateway reads
    one by one      the same with FrameScanner.feed_datagram, parse and `fields`, as they do where little comes in
"""

from __future__ import annotations

import gc
import json
import os
import random
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bench.measure import Figure, output

MESSAGES = 1_000_000
TURN = 1_000  # datagrams: 20 ms of 50 000 a second
START_US = 1_767_225_600_000_000

# How many of each in a thousand: SITL with three planes, positions at 5 Hz (ArduPilot 4.7).
MIX = {
    **{"GLOBAL_POSITION_INT": 116, "SIM_STATE": 116, "ATTITUDE": 93, "VFR_HUD": 93, "GPS_RAW_INT": 46, "WIND": 46},
    **{"NAV_CONTROLLER_OUTPUT": 43, "RAW_IMU": 40, "HEARTBEAT": 23, "AHRS": 23, "SYS_STATUS": 23, "POWER_STATUS": 23},
    **{"MEMINFO": 23, "MISSION_CURRENT": 23, "RC_CHANNELS": 23, "SCALED_IMU2": 23, "SCALED_PRESSURE": 23},
    **{"SYSTEM_TIME": 23, "TERRAIN_REPORT": 23, "VIBRATION": 23, "BATTERY_STATUS": 23, "EKF_STATUS_REPORT": 23},
    **{"AHRS2": 23, "POSITION_TARGET_GLOBAL_INT": 22, "SERVO_OUTPUT_RAW": 22, "PARAM_VALUE": 3, "STATUSTEXT": 2},
}
# The fields of these messages that the gateway reads; of other messages in the mix it reads none.
WANTED = {
    "HEARTBEAT": ("custom_mode", "type", "autopilot", "base_mode"),
    "SYSTEM_TIME": ("time_unix_usec", "time_boot_ms"),
    "GPS_RAW_INT": ("time_usec", "lat", "lon", "alt", "fix_type", "alt_ellipsoid", "h_acc", "v_acc", "vel_acc"),
    "SCALED_IMU2": ("time_boot_ms", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"),
    "RAW_IMU": ("time_usec", "xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"),
    "SCALED_PRESSURE": ("time_boot_ms", "press_abs", "temperature"),
    "ATTITUDE": ("time_boot_ms", "roll", "pitch", "yaw"),
    "GLOBAL_POSITION_INT": ("time_boot_ms", "lat", "lon", "alt", "vx", "vy", "vz", "hdg"),
    "VFR_HUD": ("airspeed", "groundspeed"),
    "WIND": ("direction", "speed", "speed_z"),
    "SIM_STATE": ("lat", "lon", "alt", "vn", "ve", "vd", "lat_int", "lon_int"),
    "MISSION_CURRENT": ("seq", "total"),
}
SENDERS = ((1, 1), (2, 1), (3, 1))


def wires(runs: int, messages: int = MESSAGES) -> list[Figure]:
    """Messages a second, and how many times those of pymavlink and mavlogfile, from turns of one process."""
    told = json.loads(output([sys.executable, "-m", "bench.wires", str(messages), str(runs)]))
    figures = [Figure(f"wires, {name}", "1/s", tuple(messages / one for one in told[name])) for name in told]
    for name, peer, at_least in RATIOS:
        ratios = tuple(slow / fast for slow, fast in zip(told[peer], told[name], strict=True))
        figures.append(Figure(f"wires, {name} / {peer}", "", ratios, at_least=at_least))
    return figures


COLUMNS, PYMAVLINK, MAVLOGFILE = "file to columns", "pymavlink's parse", "mavlogfile"
LIVE_ALL, LIVE_WANTED = "live, all ids", "live, wanted ids"
RATIOS: tuple[tuple[str, str, float | None], ...] = (
    (COLUMNS, PYMAVLINK, 12.0),
    (COLUMNS, MAVLOGFILE, 25.0),
    (LIVE_ALL, PYMAVLINK, 6.0),
    (LIVE_WANTED, PYMAVLINK, 15.0),
    ("one by one, all ids", PYMAVLINK, None),
    ("one by one, wanted ids", PYMAVLINK, None),
)


def write_recording(path: Path, messages: int, seed: int = 1) -> None:
    """A .tlog of so many messages. Values are walks of small steps, so that frames are as long as those of a flight."""
    from adapters.mavlink_frames import FrameEncoder

    chance = random.Random(seed)
    encoders = [FrameEncoder(system, component) for system, component in SENDERS]
    values = [{name: _first_values(name, chance) for name in MIX} for _ in SENDERS]
    names = chance.choices(list(MIX), list(MIX.values()), k=messages)
    pool = 40_000  # made once; beyond that frames come again with other stamps and numbers
    made: list[bytes] = []
    with path.open("wb") as file:
        for place, name in enumerate(names[:pool]):
            sender = place % len(SENDERS)
            _walk(values[sender][name], place, chance)
            made.append(encoders[sender].encode(name, **values[sender][name]))
        for place in range(messages):
            frame = made[place % len(made)]
            file.write((START_US + 100 * place).to_bytes(8, "big") + frame)


def _first_values(name: str, chance: random.Random) -> dict[str, Any]:
    from pymavlink.dialects.v20 import all as dialect

    message = next(one for one in dialect.mavlink_map.values() if one.msgname == name)
    repeats = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    first: dict[str, Any] = {}
    for one, kind in zip(message.fieldnames, message.fieldtypes, strict=True):
        if kind == "char":
            first[one] = b"EK3 active"
        elif repeats[one]:
            first[one] = [chance.randrange(100) for _ in range(repeats[one])]
        else:
            first[one] = chance.random() if kind in ("float", "double") else chance.randrange(100)
    return first


def _walk(values: dict[str, Any], place: int, chance: random.Random) -> None:
    for name, value in values.items():
        if name.startswith("time_"):
            values[name] = place
        elif isinstance(value, float):
            values[name] = value + chance.gauss(0.0, 0.1)
        elif isinstance(value, int):
            values[name] = min(max(value + chance.randint(-2, 2), 0), 120)


def _by_pymavlink(frames: Sequence[bytes]) -> int:
    from pymavlink.dialects.v20 import all as dialect

    link = dialect.MAVLink(None)
    parse = link.parse_char
    return sum(parse(frame) is not None for frame in frames)


def _by_mavlogfile(path: Path) -> int:
    from pymavlink import mavutil

    log, count = mavutil.mavlink_connection(str(path), dialect="all"), 0
    while log.recv_msg() is not None:
        count += 1
    log.close()
    return count


def _readers(wanted: dict[str, tuple[str, ...]] | None) -> dict[int, Callable[[bytes], tuple[Any, ...]]]:
    from pymavlink.dialects.v20 import all as dialect

    from adapters.mavlink_frames import fields

    chosen = wanted or {one.msgname: tuple(one.ordered_fieldnames) for one in dialect.mavlink_map.values()}
    return dict(fields(name, *some) for name, some in chosen.items())


def _in_turns(frames: Sequence[bytes], chosen: dict[str, tuple[str, ...]] | None) -> int:
    from adapters.frame_batches import NO_HEAD, heads_of, payload_of, places_of, wanted

    readers, count = _readers(chosen), 0
    which = wanted(readers)
    for at in range(0, len(frames), TURN):
        turn = frames[at : at + TURN]
        heads = heads_of(turn)
        count += int((heads != NO_HEAD).sum())
        places = places_of(heads, which).nonzero()[0]
        for place, message in zip(places.tolist(), (heads[places] >> 24).tolist(), strict=True):
            readers[message](payload_of(turn[place], message))
    return count


def _one_by_one(frames: Sequence[bytes], wanted: dict[str, tuple[str, ...]] | None) -> int:
    from adapters.mavlink_frames import FrameScanner, parse

    readers, scanner, count = _readers(wanted), FrameScanner(), 0
    for datagram in frames:
        for frame in scanner.feed_datagram(datagram):
            taken = parse(frame)
            if taken is not None and taken.verdict == "good":
                count += 1
                read = readers.get(taken.message)
                if read is not None:
                    read(taken.payload)
    return count


def main() -> None:
    """Measure in this process, turn by turn, each way once a turn."""
    os.environ["MAVLINK20"] = "1"
    gc.set_threshold(20_000, 10, 10)  # as `talkdown` runs; to pymavlink's good too
    from adapters.columns import read_columns
    from adapters.tlog import TlogReader

    messages, runs = int(sys.argv[1]), int(sys.argv[2])
    with tempfile.TemporaryDirectory(prefix="talkdown-bench-") as folder:
        path = Path(folder) / "mixed.tlog"
        write_recording(path, messages)
        with path.open("rb") as file:
            frames = [frame for _, frame in TlogReader(file)]
        ways: dict[str, Callable[[], int]] = {
            COLUMNS: lambda: sum(map(len, read_columns(path).messages.values())),
            PYMAVLINK: lambda: _by_pymavlink(frames),
            LIVE_ALL: lambda: _in_turns(frames, None),
            LIVE_WANTED: lambda: _in_turns(frames, WANTED),
            "one by one, all ids": lambda: _one_by_one(frames, None),
            "one by one, wanted ids": lambda: _one_by_one(frames, WANTED),
            MAVLOGFILE: lambda: _by_mavlogfile(path),
        }
        told: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(runs):
            for name, way in ways.items():
                began = time.process_time()
                count = way()
                told[name].append(time.process_time() - began)
                if count != messages:
                    raise SystemExit(f"{name} read {count} of {messages} messages")
                print(f"{name}: {messages / told[name][-1]:.0f} messages/s", file=sys.stderr)
    print(json.dumps(told))


if __name__ == "__main__":
    main()
