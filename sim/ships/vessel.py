"""A ship as a vehicle among others (`sim.vehicles.motion.Vehicle`): she carries a mission, an autopilot, and lies in a sea.

    HOLD      engine stopped, rudder amidships
    AUTO      her own autopilot takes her along the mission; stopped at its end
    GUIDED    to one place, on the leg from where she was told
    RTL       the same, home
    MANUAL    rudder and engine are ordered from outside: by a person, or by an autopilot in another process (`helmsman.py`)

Her mission's legs begin at the item before, and one is done within `WP_RADIUS` of its end, or abeam of it; in MANUAL too, so that
whoever steers is told the cross-track error. Her engine brings her to the ordered speed as her way allows.

Source: 002-5 2, 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from adapters.mission_writing import CHANGE_SPEED, MissionItem
from sim.ships.autopilots import Autopilot, Memory, listen, steer
from sim.ships.hull import Hull, Ship, Weather, ground_velocity, sail
from sim.ships.track_control import Along, Route, TrackControl, deviation, is_arrived, wanted_heading
from sim.ships.voyage import STEP_S
from sim.ships.waves import Rolling, Waves
from sim.vehicles.body import Body
from sim.vehicles.flying import SURFACE_BOAT
from sim.vehicles.missions import RETURN_HOME, Mission
from sim.vehicles.motion import (
    Answer,
    Arm,
    ChangeSpeed,
    GoTo,
    GoToItem,
    Home,
    Moment,
    Order,
    Progress,
    SetMode,
    Vector,
)
from sim.vehicles.piloting import ACCEPTED, senseless
from sim.vehicles.steering import Plane, Spot, bearing_rad, distance_m

Floats = NDArray[np.float64]

MODES = {"MANUAL": 0, "HOLD": 4, "AUTO": 10, "RTL": 11, "GUIDED": 15}  # ArduPilot Rover's
_ENGINE_S = 60.0  # how slowly the speed follows the engine
WAYPOINT_RADIUS_M = 30.0


@dataclass
class Vessel:
    """One ship. `settings` are parameters by ArduPilot's names; `notes` what she has had to say to people."""

    home: Home
    hull: Hull
    autopilot: Autopilot
    mission: Mission
    weather: Weather = Weather()
    waves: Waves | None = None
    generator: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    control: TrackControl = TrackControl()
    mode: str = "HOLD"
    is_armed: bool = False
    settings: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    progress: Progress = Progress()
    moment: Moment = field(init=False)
    plane: Plane = field(init=False)
    kind: int = SURFACE_BOAT
    modes: dict[str, int] = field(default_factory=lambda: dict(MODES))
    step_s: float = STEP_S
    is_landed: bool = True  # she always stands on the sea
    throttle: float = 0.0

    def __post_init__(self) -> None:
        self.settings = {"CRUISE_SPEED": self.hull.speed_mps, "WP_RADIUS": WAYPOINT_RADIUS_M} | self.settings
        self.plane, self._body = Plane.about(self.home), Body.at(self.home)
        self._ship = Ship.under_way((), 0.0, self.home.heading_rad)
        self._memory: Memory = self.autopilot.start(self._ship.heading_rad)
        self._along, self._leg_of = Along.start(()), (-1, "")
        self._route: Route | None = None
        self._goal: Spot | None = None
        self._ordered = np.zeros(())
        self._steps = 0
        self._sea = None if self.waves is None else Rolling.of(self.waves, self.step_s, self._fresh())
        self.moment = self._tell((0.0, 0.0, 0.0))

    def get_under_way(self) -> None:
        """Begin at cruising speed on her heading, armed, in AUTO: a ship that is at sea when a scene begins."""
        self.is_armed = True
        self._ship = replace(self._ship, speed_mps=np.array(self.settings["CRUISE_SPEED"]))
        east, north = ground_velocity(self._ship, self.weather)
        self._body.velocity_mps = (float(north), float(east), 0.0)
        self.order(SetMode("AUTO"))
        self.moment = self._tell((0.0, 0.0, 0.0))

    @property
    def rudder_rad(self) -> float:
        """Where her rudder is, positive to starboard."""
        return float(self._ship.rudder_rad)

    def order(self, order: Order) -> Answer:
        """Do as told; what a ship cannot do is unsupported."""
        if isinstance(order, Arm):
            self.is_armed = order.is_armed
        elif isinstance(order, SetMode):
            if order.name not in self.modes:
                return Answer("unsupported", f"there is no mode {order.name}")
            if order.name == "AUTO" and len(self.mission.items) < 2:
                return Answer("denied", "there is no mission")
            if order.name == "AUTO" and self.mission.is_complete:
                self.mission.restart()
            self._enter(order.name)
        elif isinstance(order, ChangeSpeed):
            return self._change_speed(order.speed_mps)
        elif isinstance(order, GoTo):
            if why := senseless(order):
                return Answer("denied", why)
            self._goal = self.plane.spot(order.latitude_rad, order.longitude_rad, self.home.height_m)
            self._enter("GUIDED")
        elif isinstance(order, GoToItem):
            passed = self.mission.go_to(order.number)
            if passed is None:
                return Answer("denied", f"the mission has no item {order.number}")
            self._do(passed)
        else:
            return Answer("unsupported", "a ship does not fly")
        return ACCEPTED

    def take_helm(self, rudder_rad: float, throttle: float) -> None:
        """What MANUAL does from the next step on: a rudder angle, positive to starboard, and a share of the cruising speed."""
        self._ordered, self.throttle = np.array(rudder_rad), min(max(throttle, 0.0), 1.0)

    def step(self) -> Moment:
        """A fifth of a second further."""
        route = self._find_route()
        order = self._steer(route)
        running = self.is_armed and (self.mode == "MANUAL" or route is not None)
        self.throttle = self.throttle if self.mode == "MANUAL" else float(running)
        wanted_mps = self.settings["CRUISE_SPEED"] * self.throttle * running
        before = self._ship.speed_mps
        speed = before + (wanted_mps - before) * -math.expm1(-self.step_s / _ENGINE_S)
        self._ship = replace(sail(self.hull, self._ship, order, self.weather, self.step_s), speed_mps=speed)
        if self._sea is not None:
            self._sea.step(self._fresh())
        self._steps += 1
        heading, rate = self._measured()
        self._memory = listen(self.autopilot, self._memory, heading, rate, order, self.step_s)
        east, north = ground_velocity(self._ship, self.weather)
        self._body.move((float(north), float(east), 0.0), (0.0, 0.0, float(heading)), self.step_s)
        self._settle_place()
        self.moment = self._tell(self._body.force_mps2)
        return self.moment

    def _steer(self, route: Route | None) -> Floats:
        """The rudder that is ordered, and what NAV_CONTROLLER_OUTPUT says."""
        heading, rate = self._measured()
        wanted = None
        if route is None:
            self.progress = Progress()
        else:
            place, ground = (self._ship.east_m, self._ship.north_m), ground_velocity(self._ship, self.weather)
            steered = self._memory.heading(heading)
            wanted, self._along = wanted_heading(self.control, route, self._along, place, steered, ground, self.step_s)
            self._say_progress(route)
        if self.mode == "MANUAL":
            return self._ordered
        if wanted is None:
            return np.zeros(())
        speed = self._ship.speed_mps
        order, self._memory = steer(self.autopilot, self._memory, heading, rate, speed, wanted, self.step_s)
        return order

    def _find_route(self) -> Route | None:
        """The leg that she is on, as a route of one leg; done ones are passed, and she stops at the end."""
        here = (self._ship.east_m, self._ship.north_m)
        if self._route is not None and self._is_done(self._route, here):
            self._pass()
        wanted = self._wanted_leg()
        if wanted is None:
            self._route = None
        elif wanted != self._leg_of:
            self._leg_of = wanted
            start, end = self._ends()
            points = np.array([[start.east_m, start.north_m], [end.east_m, end.north_m]])
            self._along = replace(self._along, integral_m=np.zeros(()))
            if distance_m(start, end) > 1.0:
                self._route = Route(points, self.settings["WP_RADIUS"])
            else:
                self._pass()
        return self._route

    def _wanted_leg(self) -> tuple[int, str] | None:
        if self.mode in ("GUIDED", "RTL"):
            return (-1, f"{self._goal}") if self._goal is not None else None
        if self.mode not in ("AUTO", "MANUAL"):
            return None
        if self.mission.item is None and not self.mission.is_complete and self.mission.items:
            self._do(self.mission.advance())
        return None if self.mission.item is None else (self.mission.current, f"{self.mission.item}")

    def _ends(self) -> tuple[Spot, Spot]:
        """Where the wanted leg begins and ends."""
        here = Spot(float(self._ship.north_m), float(self._ship.east_m), self.home.height_m)
        if self._goal is not None and self.mode in ("GUIDED", "RTL"):
            return here, self._goal
        item = self.mission.item
        before = self.mission.items[self.mission.current - 1]
        return self._spot(before) or here, (self._spot(item) if item else None) or here

    def _spot(self, item: MissionItem) -> Spot | None:
        if item.command == RETURN_HOME:
            return Spot(0.0, 0.0, self.home.height_m)
        if item.latitude_deg == item.longitude_deg == 0.0:
            return None
        latitude, longitude = math.radians(item.latitude_deg), math.radians(item.longitude_deg)
        return self.plane.spot(latitude, longitude, self.home.height_m)

    @staticmethod
    def _is_done(route: Route, here: tuple[Floats, Floats]) -> bool:
        only = np.zeros((), np.int64)
        _, end = route.leg(only)
        near = math.hypot(float(end[0] - here[0]), float(end[1] - here[1])) < route.reach_m
        return near or bool(is_arrived(route, only, *here))

    def _pass(self) -> None:
        """The end of the leg is reached."""
        self._route, self._leg_of = None, (-1, "")
        if self.mode in ("GUIDED", "RTL"):
            self._goal = None
            self._enter("HOLD")
        elif self.mission.item is not None:
            self.notes.append(f"Reached item {self.mission.current}")
            self._do(self.mission.reach())
            if self.mission.is_complete and self.mode == "AUTO":
                self._enter("HOLD")

    def _enter(self, mode: str) -> None:
        if mode not in ("GUIDED", "RTL"):
            self._goal = None
        if mode == "RTL":
            self._goal = Spot(0.0, 0.0, self.home.height_m)
        if mode != self.mode:
            self.mode, self._route, self._leg_of = mode, None, (-1, "")
            self._ordered, self.throttle = np.zeros(()), 0.0

    def _change_speed(self, speed_mps: float) -> Answer:
        if not 0.0 < speed_mps < math.inf:
            return Answer("denied", "a speed is above 0 m/s")
        self.settings["CRUISE_SPEED"] = speed_mps
        return ACCEPTED

    def _do(self, items: list[MissionItem]) -> None:
        for item in items:
            if item.command == CHANGE_SPEED:
                self._change_speed(item.parameters[1])

    def _say_progress(self, route: Route) -> None:
        off = deviation(route, np.zeros((), np.int64), self._ship.east_m, self._ship.north_m)
        end = route.points_m[1]
        here = Spot(float(self._ship.north_m), float(self._ship.east_m), 0.0)
        there = Spot(float(end[1]), float(end[0]), 0.0)
        speed_error = self.settings["CRUISE_SPEED"] - float(self._ship.speed_mps)
        away, towards = distance_m(here, there), bearing_rad(here, there)
        self.progress = Progress(away, towards, float(off.right_m), 0.0, speed_error)

    def _measured(self) -> tuple[Floats, Floats]:
        if self._sea is None:
            return self._ship.heading_rad, self._ship.rate_radps
        return self._ship.heading_rad + self._sea.now[0], self._ship.rate_radps + self._sea.now[1]

    def _settle_place(self) -> None:
        """The place on the plane is that of the body on the earth: what is said, and what an inertial unit feels, agree."""
        place = self.plane.of(self._body)
        self._ship = replace(self._ship, east_m=np.array(place.east_m), north_m=np.array(place.north_m))

    def _fresh(self) -> Floats:
        return self.generator.standard_normal(2)

    def _tell(self, force_mps2: Vector) -> Moment:
        body = self._body
        return Moment(
            self._steps * self.step_s,
            body.latitude_rad,
            body.longitude_rad,
            body.height_m,
            body.velocity_mps,
            (0.0, 0.0, body.attitude_rad[2]),
            body.rate_radps,
            force_mps2,
            float(self._ship.speed_mps),
            (0.0, 0.0, 0.0),
            self.throttle,
        )
