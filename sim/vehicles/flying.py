"""Airframe, pilot and wind, put together into a `Vehicle`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

from adapters.mission_writing import ABOVE_SEA, WAYPOINT, MissionItem
from sim.sensors import stream
from sim.vehicles.aeroplane import Aeroplane, AeroplaneParameters
from sim.vehicles.aeroplane_pilot import AeroplanePilot
from sim.vehicles.body import Body
from sim.vehicles.missions import Mission
from sim.vehicles.motion import Answer, Home, Moment, Order, Progress, Vector
from sim.vehicles.piloting import DECIDES_EVERY_S, Pilot
from sim.vehicles.rotorcraft import HELI, Rotorcraft, RotorcraftParameters
from sim.vehicles.rotorcraft_pilot import RotorcraftPilot
from sim.vehicles.wind import Wind, WindParameters

STEP_S = 0.02
_STEPS_A_DECISION = round(DECIDES_EVERY_S / STEP_S)
FIXED_WING, QUADROTOR, HELICOPTER, SURFACE_BOAT = 1, 2, 4, 11  # MAV_TYPE


class Airframe(Protocol):
    """What answers to controls in the air that moves."""

    throttle: float
    body: Body

    def step(self, controls: Any, wind_mps: Vector, step_s: float) -> None:
        """One step further with the controls that its own kind of pilot gives."""

    def felt_airspeed(self, wind_mps: Vector) -> float | None:
        """What its own sensor tells of the air; None where it has none."""


@dataclass(slots=True)
class Flyer:
    """A vehicle in the air; see `Vehicle`. Its wind is its own, its parameters (`pilot.settings`) too."""

    kind: int
    home: Home
    airframe: Airframe
    pilot: Pilot[Any]
    wind: Wind
    step_s: float = STEP_S
    moment: Moment = field(init=False)
    _steps: int = 0
    _controls: Any = None

    def __post_init__(self) -> None:
        self.moment = self._tell()

    @property
    def mission(self) -> Mission:
        """What it is to fly."""
        return self.pilot.mission

    @property
    def modes(self) -> dict[str, int]:
        """ArduPilot's number of each mode that it has."""
        return self.pilot.modes

    @property
    def mode(self) -> str:
        """The mode it is in."""
        return self.pilot.mode

    @property
    def is_armed(self) -> bool:
        """Whether its motors may run."""
        return self.pilot.is_armed

    @property
    def is_landed(self) -> bool:
        """Whether it stands on the ground."""
        return self.pilot.is_landed

    @property
    def progress(self) -> Progress:
        """Where its guidance stands."""
        return self.pilot.progress

    @property
    def settings(self) -> dict[str, float]:
        """Its parameters by ArduPilot's names."""
        return self.pilot.settings

    @property
    def notes(self) -> list[str]:
        """What it has told people so far."""
        return self.pilot.notes

    def order(self, order: Order) -> Answer:
        """Do as told."""
        return self.pilot.order(order)

    def step(self) -> Moment:
        """A fiftieth of a second further."""
        if self._steps % _STEPS_A_DECISION == 0:
            self._controls = self.pilot.decide()
        wind = self.wind.step(self.step_s, self.moment.airspeed_mps or 0.0)
        self.airframe.step(self._controls, wind, self.step_s)
        self._steps += 1
        self.moment = self._tell()
        return self.moment

    def _tell(self) -> Moment:
        body, wind = self.airframe.body, self.wind.velocity_mps
        return Moment(
            self._steps * self.step_s,
            body.latitude_rad,
            body.longitude_rad,
            body.height_m,
            body.velocity_mps,
            body.attitude_rad,
            body.rate_radps,
            body.force_mps2,
            self.airframe.felt_airspeed(wind),
            wind,
            self.airframe.throttle,
        )


def aeroplane(
    home: Home,
    items: tuple[MissionItem, ...] = (),
    *,
    parameters: AeroplaneParameters | None = None,
    wind: WindParameters | None = None,
    seed: int = 0,
    system: int = 1,
    goes_around: int = 0,
) -> Flyer:
    """An aeroplane that stands at home with a mission (`items`, without home) and waits to be armed.

    It breaks off its first `goes_around` landings by itself.
    """
    body, mission = Body.at(home), Mission(with_home(home, items))
    plane = Aeroplane(parameters or AeroplaneParameters(), body, home.height_m)
    pilot = AeroplanePilot(
        home, body, mission, _aeroplane_settings(plane.parameters), aeroplane=plane, goes_around=goes_around
    )
    air = Wind(wind or WindParameters(), stream(seed, "wind", system))
    return Flyer(FIXED_WING, home, plane, pilot, air)


def _aeroplane_settings(parameters: AeroplaneParameters) -> dict[str, float]:
    cruise = parameters.cruise_mps
    return {
        "AIRSPEED_CRUISE": cruise,
        "NAVL1_PERIOD": 14.0 if cruise < 40.0 else 25.0,
        "ROLL_LIMIT_DEG": float(round(math.degrees(parameters.bank_rad))),
        "RTL_ALTITUDE": 100.0,
        "TKOFF_ALT": 50.0,
        "WP_LOITER_RAD": round(0.16 * cruise * cruise, -1),
        "WP_RADIUS": max(25.0, cruise),
    }


def rotorcraft(
    home: Home,
    items: tuple[MissionItem, ...] = (),
    *,
    parameters: RotorcraftParameters | None = None,
    kind: int = QUADROTOR,
    wind: WindParameters | None = None,
    seed: int = 0,
    system: int = 1,
) -> Flyer:
    """A multirotor or helicopter that stands at home with a mission (`items`, without home) and waits to be armed."""
    body, mission = Body.at(home), Mission(with_home(home, items))
    craft = Rotorcraft(parameters or (HELI if kind == HELICOPTER else RotorcraftParameters()), body, home.height_m)
    settings = {
        "LAND_ALT_LOW": 1000.0,
        "LAND_SPEED": 50.0,
        "RTL_ALT": 3000.0,
        "WPNAV_RADIUS": 200.0,
        "WPNAV_SPEED": 100.0 * craft.parameters.cruise_mps,
    }
    pilot = RotorcraftPilot(home, body, mission, settings, craft=craft)
    return Flyer(kind, home, craft, pilot, Wind(wind or WindParameters(), stream(seed, "wind", system)))


def with_home(home: Home, items: tuple[MissionItem, ...]) -> tuple[MissionItem, ...]:
    """A mission as ArduPilot numbers it: home is item 0. Without items there is none."""
    if not items:
        return ()
    latitude, longitude = math.degrees(home.latitude_rad), math.degrees(home.longitude_rad)
    return (MissionItem(WAYPOINT, latitude, longitude, home.altitude_msl_m, ABOVE_SEA), *items)
