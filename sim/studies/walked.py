"""False positions put into a recording: when dead reckoning denies them, and when it believes positions again.

python -m sim.studies.walked RECORDING SECOND...             from these seconds of the recording on, each by itself
python -m sim.studies.walked sitl-boat.tlog 100 200 300

For a minute the position of every vehicle walks off at 2 m/s: with velocities that say nothing of it, and with velocities to
match. Everything else is what was recorded: unit, waves, gaps of the radio. Source: 002-4, in the gateway.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from adapters.decode import Decoder
from gateway.estimators.inertial import displaced
from gateway.observation import GpsReport, Heard, Observation
from gateway.pipeline import initial, step
from gateway.runtime.playback import open_playback
from gateway.settings import Runway, Site
from sim.told_pictures import QUIET, SECOND

WALKS_MPS, WALKS_FOR_S = 2.0, 60.0
BEFORE_S, AFTER_S = 90.0, 300.0
TURN_RAD = 2.1  # from one instant to the next: walks in all directions
AT_ONCE = 30  # arrivals a step


def recorded(path: Path) -> list[Heard]:
    """What a recording tells, in order."""
    playback = open_playback([path])
    said = Decoder(playback.sources).hear_many(list(playback.arrivals()))[0]
    return [one for _, one in said if one is not None and one.observations]


def walked(said: Sequence[Heard], from_s: float, course_rad: float, *, matching: bool) -> list[tuple[float, str]]:
    """What is said of positions that walk off from a second of the recording on: s after that, and the sentence."""
    start = said[0].now + round(from_s * SECOND)
    since, until = start - round(BEFORE_S * SECOND), start + round((WALKS_FOR_S + AFTER_S) * SECOND)
    part = [one for one in said if since < one.now < until]
    here = next(one for heard in part for one in heard.observations if isinstance(one, GpsReport))
    site = Site("here", Runway(here.latitude_rad, here.longitude_rad, 500.0, 0.0, geoid_separation_m=0.0))
    state, found = initial(site, QUIET), []
    false = list(_false(part, start, course_rad, matching))
    for place in range(0, len(false), AT_ONCE):
        state, picture = step(state, false[place : place + AT_ONCE])
        found += [
            ((one.at - start) / SECOND, one.text)
            for one in picture.events
            if "what it says of its position" in one.text
        ]
    return found


def _false(part: Sequence[Heard], start: int, course_rad: float, matching: bool) -> Iterator[Heard]:
    for heard in part:
        told: list[Observation] = [
            _aside(one, (one.valid_at - start) / SECOND, course_rad, matching) if isinstance(one, GpsReport) else one
            for one in heard.observations
        ]
        yield replace(heard, observations=tuple(told))


def _aside(one: GpsReport, since_s: float, course_rad: float, matching: bool) -> GpsReport:
    if not 0.0 < since_s < WALKS_FOR_S:
        return one
    north, east = WALKS_MPS * math.cos(course_rad), WALKS_MPS * math.sin(course_rad)
    at, gone = np.array([one.latitude_rad, one.longitude_rad]), np.array([north * since_s, east * since_s, 0.0])
    latitude, longitude, _ = displaced(at[0], at[1], np.zeros(()), gone)
    there = replace(one, latitude_rad=float(latitude), longitude_rad=float(longitude))
    if not matching or one.velocity_north_mps is None or one.velocity_east_mps is None:
        return there
    return replace(
        there, velocity_north_mps=one.velocity_north_mps + north, velocity_east_mps=one.velocity_east_mps + east
    )


def main() -> None:
    """Print what is said at each instant, in both ways."""
    said = recorded(Path(sys.argv[1]))
    for matching in (False, True):
        print("velocities to match" if matching else "velocities that say nothing of it")
        for number, from_s in enumerate(map(float, sys.argv[2:])):
            print(f"  from {from_s:g} s on")
            for after_s, text in walked(said, from_s, 0.9 + TURN_RAD * number, matching=matching):
                print(f"    {after_s:6.1f} s  {text}")


if __name__ == "__main__":
    main()
