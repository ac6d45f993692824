"""Missions that are flown: aircraft with plans of their own, steered along the lines between the points in a gusty wind.

They are steered as autopilots steer: at a point ahead on the line (L1 guidance), up to a bank, on to the next point when they are
near one. What they tell is what a gateway hears of real ones: positions, velocities, the plan, the current item, the wind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from gateway.observation import AirData, FlightPlan, GpsReport, Intent, PlanPoint
from gateway.settings import DEMO_SITE

Said = FlightPlan | Intent | AirData | GpsReport
Floats = NDArray[np.float64]

STARTS = 1_767_225_600 * SECOND
POINTS, STEPS = 12, 4  # points of a plan; steps of steering in a second
AHEAD_S, BANK_RAD = 4.0, math.radians(45.0)
SIGMA_M, SIGMA_MPS = 2.0, 0.3
GUST_MPS, GUST_S = 1.0, 5.0
UP_M = 600.0


@dataclass(frozen=True, slots=True)
class Mission:
    """What one aircraft flew: places (t, 2) east and north each second, and all that it said."""

    aircraft: str
    places: Floats
    said: tuple[Said, ...]


def missions(count: int, seconds: int, seed: int) -> list[Mission]:
    """Some missions, drawn with a seed: speeds, winds, corners."""
    frame = RunwayFrame(DEMO_SITE.runway)
    return [_mission(number, seconds, np.random.default_rng([seed, number]), frame) for number in range(1, count + 1)]


def _mission(number: int, seconds: int, draws: np.random.Generator, frame: RunwayFrame) -> Mission:
    speed, near_m = draws.uniform(18.0, 45.0), draws.uniform(30.0, 90.0)
    wind = draws.uniform(0.0, 0.25) * speed * _towards(draws.uniform(0.0, 2.0 * math.pi))
    points = _points(draws, speed)
    place, course, item, said_item = points[0].copy(), math.atan2(*(points[1] - points[0])[::-1]), 1, 0
    gust = np.zeros(2)
    places: list[Floats] = []
    said: list[Said] = [_plan(number, points, frame)]
    for second in range(seconds):
        velocity = speed * _towards(course) + wind + gust
        said += _told(number, second, item if item != said_item else None, place, velocity, wind, draws, frame)
        said_item = item
        places.append(place.copy())
        for _ in range(STEPS):
            gust = gust * math.exp(-1.0 / (STEPS * GUST_S)) + draws.normal(0.0, GUST_MPS * math.sqrt(0.4 / STEPS), 2)
            velocity = speed * _towards(course) + wind + gust
            if item + 1 < POINTS and np.hypot(*(points[item] - place)) < near_m:
                item += 1
            course += _steered(place, velocity, points[item - 1], points[item], speed) / STEPS
            place = place + velocity / STEPS
    return Mission(f"mavlink:{number}", np.array(places), tuple(said))


def _points(draws: np.random.Generator, speed: float) -> Floats:
    """Corners of up to 120 degrees, a minute of flight between them, more or less."""
    points, course = [draws.uniform(-20_000.0, 20_000.0, 2)], draws.uniform(0.0, 2.0 * math.pi)
    for _ in range(POINTS - 1):
        course += draws.uniform(-1.0, 1.0) * math.radians(120.0)
        points.append(points[-1] + speed * draws.uniform(35.0, 120.0) * _towards(course))
    return np.array(points)


def _steered(place: Floats, velocity: Floats, begins: Floats, ends: Floats, speed: float) -> float:
    """The turn rate, rad/s, that leads to a point ahead on the line between two points."""
    line = (ends - begins) / max(float(np.hypot(*(ends - begins))), 1.0)
    off, ground = place - begins, max(float(np.hypot(*velocity)), 1.0)
    aim = begins + line * (float(off @ line) + AHEAD_S * ground)
    way = aim - place
    angle = math.atan2(float(velocity[0] * way[1] - velocity[1] * way[0]), float(velocity @ way))
    rate = 2.0 * ground / max(float(np.hypot(*way)), 1.0) * math.sin(max(min(angle, 1.5), -1.5))
    most = STANDARD_GRAVITY_MPS2 * math.tan(BANK_RAD) / speed
    return max(min(rate, most), -most)


def _towards(course: float) -> Floats:
    return np.array([math.cos(course), math.sin(course)])


def _place(place: Floats, frame: RunwayFrame) -> tuple[float, float, float]:
    latitude, longitude, height = frame.geodetic_from_enu(np.array([*place, UP_M]))
    return float(latitude), float(longitude), float(height)


def _plan(number: int, points: Floats, frame: RunwayFrame) -> FlightPlan:
    items = [PlanPoint(k, "waypoint", *_place(point, frame)[:2]) for k, point in enumerate(points)]
    return FlightPlan(f"mavlink:{number}", STARTS, STARTS, tuple(items[1:]))


def _told(
    number: int,
    second: int,
    item: int | None,
    place: Floats,
    velocity: Floats,
    wind: Floats,
    draws: np.random.Generator,
    frame: RunwayFrame,
) -> list[Said]:
    """What is said in one second; `item` where it goes to another one than before."""
    at, name = STARTS + second * SECOND + number * 1000, f"mavlink:{number}"
    there, speed = _place(place + draws.normal(0.0, SIGMA_M, 2), frame), velocity + draws.normal(0.0, SIGMA_MPS, 2)
    east, north = float(speed[0]), float(speed[1])
    report = GpsReport(name, at, at, there[0], there[1], None, there[2], east, north, 0.0, SIGMA_M, SIGMA_M, SIGMA_MPS)
    blows = (wind + draws.normal(0.0, 0.5, 2)).tolist()
    said: list[Said] = [AirData(name, at, at, wind_east_mps=blows[0], wind_north_mps=blows[1]), report]
    return said if item is None else [Intent(name, at, at, "mission", item), *said]
