"""What a vehicle that flies a mission tells of it: the items once, as to a station that reads them, and which is flown now."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from adapters.mission_writing import wire_fields
from sim.flown_way import FlownWay
from sim.sayings import Fields, Sayings, ticks
from sim.scene import Aircraft, Scene

_READ_AFTER_S = 2.0
_STATION = {"target_system": 255, "target_component": 190}
_CURRENT_EVERY_S = 1.0
_UNDER_WAY = 3  # MISSION_STATE_ACTIVE


def mission_sayings(scene: Scene, aircraft: Aircraft) -> list[Sayings]:
    """HOME_POSITION, MISSION_COUNT, MISSION_ITEM_INT, MISSION_CURRENT; nothing of those on paths."""
    way = aircraft.path
    if not isinstance(way, FlownWay):
        return []
    start, _ = scene.present(aircraft)
    items, home = way.mission, way.home
    at_s = ticks(scene, aircraft, _CURRENT_EVERY_S)
    current = way.items_flown(at_s)
    once = np.array([start + _READ_AFTER_S])

    def told(index: int) -> Fields:
        return {"seq": int(current[index]), "total": len(items) - 1, "mission_state": _UNDER_WAY}

    place = {
        "latitude": round(math.degrees(home.latitude_rad) * 1e7),
        "longitude": round(math.degrees(home.longitude_rad) * 1e7),
        "altitude": round(home.altitude_msl_m * 1e3),
        **dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0),
        "q": [1.0, 0.0, 0.0, 0.0],
    }
    said = [
        Sayings("HOME_POSITION", once, lambda _: place),
        Sayings("MISSION_COUNT", once, lambda _: {"count": len(items), **_STATION}),
    ]
    return [
        *said,
        Sayings("MISSION_ITEM_INT", np.repeat(once, len(items)), _item_fields(way)),
        Sayings("MISSION_CURRENT", at_s + scene.say.latency_s, told),
    ]


def _item_fields(way: FlownWay) -> Callable[[int], Fields]:
    return lambda index: {**wire_fields(way.mission[index], index), **_STATION}
