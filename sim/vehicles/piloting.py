"""What the pilots of all vehicles share: modes, arming, orders, the mission's items as places, and what they tell people."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Generic, TypeVar

from adapters.mission_writing import ABOVE_SEA, CHANGE_SPEED, MissionItem
from sim.vehicles.body import Body, wrapped
from sim.vehicles.missions import RETURN_HOME, Mission
from sim.vehicles.motion import (
    Answer,
    Arm,
    ChangeSpeed,
    GoAround,
    GoTo,
    GoToItem,
    Home,
    Order,
    Progress,
    SetMode,
    TakeOff,
)
from sim.vehicles.steering import Plane, Spot, bearing_rad, distance_m

DECIDES_EVERY_S = 0.1
_ABOVE_SEA_TOO = 5  # MAV_FRAME_GLOBAL_INT
_HIGHEST_M = 100_000.0
ACCEPTED = Answer()

C = TypeVar("C")


@dataclass
class Pilot(ABC, Generic[C]):
    """Decides ten times a second what the vehicle's controls (`C`) are to be. `settings` are ArduPilot's parameters by name."""

    home: Home
    body: Body
    mission: Mission
    settings: dict[str, float]
    mode: str = ""
    is_armed: bool = False
    notes: list[str] = field(default_factory=list)  # short sentences for people, as they come up; they stay
    progress: Progress = Progress()
    plane: Plane = field(init=False)
    _begun: tuple[int, MissionItem] | None = None  # the item that is being flown
    _waits_s: float = 0.0
    _turned_rad: float = 0.0
    _bearing_rad: float | None = None  # from a circle's centre, at the decision before

    speed_setting: ClassVar[str]  # the parameter that DO_CHANGE_SPEED changes
    speed_unit_mps: ClassVar[float] = 1.0
    modes: ClassVar[dict[str, int]]  # ArduPilot's number of each mode
    by_hand: ClassVar[str]  # the one of them in which a person flies

    def __post_init__(self) -> None:
        self.plane = Plane.about(self.home)

    @property
    @abstractmethod
    def is_landed(self) -> bool:
        """Whether the vehicle stands on the ground."""

    @abstractmethod
    def decide(self) -> C:
        """The controls for the next tenth of a second."""

    def enter(self, mode: str) -> Answer:
        """Change to a mode of `modes`: by hand only on the ground; a mission that is complete begins anew."""
        if mode == self.by_hand and not self.is_landed:
            return Answer("denied", "nobody would fly it by hand")
        if mode == "AUTO" and len(self.mission.items) < 2:
            return Answer("denied", "there is no mission")
        if mode == "AUTO" and self.mission.is_complete:
            self.mission.restart()
        self.mode, self._begun = mode, None
        self._settle(mode)
        return ACCEPTED

    @abstractmethod
    def _settle(self, mode: str) -> None:
        """Where a mode that has just been entered leads to."""

    def order(self, order: Order) -> Answer:
        """Do as told; what a vehicle cannot do is unsupported."""
        if isinstance(order, Arm):
            return self._arm(order)
        if isinstance(order, SetMode):
            if order.name not in self.modes:
                return Answer("unsupported", f"there is no mode {order.name}")
            return self.enter(order.name)
        if isinstance(order, ChangeSpeed):
            return self._change_speed(order.speed_mps)
        if isinstance(order, GoToItem):
            to_do = self.mission.go_to(order.number)
            if to_do is None:
                return Answer("denied", f"the mission has no item {order.number}")
            self._do(to_do)
            self._begun = None
            return ACCEPTED
        why = senseless(order)
        return Answer("denied", why) if why else self.take(order)

    @abstractmethod
    def take(self, order: TakeOff | GoTo | GoAround) -> Answer:
        """The orders that each kind of vehicle carries out in its own way."""

    @property
    def here(self) -> Spot:
        """Where the vehicle is."""
        return self.plane.of(self.body)

    def spot(self, item: MissionItem) -> Spot:
        """Where an item leads; one without a place: here. Terrain is level here, and as high as home."""
        if item.command == RETURN_HOME:
            return self._home_spot()
        height = self.home.height_m + item.altitude_m
        if item.frame in (ABOVE_SEA, _ABOVE_SEA_TOO):
            height = self.home.geoid_separation_m + item.altitude_m
        if item.latitude_deg == item.longitude_deg == 0.0:
            north, east, _ = self.here
            return Spot(north, east, height)
        return self.plane.spot(math.radians(item.latitude_deg), math.radians(item.longitude_deg), height)

    def _arm(self, order: Arm) -> Answer:
        if not order.is_armed and not self.is_landed and not order.is_forced:
            return Answer("denied", "it is in the air")
        if order.is_armed != self.is_armed:
            self.is_armed = order.is_armed
            self._begun = None
            self.notes.append("Armed" if order.is_armed else "Disarmed")
            if not order.is_armed:
                self.mission.restart()
        return ACCEPTED

    def _change_speed(self, speed_mps: float) -> Answer:
        if not 0.0 < speed_mps < math.inf:
            return Answer("denied", "a speed is above 0 m/s")
        self.settings[self.speed_setting] = speed_mps / self.speed_unit_mps
        return ACCEPTED

    def _next_item(self) -> MissionItem | None:
        """The item to be flown now; None where there is none. `_begin` has been called when it is a new one."""
        if self.mission.item is None and not self.mission.is_complete:
            self._do(self.mission.advance())
        item = self.mission.item
        if item is None:
            return None
        if self._begun is None or self._begun[0] != self.mission.current or self._begun[1] is not item:
            self._begun = (self.mission.current, item)
            self._waits_s, self._turned_rad, self._bearing_rad = 0.0, 0.0, None
            self._begin(item)
        return item

    @abstractmethod
    def _begin(self, item: MissionItem) -> None:
        """A new item is to be flown from here."""

    def _reach(self) -> None:
        """The current item is done."""
        self.notes.append(f"Reached item {self.mission.current}")
        self._do(self.mission.reach())
        self._begun = None

    @abstractmethod
    def _home_spot(self) -> Spot:
        """Where it ends when it goes home."""

    def _count_turn(self, centre: Spot) -> None:
        """How far it has gone round a place since the decision before."""
        bearing = bearing_rad(centre, self.here)
        if self._bearing_rad is not None:
            self._turned_rad += abs(wrapped(bearing - self._bearing_rad))
        self._bearing_rad = bearing

    def _do(self, items: list[MissionItem]) -> None:
        """Commands of the mission that are no places."""
        for item in items:
            if item.command == CHANGE_SPEED:  # -1 leaves the speed as it is, and is none
                self._change_speed(item.parameters[1])

    def _tell(self, target: Spot, cross_track_m: float | None, speed_error_mps: float | None) -> None:
        """What NAV_CONTROLLER_OUTPUT says."""
        here = self.here
        away, towards = distance_m(here, target), bearing_rad(here, target)
        above = target.height_m - here.height_m
        self.progress = Progress(away, towards, cross_track_m, above, speed_error_mps)


def senseless(order: TakeOff | GoTo | GoAround) -> str:
    """Why an order can be nobody's intention; empty for one that can."""
    height = order.height_m
    if isinstance(order, GoTo):
        is_place = abs(order.latitude_rad) <= 0.5 * math.pi and abs(order.longitude_rad) <= math.pi
        height = 0.0 if height is None else height
        return "" if is_place and abs(height) <= _HIGHEST_M else "that is no place on earth"
    return "" if height is None or 0.0 <= height <= _HIGHEST_M else "that is no height to climb to"
