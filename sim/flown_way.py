"""A vehicle that flies its mission by itself, in wind, recorded as a way: the truth that a scene's sensors measure.

It is stepped through its whole mission when it is first asked where it is; the same seed gives the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d

from adapters.mission_writing import MissionItem
from sim.earth import Flown
from sim.ships.fitting_out import vessel
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
    seed: int = 0
    system: int = 1
    start_s: float = 0.0

    @property
    def end_s(self) -> float:
        """When it is gone."""
        return self.start_s + float(self._record[-1, 0])

    def starting(self, later_s: float) -> FlownWay:
        """The same, later."""
        return replace(self, start_s=self.start_s + later_s)

    def flown(self, time_s: ArrayLike) -> Flown:
        """The truth at times (...), seconds of the scene."""
        since = np.asarray(time_s, dtype=np.float64) - self.start_s
        record = self._record
        latitude, longitude, height, north, east, down, roll, pitch, yaw, turn, airspeed = (
            np.interp(since, record[:, 0], column) for column in record[:, 1:12].T
        )
        velocity = np.stack([east, north, -down], axis=-1)
        return Flown(latitude, longitude, height, velocity, roll, pitch, yaw % (2.0 * math.pi), turn, airspeed)

    @property
    def mission(self) -> tuple[MissionItem, ...]:
        """The items, home first."""
        return with_home(self.home, self.items)

    def items_flown(self, time_s: ArrayLike) -> NDArray[np.int64]:
        """Which item it flies to at times (...), seconds of the scene."""
        steps = np.searchsorted(self._record[:, 0], np.asarray(time_s) - self.start_s, side="right") - 1
        return np.asarray(self._record[np.maximum(steps, 0), 12], dtype=np.int64)

    @cached_property
    def _record(self) -> Floats:
        """Every step (n, 13): time, place, velocity, attitude with a yaw that goes on beyond a circle, turn, airspeed, item."""
        vehicle = self._vehicle()
        rows, done_s = [_row(vehicle)], math.inf
        while (now_s := vehicle.moment.time_s) < min(done_s + STANDS_S, LONGEST_S):
            vehicle.step()
            rows.append(_row(vehicle))
            if math.isinf(done_s) and vehicle.mission.is_complete:
                done_s = now_s
        record = np.array(rows)
        record[:, 0] -= record[0, 0]
        record[:, 9] = np.unwrap(record[:, 9])
        record[:, 10] = _turn(record, vehicle.step_s)
        return record

    def _vehicle(self) -> Vehicle:
        """It stands at home and is told to go; a ship is at sea, under way."""
        if self.craft == "ship":
            ship = vessel(self.home, self.items, seed=self.seed, system=self.system)
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


def _row(vehicle: Vehicle) -> tuple[float, ...]:
    moment = vehicle.moment
    speed = math.dist(moment.velocity_mps, (0.0, 0.0, 0.0)) if moment.airspeed_mps is None else moment.airspeed_mps
    place = (moment.latitude_rad, moment.longitude_rad, moment.height_m)
    return (moment.time_s, *place, *moment.velocity_mps, *moment.attitude_rad, 0.0, speed, vehicle.mission.current)


def _turn(record: Floats, step_s: float) -> Floats:
    """How fast the course turns to the right (n,), rad/s; 0 for what stands."""
    north, east = record[:, 4], record[:, 5]
    course = np.unwrap(np.arctan2(east, north))
    rate = uniform_filter1d(np.gradient(course, step_s), size=round(_SMOOTH_S / step_s) | 1, mode="nearest")
    return np.where(np.hypot(north, east) > _STANDS_MPS, rate, 0.0)
