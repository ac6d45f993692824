"""Paper 002-5 on two computers: a ship here, her autopilot in another process, MAVLink between them."""

from __future__ import annotations

import math
import os
import socket
import subprocess
import sys

import numpy as np

from adapters.mission_writing import MissionItem
from gateway.runtime.links import open_link
from gateway.runtime.urls import parse_url
from sim.inertial import Errors
from sim.ships.fitting_out import vessel
from sim.ships.linked import ShipSpeaker, sail_in_step
from sim.vehicles.motion import Arm, Home, SetMode
from sim.vehicles.sensing import SensorErrors
from sim.vehicles.serving import LinkedVehicles
from sim.vehicles.speaking import sensors_of

HOME = Home(math.radians(31.0), math.radians(122.0), 0.0, math.radians(20.0))  # 20 degrees off the first leg
ITEMS = tuple(
    MissionItem(16, 31.0 + n / 110_860.0, 122.0 + e / 95_500.0, 0.0) for n, e in ((150.0, 0.0), (280.0, 150.0))
)
EXACT = SensorErrors(0.0, 120.0, 0.0, 0.0, 0.0, 0.0, Errors(0.0, 0.0, 0.0, 0.0))
LONGEST_S = 600.0
WITHIN_M = (
    0.3  # 0.07 is measured; degE7 is 1 cm, a step of the rudder's order 0.035 degrees, the rate the mean of a step
)


def test_the_way_is_that_of_one_process() -> None:
    """Off the first leg, around a corner, to the end: within 0.3 m of the ship that has the same autopilot on board."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    program = "from gateway.cli import main; main()"
    command = [sys.executable, "-c", program, "simulate", "helmsman", "--mavlink", f"udpout:127.0.0.1:{port}"]
    link = open_link(parse_url(f"udpin:127.0.0.1:{port}"), is_drained=False)
    helmsman = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    )
    try:
        ship = vessel(HOME, ITEMS)
        speaker = ShipSpeaker.of(1, ship, sensors_of(0, 1, EXACT), 1_790_000_000_000_000_000)
        linked = LinkedVehicles(link, [speaker])
        steered = np.array(sail_in_step(ship, linked, 4.0 * 3600.0))
        _, said = helmsman.communicate(timeout=10)
    finally:
        helmsman.kill()
        helmsman.communicate()
        link.close()
    assert helmsman.returncode == 0
    assert b"Arrived." in said
    assert ship.mission.reached == [1, 2]
    alone = np.array(_alone())
    count = min(len(steered), len(alone))
    assert count * 0.2 > 60.0
    assert np.hypot(*(steered[:count, 1:] - alone[:count]).T).max() < WITHIN_M


def _alone() -> list[tuple[float, float]]:
    """East and north of the ship with the autopilot on board, step by step, until she holds."""
    ship = vessel(HOME, ITEMS)
    for order in (Arm(True), SetMode("AUTO")):
        assert ship.order(order).result == "accepted"
    way = [(0.0, 0.0)]
    while ship.mode == "AUTO" and ship.moment.time_s < LONGEST_S:
        moment = ship.step()
        spot = ship.plane.spot(moment.latitude_rad, moment.longitude_rad, moment.height_m)
        way.append((spot.east_m, spot.north_m))
    return way
