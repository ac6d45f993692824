"""The autopilot of a helicopter or multirotor: straight legs in space, slowed down for corners, waiting, circles, landing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from adapters.mission_writing import LAND, LOITER_TO_ALTITUDE, TAKE_OFF, WAYPOINT, MissionItem
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.body import wrapped
from sim.vehicles.missions import DELAY, LOITER_TIME, LOITER_TURNS, LOITER_UNLIMITED, RETURN_HOME, SPLINE
from sim.vehicles.motion import Answer, GoAround, GoTo, TakeOff
from sim.vehicles.piloting import ACCEPTED, DECIDES_EVERY_S, Pilot
from sim.vehicles.rotorcraft import Rotorcraft, Thrust
from sim.vehicles.steering import Leg, Spot, bearing_rad, distance_m, height_on, place_on

_SPEED_PER_S, _PLACE_PER_S, _CLIMB_PER_S, _LEARNS_PER_S2 = 1.2, 0.6, 0.8, 0.15
_ASIDE_MPS = 3.0  # the most that is spent on getting back onto the leg
_HEIGHT_M = 1.5
_CREEPS_MPS = 0.6  # along a leg at least, or its end would never come
_LEAVES_GROUND_M = 2.0  # it climbs so far before it goes anywhere
_STANDS_S = 1.0
_MODES = {"STABILIZE": 0, "AUTO": 3, "GUIDED": 4, "LOITER": 5, "RTL": 6, "LAND": 9, "BRAKE": 17}


@dataclass
class RotorcraftPilot(Pilot[Thrust]):
    """One helicopter's or multirotor's."""

    craft: Rotorcraft = field(kw_only=True)
    mode: str = "STABILIZE"
    _leg: Leg | None = None
    _goal: Spot | None = None  # in GUIDED, LOITER, RTL and LAND
    _learnt: tuple[float, float] = (0.0, 0.0)  # acceleration that holds it against the wind
    _heading_rad: float = 0.0

    speed_setting: ClassVar[str] = "WPNAV_SPEED"
    speed_unit_mps: ClassVar[float] = 0.01
    modes: ClassVar[dict[str, int]] = _MODES
    by_hand: ClassVar[str] = "STABILIZE"

    @property
    def is_landed(self) -> bool:
        """On its feet."""
        return self.craft.is_on_ground

    def decide(self) -> Thrust:
        """How to tilt and climb."""
        if not self.is_armed or self.mode == "STABILIZE":
            return Thrust()
        if self.mode == "AUTO":
            return self._follow_mission()
        goal = self._goal
        assert goal is not None  # every mode but STABILIZE and AUTO begins with one
        if self.mode == "LAND":
            return self._descend(goal)
        if self.mode == "RTL" and self._is_at(goal, self._wp_radius()):
            self.mode = "LAND"
        return self._towards(goal)

    def _settle(self, mode: str) -> None:
        """Here, or home at a safe height."""
        here = self.here
        self._goal, self._heading_rad = here, self.body.attitude_rad[2]
        if mode == "RTL":
            self._goal = self._home_spot()._replace(height_m=self._way_home_m())
        self._leg = Leg(here, self._goal)

    def _home_spot(self) -> Spot:
        """The ground at home."""
        return Spot(0.0, 0.0, self.home.height_m)

    def _way_home_m(self) -> float:
        """The height at which it goes home."""
        return max(self.here.height_m, self.home.height_m + 0.01 * self.settings["RTL_ALT"])

    def take(self, order: TakeOff | GoTo | GoAround) -> Answer:
        """Rise; go to a place and hover there."""
        if isinstance(order, GoAround):
            return Answer("unsupported", "it lands where it is")
        if isinstance(order, TakeOff):
            if not self.is_armed:
                return Answer("denied", "it is not armed")
            self.enter("GUIDED")
            self._goal = self.here._replace(height_m=self.home.height_m + order.height_m)
        else:
            if self.is_landed:
                return Answer("denied", "it stands on the ground: take off first")
            height = self.here.height_m if order.height_m is None else order.height_m
            self.enter("GUIDED")
            self._goal = self.plane.spot(order.latitude_rad, order.longitude_rad, height)
        self._leg = Leg(self.here, self._goal)
        return ACCEPTED

    def _follow_mission(self) -> Thrust:
        item = self._next_item()
        if item is None:
            if not self.is_landed:
                self.notes.append("Mission complete, waiting here")
                self.enter("LOITER")
            return Thrust(is_flying=not self.is_landed)
        return self._WAYS.get(item.command, RotorcraftPilot._fly_leg)(self, item)

    def _begin(self, item: MissionItem) -> None:
        end, start = self.spot(item), self.here
        if self._leg is not None and distance_m(self._leg.end, start) < 2.0 * self._wp_radius():
            start = self._leg.end._replace(height_m=start.height_m)
        if item.command == RETURN_HOME:
            start = start._replace(height_m=self._way_home_m())
        self._leg = Leg(start, end)
        if self._leg.length_m > self._wp_radius():
            self._heading_rad = bearing_rad(start, end)
        if item.command in (LAND, RETURN_HOME):
            self.craft.ground_m = end.height_m

    def _fly_leg(self, item: MissionItem) -> Thrust:
        leg = self._leg
        assert leg is not None
        if self._is_at(leg.end, self._radius_of(item)) or self._waits_s > 0.0:
            self._waits_s += DECIDES_EVERY_S
            if self._waits_s > self._waits_at(item):
                self._reach()
        return self._along(leg, self._end_speed(item, leg))

    def _take_off(self, item: MissionItem) -> Thrust:
        here, target = self.here, self.spot(item)
        if abs(here.height_m - target.height_m) < _HEIGHT_M:
            self._leg = None
            self._reach()
        return self._towards(here._replace(height_m=target.height_m))

    def _radius_of(self, item: MissionItem) -> float:
        told = item.parameters[1]
        return told if 0.0 < told < math.inf and item.command != DELAY else self._wp_radius()

    def _waits_at(self, item: MissionItem) -> float:
        return item.parameters[0] if item.command == LOITER_TIME or 0.0 < item.parameters[0] < math.inf else 0.0

    def _wait(self, item: MissionItem) -> Thrust:
        """DELAY: where it is; LOITER_UNLIM and LOITER_TIME: at their place."""
        if item.command == DELAY:
            self._waits_s += DECIDES_EVERY_S
            if self._waits_s > item.parameters[0]:
                self._reach()
            return self._towards(self._goal_or_here())
        if item.command == LOITER_TIME:
            return self._fly_leg(item)
        return self._towards(self.spot(item))

    def _goal_or_here(self) -> Spot:
        return self.here if self._leg is None else self._leg.start

    def _fly_circle(self, item: MissionItem) -> Thrust:
        """Round a place as often as asked for."""
        radius, centre, here = item.parameters[2], self.spot(item), self.here
        radius = radius if abs(radius) >= 1.0 else self._wp_radius() * 5.0
        hand, outside = math.copysign(1.0, radius), distance_m(centre, here) - abs(radius)
        bearing = bearing_rad(centre, here)
        speed = min(self._cruise(), math.sqrt(0.5 * self.craft.parameters.accelerates_mps2 * abs(radius)))
        if abs(outside) < 0.3 * abs(radius):
            self._count_turn(centre)
            if self._turned_rad >= 2.0 * math.pi * item.parameters[0]:
                self._leg = None
                self._reach()
        course = bearing + hand * (0.5 * math.pi + math.atan(0.5 * outside))
        self._heading_rad = course
        inward = speed * speed / abs(radius)
        self._tell(centre, -hand * outside, None)
        velocity = (speed * math.cos(course), speed * math.sin(course))
        ahead = (-inward * math.cos(bearing), -inward * math.sin(bearing))
        return self._thrust(velocity, self._climb_to(centre.height_m, 0.0), ahead)

    def _land(self, item: MissionItem) -> Thrust:
        """Over the place first, then straight down."""
        leg = self._leg
        assert leg is not None
        over = leg.end._replace(height_m=max(leg.start.height_m, leg.end.height_m))
        if self.is_landed or distance_m(self.here, leg.end) < self._wp_radius() or self._waits_s > 0.0:
            self._waits_s += 0.0 if self.is_landed else DECIDES_EVERY_S
            return self._descend(leg.end)
        return self._along(Leg(leg.start, over), 0.0)

    def _descend(self, goal: Spot) -> Thrust:
        """Down to the ground, slowly at last; there it disarms."""
        if self.is_landed:
            self._turned_rad += DECIDES_EVERY_S  # how long it has stood
            if self._turned_rad >= _STANDS_S:
                if self.mode == "AUTO":
                    self._reach()
                self.is_armed, self.mode, self._turned_rad = False, "STABILIZE", 0.0
                self.notes.append("Landed, disarmed")
            return Thrust()
        above = self.here.height_m - self.craft.ground_m
        slow = 0.01 * self.settings["LAND_SPEED"]
        sink = slow if above < 0.01 * self.settings["LAND_ALT_LOW"] else self.craft.parameters.sink_mps
        self._tell(goal, None, None)
        return self._thrust(self._back_to(goal), -sink)

    def _towards(self, goal: Spot) -> Thrust:
        """To a place along the leg there, and stay."""
        here = self.here
        if here.height_m - self.craft.ground_m < _LEAVES_GROUND_M and goal.height_m > here.height_m:
            self._tell(goal, None, None)
            return self._thrust((0.0, 0.0), self._climb_to(goal.height_m, 0.0))
        if self._leg is None or self._leg.end != goal:
            self._leg = Leg(here, goal)
        return self._along(self._leg, 0.0)

    def _along(self, leg: Leg, end_mps: float) -> Thrust:
        p, here, length = self.craft.parameters, self.here, leg.length_m
        on = place_on(leg, here)
        left = length - on.along_m
        if length < 1.0 or left < 1.0:
            self._tell(leg.end, on.right_m, None)
            return self._thrust(self._back_to(leg.end), self._climb_to(leg.end.height_m, 0.0))
        slope = (leg.end.height_m - leg.start.height_m) / length
        speed = min(self._cruise(), math.sqrt(end_mps * end_mps + p.accelerates_mps2 * left))
        if slope != 0.0:
            speed = min(speed, (p.climb_mps if slope > 0.0 else p.sink_mps) / abs(slope))
        speed = max(speed, _CREEPS_MPS)
        aside = min(max(_PLACE_PER_S * on.right_m, -_ASIDE_MPS), _ASIDE_MPS)
        cosine, sine = math.cos(on.course_rad), math.sin(on.course_rad)
        height, climb = height_on(leg, on, speed)
        self._tell(leg.end._replace(height_m=height), on.right_m, None)
        velocity = (speed * cosine + aside * sine, speed * sine - aside * cosine)
        return self._thrust(velocity, self._climb_to(height, climb))

    def _end_speed(self, item: MissionItem, leg: Leg) -> float:
        """How fast the end of a leg may be passed: straight on at full speed, round a right angle hardly."""
        after = self.mission.following()
        if self._waits_at(item) > 0.0 or after is None or after.command not in self._PASSING:
            return 0.0
        turn = wrapped(bearing_rad(leg.end, self.spot(after)) - bearing_rad(leg.start, leg.end))
        return self._cruise() * max(math.cos(turn), 0.0)

    def _back_to(self, goal: Spot) -> tuple[float, float]:
        here = self.here
        away, course = distance_m(here, goal), bearing_rad(here, goal)
        speed = min(_PLACE_PER_S * away, self._cruise())
        return speed * math.cos(course), speed * math.sin(course)

    def _climb_to(self, height_m: float, ahead_mps: float) -> float:
        p = self.craft.parameters
        return min(max(ahead_mps + _CLIMB_PER_S * (height_m - self.here.height_m), -p.sink_mps), p.climb_mps)

    def _thrust(
        self, velocity: tuple[float, float], climb_mps: float, ahead: tuple[float, float] = (0.0, 0.0)
    ) -> Thrust:
        """The tilt for a velocity north and east; what the wind takes is learnt. `ahead`: its change that is foreseen."""
        p, (north, east, _) = self.craft.parameters, self.body.velocity_mps
        lacking = (velocity[0] - north, velocity[1] - east)
        if not self.is_landed and math.hypot(*lacking) < _ASIDE_MPS:
            step = _LEARNS_PER_S2 * DECIDES_EVERY_S
            self._learnt = (self._learnt[0] + step * lacking[0], self._learnt[1] + step * lacking[1])
        wanted = [
            _SPEED_PER_S * lack + learnt + p.drag_per_s * has + foreseen
            for lack, learnt, has, foreseen in zip(lacking, self._learnt, (north, east), ahead, strict=True)
        ]
        size, most = math.hypot(*wanted), STANDARD_GRAVITY_MPS2 * math.tan(p.tilt_rad)
        share = min(most / size, 1.0) if size > 0.0 else 1.0
        return Thrust(wanted[0] * share, wanted[1] * share, climb_mps, self._heading_rad, is_flying=True)

    def _is_at(self, goal: Spot, radius_m: float) -> bool:
        return distance_m(self.here, goal) < radius_m and abs(self.here.height_m - goal.height_m) < _HEIGHT_M

    def _wp_radius(self) -> float:
        return 0.01 * self.settings["WPNAV_RADIUS"]

    def _cruise(self) -> float:
        return 0.01 * self.settings["WPNAV_SPEED"]

    _PASSING: ClassVar[frozenset[int]] = frozenset((WAYPOINT, SPLINE))
    _WAYS: ClassVar[dict[int, Callable[[RotorcraftPilot, MissionItem], Thrust]]] = {
        TAKE_OFF: _take_off,
        LAND: _land,
        RETURN_HOME: _land,
        LOITER_TURNS: _fly_circle,
        **dict.fromkeys((DELAY, LOITER_UNLIMITED, LOITER_TIME), _wait),
        LOITER_TO_ALTITUDE: _fly_leg,
    }
