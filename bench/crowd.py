"""A crowd that has told its plans: the state of a pipeline with many aircraft, each with seventeen points that it may fly to.

Every aircraft has a plan of ten points and says which it goes to; the site publishes four points more; home, the runway and a
go-around are candidates too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.observation import FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint
from gateway.pipeline import initial, step
from gateway.settings import DEMO_SITE, Options, Waypoint
from gateway.state import State

STARTS = 1_767_225_600 * SECOND
HEARD_S = 3


def crowd(aircraft: int, options: Options) -> State:
    """Aircraft that have reported for `HEARD_S` seconds and told their plans."""
    runway = DEMO_SITE.runway
    chance = np.random.default_rng(1)
    places = chance.uniform(-0.4, 0.4, (aircraft, 11, 2)) + np.degrees([runway.latitude_rad, runway.longitude_rad])
    waypoints = tuple(Waypoint(f"W{place}", *np.radians([31.0 + 0.1 * place, 103.8])) for place in range(4))
    state = initial(type(DEMO_SITE)(DEMO_SITE.name, runway, DEMO_SITE.position, waypoints=waypoints), options)
    said: list[Observation] = []
    for number, (first, *others) in enumerate(np.radians(places).tolist()):
        name = f"mavlink:{number + 1}"
        home = PlanPoint(0, "home", first[0], first[1], altitude_msl_m=500.0)
        points = [PlanPoint(k, "waypoint", one[0], one[1], altitude_msl_m=900.0) for k, one in enumerate(others, 1)]
        said += [FlightPlan(name, STARTS, STARTS, (home, *points)), Intent(name, STARTS, STARTS, "mission", 1)]
    heard = [Heard(STARTS + 1, tuple(said))]
    for tenth in range(1, 10 * HEARD_S + 1):
        at = STARTS + tenth * SECOND // 10
        heard.append(Heard(at, tuple(_report(number, place[0], at, tenth / 10) for number, place in enumerate(places))))
    return step(state, heard)[0]


def _report(number: int, place: NDArray[np.float64], at: int, since_s: float) -> GpsReport:
    """Northward at 80 m/s."""
    latitude, longitude = np.radians(place)
    north = 80.0 * since_s / 6.37e6
    name = f"mavlink:{number + 1}"
    return GpsReport(
        name, at, at, float(latitude + north), float(longitude), 900.0, None, 0.0, 80.0, 0.0, 5.0, 8.0, 0.5
    )
