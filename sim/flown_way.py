"""A vehicle that flies its mission by itself, in wind, recorded as a way: the truth that a scene's sensors measure.

It is stepped as far as it is asked for; the same seed gives the same bits, however it is asked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adapters.mission_writing import MissionItem
from sim.earth import Flown
from sim.ships.fitting_out import vessel
from sim.ships.hull import Weather
from sim.vehicles.aeroplane import AIRLINER, AeroplaneParameters
from sim.vehicles.flying import HELICOPTER, QUADROTOR, Flyer, aeroplane, rotorcraft, with_home
from sim.vehicles.motion import Arm, ChangeSpeed, Home, SetMode, Vehicle
from sim.vehicles.wind import WindParameters

Floats = NDArray[np.float64]

Craft = Literal["aeroplane", "airliner", "copter", "helicopter", "ship"]

STANDS_S = 20.0  # that it is still there when its mission is done
LONGEST_S = 6 * 3600.0
_SMOOTH_S = 1.0  # over which a turn is told from gusts
_STANDS_MPS = 0.5


@dataclass(frozen=True)
class FlownWay:
    """A mission of one vehicle, begun at a second of the scene from where it stands. It is gone a while after its end."""

    craft: Craft
    home: Home
    items: tuple[MissionItem, ...]
    wind: WindParameters = field(default_factory=WindParameters)
    speed_mps: float | None = None
    goes_around: int = 0
    steering: str = "pid"  # a ship's autopilot, one of `sim.ships.autopilots.KINDS`
    current_mps: tuple[float, float] = (0.0, 0.0)  # of the water, east and north
    seed: int = 0
    system: int = 1
    start_s: float = 0.0

    @property
    def end_s(self) -> float:
        """When it is gone. The whole mission is flown to know it."""
        return self.end_before(math.inf)

    def end_before(self, time_s: float) -> float:
        """When it is gone, or a time before that; it is flown no further."""
        record = self._flight.until(time_s - self.start_s)
        return min(self.start_s + float(record[-1, 0]), time_s)

    def starting(self, later_s: float) -> FlownWay:
        """The same, later."""
        return replace(self, start_s=self.start_s + later_s)

    def flown(self, time_s: ArrayLike) -> Flown:
        """The truth at times (...), seconds of the scene."""
        since = np.asarray(time_s, dtype=np.float64) - self.start_s
        record = self._flight.until(float(np.max(since, initial=0.0)) + 0.5 * _SMOOTH_S)
        times = record[:, 0]
        columns = (np.interp(since, times, column) for column in record[:, 1:11].T)
        latitude, longitude, height, north, east, down, roll, pitch, yaw, airspeed = columns
        velocity = np.stack([east, north, -down], axis=-1)
        return Flown(
            latitude, longitude, height, velocity, roll, pitch, yaw % (2.0 * math.pi), _turn(record, since), airspeed
        )

    @property
    def mission(self) -> tuple[MissionItem, ...]:
        """The items, home first."""
        return with_home(self.home, self.items)

    def items_flown(self, time_s: ArrayLike) -> NDArray[np.int64]:
        """Which item it flies to at times (...), seconds of the scene."""
        since = np.asarray(time_s, dtype=np.float64) - self.start_s
        record = self._flight.until(float(np.max(since, initial=0.0)))
        steps = np.searchsorted(record[:, 0], since, side="right") - 1
        return np.asarray(record[np.maximum(steps, 0), 11], dtype=np.int64)

    @cached_property
    def _flight(self) -> _Flight:
        return _Flight(self._vehicle())

    def _vehicle(self) -> Vehicle:
        """It stands at home and is told to go; a ship is at sea, under way."""
        if self.craft == "ship":
            ship = vessel(
                self.home,
                self.items,
                autopilot=self.steering,
                weather=Weather(current_mps=self.current_mps),
                seed=self.seed,
                system=self.system,
            )
            if self.speed_mps is not None:
                ship.order(ChangeSpeed(self.speed_mps))
            ship.get_under_way()
            return ship
        vehicle = self._flyer()
        if self.speed_mps is not None:
            vehicle.order(ChangeSpeed(self.speed_mps))
        vehicle.order(Arm(True))
        vehicle.order(SetMode("AUTO"))
        return vehicle

    def _flyer(self) -> Flyer:
        home, items, seed, system = self.home, self.items, self.seed, self.system
        if self.craft in ("copter", "helicopter"):
            kind = QUADROTOR if self.craft == "copter" else HELICOPTER
            return rotorcraft(home, items, kind=kind, wind=self.wind, seed=seed, system=system)
        like, rounds = AIRLINER if self.craft == "airliner" else AeroplaneParameters(), self.goes_around
        return aeroplane(home, items, parameters=like, wind=self.wind, seed=seed, system=system, goes_around=rounds)


class _Flight:
    """A vehicle that is stepped as far as somebody asks, and what it has come through."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle, self._rows = vehicle, [_row(vehicle)]
        self._record, self._done_s = np.array(self._rows), math.inf

    def until(self, since_s: float) -> Floats:
        """Every step (n, 12) until this time at least, or to the end: time, place, velocity, attitude, airspeed, item.

        The yaw goes on beyond a circle.
        """
        vehicle = self._vehicle
        while (now_s := vehicle.moment.time_s) < min(since_s, self._done_s + STANDS_S, LONGEST_S):
            vehicle.step()
            self._rows.append(_row(vehicle))
            if math.isinf(self._done_s) and vehicle.mission.is_complete:
                self._done_s = now_s
        if len(self._rows) > len(self._record):
            self._record = np.array(self._rows)
            self._record[:, 9] = np.unwrap(self._record[:, 9])
        return self._record


def _row(vehicle: Vehicle) -> tuple[float, ...]:
    moment = vehicle.moment
    speed = math.dist(moment.velocity_mps, (0.0, 0.0, 0.0)) if moment.airspeed_mps is None else moment.airspeed_mps
    place = (moment.latitude_rad, moment.longitude_rad, moment.height_m)
    return (moment.time_s, *place, *moment.velocity_mps, *moment.attitude_rad, speed, vehicle.mission.current)


def _turn(record: Floats, since_s: Floats) -> Floats:
    """How fast the course turns to the right (...), rad/s, over a second so that gusts are none; 0 for what stands."""
    times, north, east = record[:, 0], record[:, 4], record[:, 5]
    course = np.unwrap(np.arctan2(east, north))
    after, before = (np.interp(since_s + half, times, course) for half in (0.5 * _SMOOTH_S, -0.5 * _SMOOTH_S))
    moves = np.interp(since_s, times, np.hypot(north, east)) > _STANDS_MPS
    return np.where(moves, (after - before) / _SMOOTH_S, 0.0)
