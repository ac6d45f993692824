"""Track control by heading: which heading brings ships onto the leg between two waypoints, and along it.

    los          course of the leg - atan(e / D)                           biased by a current: e = D tan(crab)
    integral     course of the leg - atan((e + s y) / D)                   y' = D e / (D^2 + (e + s y)^2)
    course       the same as los, less the crab angle                      the default

e is the distance to the right of the leg, D the lookahead. `course` takes the crab from the course over ground and the heading,
slowly filtered, so that what is steered is the course. A leg ends where its end is within the reach of a turn, or was passed.

Source: 002-5 3 (indirect track control; the print gives no formula); Fossen, Borhaug and Pettersen for the three laws.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.geodesy import wrap_rad

Floats = NDArray[np.float64]

LAWS = ("los", "integral", "course")


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints (n, 2), east and north, m, of which the first is where the first leg begins; and when a leg ends."""

    points_m: Floats
    reach_m: float

    def leg(self, number: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Beginnings and ends (..., 2) of legs (...)."""
        return self.points_m[number], self.points_m[number + 1]


@dataclass(frozen=True, slots=True)
class TrackControl:
    """One of `LAWS` and what it is set to."""

    law: str = "course"
    lookahead_m: float = 400.0  # two and a half lengths of the page's ship
    integral_gain_mps: float = 1.0  # s
    crab_s: float = 10.0  # time constant of the crab angle's filter


@dataclass(frozen=True, slots=True)
class Along:
    """How far ships (...) have come on a route: the leg's number, the crab angle and the integral that track control keeps."""

    leg: NDArray[np.int64]
    crab_rad: Floats
    integral_m: Floats

    @classmethod
    def start(cls, shape: tuple[int, ...]) -> Along:
        """On the first leg, nothing learnt."""
        return cls(np.zeros(shape, np.int64), np.zeros(shape), np.zeros(shape))


@dataclass(frozen=True, slots=True)
class Deviation:
    """Where ships (...) are on their legs: to the right of it, what is left of it, its course and its length."""

    right_m: Floats
    left_to_go_m: Floats
    course_rad: Floats


def deviation(route: Route, leg: NDArray[np.int64], east_m: Floats, north_m: Floats) -> Deviation:
    """Of ships at places (...) from their legs (...)."""
    begins, ends = route.leg(leg)
    way = ends - begins
    length = np.hypot(way[..., 0], way[..., 1])
    along_east, along_north = way[..., 0] / length, way[..., 1] / length
    off_east, off_north = east_m - begins[..., 0], north_m - begins[..., 1]
    along = off_east * along_east + off_north * along_north
    right = off_east * along_north - off_north * along_east
    return Deviation(right, length - along, np.arctan2(way[..., 0], way[..., 1]))


def next_leg(route: Route, leg: NDArray[np.int64], east_m: Floats, north_m: Floats) -> NDArray[np.int64]:
    """The legs (...) that ships are on: the next one where the end of theirs is reached, but for the last."""
    _, ends = route.leg(leg)
    near = np.hypot(ends[..., 0] - east_m, ends[..., 1] - north_m) < route.reach_m
    passed = deviation(route, leg, east_m, north_m).left_to_go_m < 0.0
    return np.minimum(leg + (near | passed), len(route.points_m) - 2)


def is_arrived(route: Route, leg: NDArray[np.int64], east_m: Floats, north_m: Floats) -> NDArray[np.bool_]:
    """Whether ships (...) have passed the end of the last leg."""
    last = leg == len(route.points_m) - 2
    return np.asarray(last & (deviation(route, leg, east_m, north_m).left_to_go_m < 0.0))


def wanted_heading(
    control: TrackControl,
    route: Route,
    along: Along,
    place_m: tuple[Floats, Floats],
    heading_rad: Floats,
    ground_mps: tuple[Floats, Floats],
    step_s: float,
) -> tuple[Floats, Along]:
    """The heading to steer (...), rad, and how far ships have come; headings without the waves, velocities east and north."""
    leg = next_leg(route, along.leg, *place_m)
    off = deviation(route, leg, *place_m)
    share = -math.expm1(-step_s / control.crab_s)
    course = np.arctan2(ground_mps[0], ground_mps[1])
    crab = along.crab_rad + share * wrap_rad(course - heading_rad - along.crab_rad)
    integral = np.where(leg == along.leg, along.integral_m, 0.0)
    if control.law == "integral":
        pulled = off.right_m + control.integral_gain_mps * integral
        rate = control.lookahead_m * off.right_m / (control.lookahead_m**2 + pulled**2)
        wanted = off.course_rad - np.arctan(pulled / control.lookahead_m)
        return wanted, Along(leg, crab, integral + rate * step_s)
    wanted = off.course_rad - np.arctan(off.right_m / control.lookahead_m)
    if control.law == "course":
        wanted = wanted - crab
    return wanted, Along(leg, crab, integral)
