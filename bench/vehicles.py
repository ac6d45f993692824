"""Simulated vehicles: how many times real time one goes, and a hundred on one core, with all that they say encoded.

python -m bench.vehicles ROUNDS      prints, as JSON, the multiples of real time

Aeroplanes fly a mission in wind and gusts with 50 steps a second. Each says what a vehicle says by default: its inertial unit
50 times a second, position and attitude 10 times, and the rest, 98 messages a second in all. CPU time of this one thread counts.
"""

from __future__ import annotations

import json
import math
import sys
import time
from typing import TYPE_CHECKING

from bench.measure import Figure, alone

if TYPE_CHECKING:
    from adapters.mission_writing import MissionItem

ONE_S, FLEET_S, FLEET = 120.0, 5.0, 100
_AT_LEAST, _ALL_AT_LEAST = 200.0, 1.0


def _mission() -> tuple[MissionItem, ...]:
    """Take-off and a box that is flown for ever."""
    from adapters.mission_writing import TAKE_OFF, WAYPOINT, MissionItem

    corners = ((47.41, 8.5), (47.41, 8.515), (47.4, 8.515), (47.4, 8.5))
    places = [MissionItem(WAYPOINT, *corner, 80.0) for corner in corners]
    return (MissionItem(TAKE_OFF, 47.4, 8.5, 50.0), *places, MissionItem(177, parameters=(2.0, -1.0, 0.0, 0.0)))


def vehicles(runs: int) -> list[Figure]:
    """One aeroplane, and a hundred, as multiples of real time."""
    told: dict[str, list[float]] = json.loads(alone([sys.executable, "-m", "bench.vehicles", str(runs)]))
    return [
        Figure("one simulated vehicle, times real time", "", tuple(told["one"]), at_least=_AT_LEAST),
        Figure(
            f"{FLEET} simulated vehicles on one core, times real time", "", tuple(told["fleet"]), at_least=_ALL_AT_LEAST
        ),
    ]


def times_real(number: int, seconds: float) -> float:
    """How many times as fast as real time so many aeroplanes go, by this thread's CPU time."""
    from sim.vehicles.flying import aeroplane
    from sim.vehicles.motion import Arm, Home, SetMode
    from sim.vehicles.speaking import Speaker, sensors_of
    from sim.vehicles.wind import WindParameters

    home, fleet = Home(math.radians(47.4), math.radians(8.5), 500.0, 0.0, 48.0), list[Speaker]()
    for one in range(1, number + 1):
        vehicle = aeroplane(home, _mission(), wind=WindParameters(6.0, 4.0, 1.0), seed=1, system=one)
        for order in (Arm(True), SetMode("AUTO")):
            vehicle.order(order)
        fleet.append(Speaker.of(one, vehicle, sensors_of(1, one), 0))
    began = time.process_time()
    for step in range(round(seconds / fleet[0].vehicle.step_s)):
        for speaker in fleet:
            speaker.vehicle.step()
            speaker.say(step * 20_000_000)
    return seconds / (time.process_time() - began)


if __name__ == "__main__":
    rounds = range(int(sys.argv[1]))
    print(
        json.dumps(
            {"one": [times_real(1, ONE_S) for _ in rounds], "fleet": [times_real(FLEET, FLEET_S) for _ in rounds]}
        )
    )
