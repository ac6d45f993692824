"""A ground station made of MAVSDK: sends a mission, reads it back, starts it and watches it; each as a line of JSON.

Usage: ground_station.py PORT MISSION
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.action.action import Action
from mavsdk.plugins.mission_raw.mission_raw import MissionItem, MissionRaw
from mavsdk.plugins.telemetry.telemetry import Telemetry

FIELDS = ("seq", "frame", "command", "param1", "param2", "param3", "param4", "x", "y", "z")
PATIENCE_S = 100.0


_OUT = os.fdopen(os.dup(1), "w")
_ONE_AT_A_TIME = threading.Lock()  # MAVSDK calls from threads of its own


def tell(word: str, value: Any = None) -> None:
    """Print one line."""
    with _ONE_AT_A_TIME:
        print(f"{word} {json.dumps(value)}", file=_OUT, flush=True)


def items_of(mission: Path) -> list[MissionItem]:
    """The lines of QGC WPL 110."""
    items = []
    for line in mission.read_text().splitlines()[1:]:
        words = line.split()
        numbers = {f"param{place}": float(words[place + 3]) for place in range(1, 5)}
        where = {"x": round(float(words[8]) * 1e7), "y": round(float(words[9]) * 1e7), "z": float(words[10])}
        kind = {"seq": int(words[0]), "frame": int(words[2]), "command": int(words[3])}
        items.append(MissionItem(**kind, current=int(words[0] == "0"), autocontinue=1, **numbers, **where))
    return items


def main() -> None:
    """Do all of it with the first system that is heard."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # MAVSDK logs there, into the middle of our lines
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    station.add_any_connection(f"udpin://127.0.0.1:{sys.argv[1]}")
    tell("listening")
    while not station.get_systems():
        time.sleep(0.05)
    system = station.get_systems()[0]
    telemetry, action, missions = Telemetry(system), Action(system), MissionRaw(system)
    landed = threading.Event()

    def place(position: Any, _: object = None) -> None:
        tell("position", [position.latitude_deg, position.longitude_deg, position.relative_altitude_m])

    def armed(is_armed: Any, _: object = None) -> None:
        tell("armed", bool(is_armed))
        if not is_armed:
            landed.set()

    telemetry.subscribe_position(place)
    tell("uploaded", int(missions.upload_mission(items_of(Path(sys.argv[2])))))
    tell("mission", [[getattr(item, name) for name in FIELDS] for item in missions.download_mission()])
    tell("started", [int(action.arm()), int(missions.start_mission())])
    while not telemetry.armed():
        time.sleep(0.02)
    telemetry.subscribe_armed(armed)
    landed.wait(PATIENCE_S)
    tell("end", missions.mission_progress().current)
    sys.stdin.read()


main()
