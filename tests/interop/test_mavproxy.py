"""MAVProxy stands between a vehicle and us, as it does in the field."""

from __future__ import annotations

import random
import socket
import subprocess
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import FrameEncoder, parse
from gateway.runtime.links import open_link
from gateway.runtime.loop import run_live
from gateway.runtime.setup import Place, Setup
from gateway.runtime.urls import Url

Find = Callable[[str], list[str]]
Child = Callable[..., "subprocess.Popen[str]"]

HEARTBEAT = {"type": 2, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
KINDS = [
    *("HEARTBEAT", "SYSTEM_TIME", "GPS_RAW_INT", "GLOBAL_POSITION_INT", "GLOBAL_POSITION_INT_COV", "ATTITUDE"),
    *("ATTITUDE_QUATERNION", "RAW_IMU", "SCALED_IMU", "HIGHRES_IMU", "VFR_HUD", "WIND", "HOME_POSITION"),
    *("EXTENDED_SYS_STATE", "MISSION_CURRENT", "UTM_GLOBAL_POSITION", "ADSB_VEHICLE", "OPEN_DRONE_ID_LOCATION"),
    *("HIGH_LATENCY2", "SCALED_PRESSURE", "SIM_STATE", "NAV_CONTROLLER_OUTPUT"),
]
FRAMES = 1500


def _filled(name: str, chance: random.Random) -> dict[str, Any]:
    """Some value for each field of a message."""
    (message,) = [one for one in dialect.mavlink_map.values() if one.msgname == name]
    values: dict[str, Any] = {}
    for field, kind, length in zip(message.fieldnames, message.fieldtypes, _lengths(message), strict=True):
        if kind == "char":
            values[field] = b"TEST"
        else:
            numbers = [chance.randrange(100) for _ in range(max(length, 1))]
            values[field] = numbers if length else numbers[0]
    return values


def _lengths(message: Any) -> list[int]:
    by_name = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    return [by_name[name] for name in message.fieldnames]


class Vehicle(threading.Thread):
    """Says hello until somebody hears it, then one frame after the other of every kind; `sent` are those."""

    def __init__(self, port: int) -> None:
        super().__init__(daemon=True)
        self.is_heard, self.stop, self.is_done = threading.Event(), threading.Event(), threading.Event()
        self.sent: list[bytes] = []
        self._port = port

    def run(self) -> None:
        chance, encoder = random.Random(1), FrameEncoder(1, 1)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            address = ("127.0.0.1", self._port)
            while not self.is_heard.wait(0.1) and not self.stop.is_set():
                wire.sendto(encoder.encode("HEARTBEAT", **HEARTBEAT), address)
            for number in range(FRAMES):
                if self.stop.is_set():
                    break
                name = KINDS[number % len(KINDS)]
                frame = encoder.encode(name, **(HEARTBEAT if name == "HEARTBEAT" else _filled(name, chance)))
                wire.sendto(frame, address)
                self.sent.append(frame)
                self.stop.wait(0.001)
        self.is_done.set()


def test_everything_that_mavproxy_forwards_arrives_is_recorded_and_decodes(
    program: Find, child: Child, free_port: int, place: Place, tmp_path: Path
) -> None:
    mavproxy = program("mavproxy.py")
    link = open_link(Url("udpin", "127.0.0.1", 0))
    vehicle = Vehicle(free_port)
    ends = f"--master=udpin:127.0.0.1:{free_port}", f"--out=udpout:127.0.0.1:{link.url.port}"
    child(*mavproxy, *ends, "--non-interactive", "--nowait", f"--state-basedir={tmp_path}", cwd=tmp_path)
    vehicle.start()
    waited = [0]

    def is_over() -> str | None:
        if vehicle.is_done.is_set():
            waited[0] += 1
        return "the test" if waited[0] > 100 else None  # a second of ticks after the last frame was sent

    def hear(run: Any, picture: Any) -> None:
        if run.heard_for_s > 0:
            vehicle.is_heard.set()

    try:
        setup = Setup(place=place, archive=tmp_path / "archive", live=True)
        summary = run_live([link], [], setup, seconds=60.0, watch=hear, asked_to_stop=is_over)
    finally:
        vehicle.stop.set()
        vehicle.join()
    assert summary.archive is not None
    recorded = [frame for path in (summary.archive / "inputs").glob("*.tlog") for frame in _frames(path)]
    assert len(vehicle.sent) == FRAMES
    assert not Counter(vehicle.sent) - Counter(recorded)
    verdicts = {parse(frame).verdict for frame in recorded}  # type: ignore[union-attr]
    assert verdicts == {"good"}
    damage = ("crc error", "lost", "leftover bytes", "resynced bytes", "reordered", "dropped by the kernel")
    assert not {reason: number for reason, number in summary.counters.items() if reason.endswith(damage)}


def _frames(tlog: Path) -> list[bytes]:
    """The frames of a file that is not damaged, by their lengths alone."""
    data, at, frames = tlog.read_bytes(), 0, []
    while at < len(data):
        assert data[at + 8] == 0xFD
        size = data[at + 9] + 12
        frames.append(data[at + 8 : at + 8 + size])
        at += 8 + size
    return frames


@pytest.fixture(autouse=True)
def _quiet_mavproxy(monkeypatch: pytest.MonkeyPatch) -> None:
    """MAVProxy asks for a display where it finds one."""
    monkeypatch.delenv("DISPLAY", raising=False)
