"""MAVSDK and MAVProxy take a simulated vehicle for a real one: they see it, write and read its mission, and fly it.

The vehicle flies twenty times as fast as real time: a mission of minutes in seconds.
"""

from __future__ import annotations

import importlib.util
import json
import math
import queue
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from adapters.mavlink_frames import FrameScanner, fields, parse
from adapters.mission_files import read_items
from adapters.mission_writing import ABOVE_SEA, LAND, TAKE_OFF, WAYPOINT, MissionItem, format_waypoints
from gateway.runtime.links import open_link
from gateway.runtime.urls import Url
from sim.vehicles.flying import Flyer, aeroplane, rotorcraft
from sim.vehicles.motion import Home
from sim.vehicles.serving import LinkedVehicles, serve
from sim.vehicles.speaking import Speaker, sensors_of
from sim.vehicles.wind import WindParameters

Find = Callable[[str], list[str]]
Child = Callable[..., "subprocess.Popen[str]"]
Served = Callable[[Flyer, int], None]

STATION = Path(__file__).with_name("ground_station.py")
HOME = (47.4, 8.5, 452.0)  # latitude, longitude in degrees; m above mean sea level
NEAR_M = 40.0
SPEED = 20.0
START_NS = 1_767_225_600_000_000_000
WIND = WindParameters(6.0, math.radians(250.0), 1.0)


def place(north_m: float, east_m: float, above_m: float, command: int = WAYPOINT) -> MissionItem:
    latitude = HOME[0] + north_m / 111_195.0
    longitude = HOME[1] + east_m / 111_195.0 / math.cos(math.radians(HOME[0]))
    return MissionItem(command, round(latitude, 7), round(longitude, 7), above_m, 3, (0.0, 0.0, 0.0, 0.0))


PLANE = (
    *(place(0, 0, 40, TAKE_OFF), place(700, 0, 60), place(700, 500, 80), place(-200, 700, 60)),
    *(place(-900, 0, 45), place(0, 0, 0, LAND)),
)
COPTER = (place(0, 0, 20, TAKE_OFF), place(120, 0, 20), place(120, 90, 30), place(0, 60, 25), place(0, 0, 0, LAND))


def home() -> Home:
    return Home(math.radians(HOME[0]), math.radians(HOME[1]), HOME[2] + 48.0, 0.0, 48.0)


@pytest.fixture
def served() -> Iterator[Served]:
    """Vehicles that call on a port of a station; they end with the test."""
    stop, ends = threading.Event(), list[Callable[[], None]]()

    def start(vehicle: Flyer, port: int) -> None:
        link = open_link(Url("udpout", "127.0.0.1", port), is_drained=False)
        linked = LinkedVehicles(link, [Speaker.of(1, vehicle, sensors_of(1, 1), START_NS)])
        how = {"speed": SPEED, "asked_to_stop": stop.is_set}
        thread = threading.Thread(target=serve, args=([vehicle], [linked]), kwargs=how, daemon=True)
        thread.start()
        ends.extend((thread.join, link.close))

    yield start
    stop.set()
    for end in ends:
        end()


def lines_of(process: subprocess.Popen[str]) -> queue.SimpleQueue[str]:
    """What a program prints, as it comes."""
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            lines.put(line)

    threading.Thread(target=read, daemon=True).start()
    return lines


def missed_m(item: MissionItem, seen: list[tuple[float, float]]) -> float:
    """How near the places that were seen come to an item, m."""
    east = math.cos(math.radians(HOME[0]))
    offs = [(latitude - item.latitude_deg, (longitude - item.longitude_deg) * east) for latitude, longitude in seen]
    return min(math.hypot(*off) for off in offs) * 111_195.0


@pytest.mark.parametrize(("made", "items"), [(aeroplane, PLANE), (rotorcraft, COPTER)], ids=["plane", "copter"])
def test_mavsdk_writes_and_reads_a_mission_starts_it_and_sees_each_waypoint_passed(
    made: Any, items: tuple[MissionItem, ...], child: Child, served: Served, free_port: int, tmp_path: Path
) -> None:
    if importlib.util.find_spec("mavsdk") is None:
        pytest.skip("mavsdk is not installed")
    mission = tmp_path / "mission.waypoints"
    mission.write_text(format_waypoints(items, HOME))
    lines = lines_of(child(sys.executable, str(STATION), str(free_port), str(mission)))
    told: dict[str, list[Any]] = {}

    def until(word: str) -> Any:
        while word not in told:
            said, _, value = lines.get(timeout=60).partition(" ")
            if re.fullmatch("[a-z]+", said) and value:
                told.setdefault(said, []).append(json.loads(value))
        return told[word][-1]

    until("listening")
    served(made(home(), wind=WIND, seed=3), free_port)
    assert until("uploaded") == 1  # MissionRaw's Result.SUCCESS
    whole = (MissionItem(WAYPOINT, *HOME, frame=ABOVE_SEA, parameters=(0.0, 0.0, 0.0, 0.0)), *items)
    assert until("mission") == [
        [number, item.frame, item.command, *item.parameters, *_degrees_e7(item), item.altitude_m]
        for number, item in enumerate(whole)
    ]
    assert until("started") == [1, 1]
    until("end")
    seen = [(latitude, longitude) for latitude, longitude, _ in told["position"]]
    assert max(missed_m(item, seen) for item in items) < NEAR_M
    assert told["armed"][-1] is False
    assert max(above for _, _, above in told["position"]) > 18.0


def _degrees_e7(item: MissionItem) -> tuple[int, int]:
    return round(item.latitude_deg * 1e7), round(item.longitude_deg * 1e7)


def test_mavproxy_writes_and_reads_a_mission_starts_it_and_sees_each_waypoint_passed(
    program: Find, child: Child, served: Served, free_port: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mavproxy = program("mavproxy.py")
    monkeypatch.delenv("DISPLAY", raising=False)  # it asks for one where it finds one
    mission, back, log = tmp_path / "mission.waypoints", tmp_path / "back.waypoints", tmp_path / "seen.tlog"
    mission.write_text(format_waypoints(PLANE, HOME))
    ends = f"--master=udpin:127.0.0.1:{free_port}", f"--state-basedir={tmp_path}", f"--logfile={log}"
    console = child(*mavproxy, *ends, "--default-modules=wp,arm,mode,link", "--nowait", cwd=tmp_path)
    lines = lines_of(console)

    def until(text: str) -> None:
        printed: list[str] = []
        while not any(text in line for line in printed):
            printed.append(lines.get(timeout=60))

    def ask(command: str, answer: str) -> None:
        assert console.stdin is not None
        console.stdin.write(command + "\n")
        console.stdin.flush()
        until(answer)

    served(aeroplane(home(), wind=WIND, seed=3), free_port)
    until("Detected vehicle 1:1")
    whole = f"{len(PLANE) + 1} waypoint"
    ask(f"wp load {mission}", f"Loaded {whole}s in")
    ask("wp list", f"Saved {whole}s")
    ask(f"wp save {back}", f"Saved {whole}s to {back}")
    for mine, theirs in zip(PLANE, read_items(back)[0], strict=True):  # it writes six places of a degree
        same = replace(theirs, latitude_deg=mine.latitude_deg, longitude_deg=mine.longitude_deg)
        assert same == mine
        assert missed_m(mine, [(theirs.latitude_deg, theirs.longitude_deg)]) < 0.2
    ask("arm throttle", "ARMED")
    ask("mode AUTO", "Mode AUTO")
    until("DISARMED")
    seen = [frame for frame in map(parse, FrameScanner().feed(log.read_bytes())) if frame and frame.verdict == "good"]
    places = [_read_position(frame.payload) for frame in seen if frame.message == POSITION]
    assert max(missed_m(item, [(x / 1e7, y / 1e7) for x, y in places]) for item in PLANE) < NEAR_M


POSITION, _read_position = fields("GLOBAL_POSITION_INT", "lat", "lon")
