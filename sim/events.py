"""A scene as it arrives: every frame and datagram of every link in order of arrival, and the truth about it."""

from __future__ import annotations

import heapq
from collections.abc import Iterator

import numpy as np

from gateway.observation import Truth
from sim.airborne import frames
from sim.faulty_links import carried
from sim.radars import datagrams
from sim.scene import STAMP_STEP_NS, Scene, Sent


def events(scene: Scene) -> Iterator[Sent]:
    """Everything that arrives, in order; stamps are strictly increasing multiples of 4 us over all links."""

    def link(name: str, said: Iterator[tuple[float, bytes]]) -> Iterator[tuple[float, str, bytes]]:
        for arrives_s, data in carried(scene.faults, scene.seed, name, said, scene.duration_s):
            yield arrives_s, name, data

    links = [link(one.name, frames(scene, one)) for one in scene.aircraft]
    links += [link(radar.name, datagrams(scene, radar)) for radar in scene.radars]
    last = 0
    for arrives_s, name, data in heapq.merge(*links, key=lambda said: said[0]):
        arrival = scene.at_ns(arrives_s)
        last = max(-(-arrival // STAMP_STEP_NS) * STAMP_STEP_NS, last + STAMP_STEP_NS)
        yield Sent(last, name, data)


def truth(scene: Scene, period_s: float = 0.25) -> Iterator[Truth]:
    """The true states of all aircraft, one aircraft after the other, at a period."""
    for aircraft in scene.aircraft:
        start, end = scene.present(aircraft)
        times = np.arange(start, end, period_s)
        flown = scene.flown(aircraft, times)
        columns = (flown.latitude_rad, flown.longitude_rad, flown.height_m, *flown.velocity_mps.T, flown.mode)
        for time_s, *state in zip(times.tolist(), *(column.tolist() for column in columns), strict=True):
            latitude, longitude, height, east, north, up, mode = state
            at = scene.at_ns(time_s)
            altitude = height - scene.geoid_separation_m
            yield Truth(aircraft.name, at, at, latitude, longitude, altitude, height, east, north, up, mode)
