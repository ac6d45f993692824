"""Rides as the gateway sees them: its pictures of what vehicles tell, and how far these are from where they were.

Of vehicles without and with positions that are false, for studies and tests of dead reckoning. Source: 002-4.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from gateway.observation import GpsReport, Heard, Observation
from gateway.picture import Picture
from gateway.pipeline import State, initial, step
from gateway.settings import Options, Runway, Site
from sim.inertial import aeroplane, car
from sim.told_rides import Falsified, Teller, heard

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
SITE = Site("here", Runway(math.radians(47.4), math.radians(8.5), 500.0, 0.0, geoid_separation_m=0.0))
QUIET = Options(horizons_s=(10.0,), prediction_period_s=60.0)  # nothing here is about predictions
FALSE_FROM_S = 36.0  # seconds into a ride


def goes_away(time_s: float) -> tuple[float, float, float, float] | None:
    """Nothing is told for twenty seconds."""
    return None if FALSE_FROM_S < time_s <= FALSE_FROM_S + 20.0 else (0.0, 0.0, 0.0, 0.0)


@cache
def told(kind: str, falsified: Falsified, length_s: float = 66.0) -> tuple[Teller, tuple[Heard, ...]]:
    """A ride of a car or an aeroplane, and what it says."""
    generator = np.random.default_rng([7, kind == "car"])
    make, vehicle_type = (car, 10) if kind == "car" else (aeroplane, 1)
    teller = Teller.of("mavlink:1", vehicle_type, make(generator, length_s), generator, falsified)
    return teller, tuple(heard([teller], START, 5))


def pictures(
    said: Iterable[Heard], at_once: int = 10, options: Options = QUIET, site: Site = SITE
) -> Iterator[tuple[State, Picture]]:
    """Of arrivals, worked so many at once: the gateway's states and its pictures."""
    state, waiting = initial(site, options), list[Heard]()
    for one in said:
        waiting.append(one)
        if len(waiting) == at_once:
            state, picture = step(state, waiting)
            waiting = []
            yield state, picture


def denials(some: Iterable[Picture]) -> list[tuple[float, str]]:
    """When positions were denied, or believed again, s since they are false."""
    found = []
    for picture in some:
        for event in picture.events:
            if "what it says of its position" in event.text:
                word = "believed" if "is used" in event.text else "denied"
                found.append(((event.at - START) / SECOND - FALSE_FROM_S, word))
    return found


def errors_m(teller: Teller, some: Iterable[Picture]) -> list[tuple[float, str, float, float]]:
    """Of each row: when, what it is by, how far it is from the truth, level, and its own sigma."""
    motion, found = teller.ride.motion, []
    for picture in some:
        fuse = picture.fuse
        for row, time in enumerate(fuse.time.tolist()):
            time_s = (time - START) / SECOND
            place = min(round(time_s * 50.0), len(motion.height_m) - 1)
            north = (fuse.latitude_rad[row] - motion.latitude_rad[place]) * 6.367e6
            east = (
                (fuse.longitude_rad[row] - motion.longitude_rad[place]) * 6.388e6 * math.cos(motion.latitude_rad[place])
            )
            sigma = math.sqrt(0.5 * (fuse.covariance[row, 0] + fuse.covariance[row, 7]))
            found.append((time_s - FALSE_FROM_S, fuse.updated_by[row], math.hypot(north, east), sigma))
    return found


def frozen(said: Iterable[Heard], from_s: float) -> Iterator[Heard]:
    """The same, with positions and velocities that stay the first ones after so many seconds."""
    first: GpsReport | None = None
    for one in said:
        made = list[Observation]()
        for each in one.observations:
            if isinstance(each, GpsReport) and one.now > START + from_s * SECOND:
                first = first or each
                each = replace(first, valid_at=each.valid_at, received_at=each.received_at)
            made.append(each)
        yield replace(one, observations=tuple(made))
