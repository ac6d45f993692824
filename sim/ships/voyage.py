"""Autopilot and ship in one process: the closed loop, many runs at once, and what came of it over time.

Source: 002-5 2: simulation on one computer. `linked.py` is the one on two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.ships.autopilots import Autopilot, listen, steer
from sim.ships.hull import Hull, Ship, Weather, ground_velocity, sail
from sim.ships.track_control import Along, Route, TrackControl, deviation, wanted_heading
from sim.ships.waves import Waves, draw

Floats = NDArray[np.float64]

STEP_S = 0.2


@dataclass(frozen=True, slots=True)
class Voyage:
    """Over time, each (t, ...): heading without and with waves, rate, rudder and its order, place, metres right of the leg."""

    time_s: Floats  # (t,)
    heading_rad: Floats
    measured_rad: Floats
    rate_radps: Floats
    rudder_rad: Floats
    ordered_rad: Floats
    wanted_rad: Floats
    east_m: Floats
    north_m: Floats
    right_m: Floats
    leg: NDArray[np.int64]

    @property
    def rudder_travel_rad(self) -> Floats:
        """How far rudders (...) have moved in all."""
        return np.asarray(np.abs(np.diff(self.rudder_rad, axis=0)).sum(axis=0))


@dataclass(frozen=True, slots=True)
class Sea:
    """What a voyage meets: steady weather, and the waves' heading and rate (t, ...) or none."""

    weather: Weather = Weather()
    waves: tuple[Floats, Floats] | None = None

    @classmethod
    def drawn(cls, weather: Weather, waves: Waves | None, duration_s: float, shape: tuple[int, ...], seed: int) -> Sea:
        """Waves of one seed, for so long and for runs (...)."""
        if waves is None:
            return cls(weather)
        generator = np.random.default_rng(seed)
        return cls(weather, draw(waves, round(duration_s / STEP_S) + 1, shape, STEP_S, generator))

    def at(self, step: int, ship: Ship) -> tuple[Floats, Floats]:
        """Heading and rate (...) as a compass measures them."""
        if self.waves is None:
            return ship.heading_rad, ship.rate_radps
        return ship.heading_rad + self.waves[0][step], ship.rate_radps + self.waves[1][step]


def make_voyage(
    hull: Hull,
    ship: Ship,
    autopilot: Autopilot,
    sea: Sea,
    duration_s: float,
    *,
    heading_rad: ArrayLike | None = None,
    route: Route | None = None,
    control: TrackControl | None = None,
) -> Voyage:
    """Sail ships (...) for so long: on a heading (...), or along a route by track control."""
    steps = round(duration_s / STEP_S)
    shape = ship.heading_rad.shape
    memory, along = autopilot.start(ship.heading_rad), Along.start(shape)
    order = np.zeros(shape)
    wanted = np.broadcast_to(np.asarray(0.0 if heading_rad is None else heading_rad, dtype=np.float64), shape)
    control = control or TrackControl()
    told: Floats = np.zeros((9, steps + 1, *shape))
    legs = np.zeros((steps + 1, *shape), np.int64)
    for step in range(steps + 1):
        measured, rate = sea.at(step, ship)
        if step:
            memory = listen(autopilot, memory, measured, rate, order, STEP_S)
        if route is not None:
            ground, place = ground_velocity(ship, sea.weather), (ship.east_m, ship.north_m)
            wanted, along = wanted_heading(control, route, along, place, memory.heading(measured), ground, STEP_S)
        order, memory = steer(autopilot, memory, measured, rate, ship.speed_mps, wanted, STEP_S)
        right = 0.0 if route is None else deviation(route, along.leg, ship.east_m, ship.north_m).right_m
        told[:, step] = np.stack(
            np.broadcast_arrays(
                ship.heading_rad,
                measured,
                ship.rate_radps,
                ship.rudder_rad,
                order,
                wanted,
                ship.east_m,
                ship.north_m,
                right,
            )
        )
        legs[step] = along.leg
        ship = sail(hull, ship, order, sea.weather, STEP_S)
    heading, seen, rate, rudder, ordered, headed, east, north, off = told
    time_s: Floats = np.arange(steps + 1, dtype=np.float64) * STEP_S
    return Voyage(time_s, heading, seen, rate, rudder, ordered, headed, east, north, off, legs)
