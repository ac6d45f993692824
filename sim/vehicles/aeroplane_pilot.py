"""The autopilot of an aeroplane: take-off run, legs, circles, the glide path to a standstill, going around, home at the end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

from adapters.mission_writing import LAND, LOITER_TO_ALTITUDE, TAKE_OFF, MissionItem
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.aeroplane import Aeroplane, Controls
from sim.vehicles.energy import hold_energy
from sim.vehicles.missions import DELAY, LOITER_TIME, LOITER_TURNS, LOITER_UNLIMITED, RETURN_HOME
from sim.vehicles.motion import Answer, GoAround, GoTo, TakeOff
from sim.vehicles.piloting import ACCEPTED, DECIDES_EVERY_S, Pilot
from sim.vehicles.steering import Leg, OnLeg, Spot, circle, distance_m, follow, height_on, place_on

_IN_CIRCLE_M = 30.0  # so near to it a circle counts as begun
_REACHED_HEIGHT_M = 3.0
_FLARE_S = 4.0  # the flare begins where the glide path is so many seconds of sinking above the ground
_TOUCH_MPS = 0.4
_STANDS_S = 2.0  # before it disarms
_STEERS_RADPS = 0.3  # on wheels
_DECISION_M, _CLIMBS_OUT_M = 30.0, 60.0
_FLARE_BANK_RAD = math.radians(10.0)
_MODES = {"MANUAL": 0, "AUTO": 10, "RTL": 11, "LOITER": 12, "TAKEOFF": 13, "GUIDED": 15}


@dataclass
class AeroplanePilot(Pilot[Controls]):
    """One aeroplane's. `goes_around`: how often it breaks off a landing by itself, 30 m above the ground."""

    aeroplane: Aeroplane = field(kw_only=True)
    goes_around: int = field(default=0, kw_only=True)
    mode: str = "MANUAL"
    _leg: Leg | None = None
    _climbs_to_m: float | None = None  # going around
    _flares: bool = False
    _centre: Spot | None = None  # of the circle in GUIDED and LOITER
    _radius_m: float = 0.0

    speed_setting: ClassVar[str] = "AIRSPEED_CRUISE"
    modes: ClassVar[dict[str, int]] = _MODES
    by_hand: ClassVar[str] = "MANUAL"

    @property
    def is_landed(self) -> bool:
        """On its wheels."""
        return self.aeroplane.is_on_ground

    def decide(self) -> Controls:
        """What bank, climb and throttle are to be."""
        if not self.is_armed or self.mode == "MANUAL":
            return Controls(is_braking=True)
        if self.mode == "AUTO":
            return self._follow_mission()
        if self.is_landed or self.mode == "TAKEOFF":
            return self._leave_ground(self._hold().height_m)
        return self._circle(self._hold(), self._radius_m or self._own_radius())

    def _settle(self, mode: str) -> None:
        """A circle, about home or where it is."""
        self._climbs_to_m = None
        self._centre, self._radius_m = self.here, 0.0
        if mode == "RTL":
            self._centre = self._home_spot()
        elif self.is_landed:
            self._centre = self.here._replace(height_m=self.home.height_m + self.settings["TKOFF_ALT"])

    def take(self, order: TakeOff | GoTo | GoAround) -> Answer:
        """Take off straight ahead and circle; circle about a place; break off a landing."""
        if isinstance(order, GoAround):
            item = self.mission.item
            if self.mode != "AUTO" or item is None or item.command != LAND or self.is_landed:
                return Answer("denied", "it is not on its way down to land")
            self._go_around(item, order.height_m)
            return ACCEPTED
        if isinstance(order, TakeOff):
            if not self.is_landed or not self.is_armed:
                return Answer("denied", "it is in the air" if self.is_armed else "it is not armed")
            self.settings["TKOFF_ALT"] = order.height_m
            return self.enter("TAKEOFF")
        height = self.here.height_m if order.height_m is None else order.height_m
        if self.is_landed:
            return Answer("denied", "it stands on the ground: take off first")
        self.enter("GUIDED")
        self._centre = self.plane.spot(order.latitude_rad, order.longitude_rad, height)
        self._radius_m = order.radius_m or 0.0
        return ACCEPTED

    def _home_spot(self) -> Spot:
        """The middle of the circle over home."""
        return Spot(0.0, 0.0, self.home.height_m + self.settings["RTL_ALTITUDE"])

    def _hold(self) -> Spot:
        assert self._centre is not None  # every mode but MANUAL and AUTO begins with one
        return self._centre

    def _own_radius(self) -> float:
        return self.settings["WP_LOITER_RAD"]

    def _follow_mission(self) -> Controls:
        if self._climbs_to_m is not None:
            return self._climb_out(self._climbs_to_m)
        item = self._next_item()
        if item is None:
            if not self.is_landed:
                self.notes.append("Mission complete, going home")
                self.enter("RTL")
                return self.decide()
            return Controls(is_braking=True)
        flown = self._WAYS.get(item.command, AeroplanePilot._fly_leg)
        if self.is_landed and item.command != LAND:
            flown = AeroplanePilot._take_off
        return flown(self, item)

    def _begin(self, item: MissionItem) -> None:
        """Legs begin where the last one ended, so that a turn's overshoot is made good, unless that is not where it is."""
        end, here = self.spot(item), self.here
        start = here
        if self._leg is not None and not self.is_landed and distance_m(self._leg.end, here) < self._near_m:
            north, east, _ = self._leg.end
            start = Spot(north, east, here.height_m)
        self._leg, self._flares = Leg(start, end), False
        if item.command == LAND:
            self.aeroplane.ground_m = end.height_m

    @property
    def _near_m(self) -> float:
        return 2.0 * self.settings["WP_RADIUS"]

    def _take_off(self, item: MissionItem) -> Controls:
        target = self.spot(item)
        if item.command == TAKE_OFF and self.here.height_m > target.height_m - _REACHED_HEIGHT_M and not self.is_landed:
            self._reach()
        return self._leave_ground(target.height_m)

    def _leave_ground(self, height_m: float) -> Controls:
        """Along the way it points, wheels down and then climbing, until that height; then, in TAKEOFF, circle."""
        if self.is_landed and self.aeroplane.body.velocity_mps == (0.0, 0.0, 0.0):
            yaw, here = self.body.attitude_rad[2], self.here
            ahead = Spot(here.north_m + 1e4 * math.cos(yaw), here.east_m + 1e4 * math.sin(yaw), height_m)
            self._leg = Leg(here, ahead)
        if not self.is_landed and self.mode == "TAKEOFF" and self.here.height_m > height_m - _REACHED_HEIGHT_M:
            north, east, _ = self.here
            self.mode, self._centre = "LOITER", Spot(north, east, height_m)
        assert self._leg is not None
        pull, _ = self._pull_to(self._leg)
        if self.is_landed:
            return Controls(throttle=1.0, turn_radps=self._steer(pull), may_lift=True)
        return hold_energy(self.aeroplane, height_m, 0.0, self._cruise(), 0.5 * self._bank(pull))

    def _fly_leg(self, item: MissionItem) -> Controls:
        """Along a leg; its height changes evenly over it, as far as the aeroplane can."""
        leg = self._leg
        assert leg is not None
        pull, on = self._pull_to(leg)
        if on.along_m >= leg.length_m or distance_m(self.here, leg.end) < self._radius_of(item):
            self._reach()
        height, climb = height_on(leg, on, self._ground_speed())
        self._tell(leg.end._replace(height_m=height), on.right_m, self._speed_error())
        return hold_energy(self.aeroplane, height, climb, self._cruise(), self._bank(pull))

    def _radius_of(self, item: MissionItem) -> float:
        told = item.parameters[1]
        return told if item.command != TAKE_OFF and 0.0 < told < math.inf else self.settings["WP_RADIUS"]

    def _fly_circle(self, item: MissionItem) -> Controls:
        """Round a place until what the item asks for has come about."""
        radius = item.parameters[1 if item.command == LOITER_TO_ALTITUDE else 2]
        if item.command == DELAY or not abs(radius) >= 1.0:
            radius = self._own_radius()
        centre = self.spot(item)
        if item.command == DELAY and self._leg is not None:
            centre = self._leg.start
        controls = self._circle(centre, radius)
        is_in = abs(distance_m(self.here, centre) - abs(radius)) < max(_IN_CIRCLE_M, 0.2 * abs(radius))
        if is_in:
            self._waits_s += DECIDES_EVERY_S
            self._count_turn(centre)
        amount = item.parameters[0]
        is_over = {
            RETURN_HOME: True,
            LOITER_TURNS: self._turned_rad >= 2.0 * math.pi * amount,
            LOITER_TIME: self._waits_s >= amount,
            DELAY: self._waits_s >= amount,
            LOITER_TO_ALTITUDE: abs(self.here.height_m - centre.height_m) < _REACHED_HEIGHT_M,
        }
        if is_in and is_over.get(item.command, False):
            self._leg = Leg(centre, self.here)  # the next leg begins where the circle is left
            self._reach()
        return controls

    def _circle(self, centre: Spot, radius_m: float) -> Controls:
        north, east, _ = self.body.velocity_mps
        pull, outside = circle(self.here, centre, radius_m, north, east, self.settings["NAVL1_PERIOD"])
        self._tell(centre, -math.copysign(outside, radius_m), self._speed_error())
        return hold_energy(self.aeroplane, centre.height_m, 0.0, self._cruise(), self._bank(pull))

    def _land(self, item: MissionItem) -> Controls:
        """Down the leg to the place of landing, flare, and brake to a standstill on its line."""
        leg = self._leg
        assert leg is not None
        pull, on = self._pull_to(leg)
        self._tell(leg.end, on.right_m, self._speed_error())
        if self.is_landed:
            return self._roll_out(pull)
        above, speed = self.here.height_m - leg.end.height_m, self._ground_speed()
        if self.goes_around > 0 and above <= _DECISION_M:
            self.goes_around -= 1
            return self._climb_out(self._go_around(item, None))
        height, climb = height_on(leg, on, speed)
        self._flares |= above < 0.5 * _FLARE_S * -climb or on.along_m > leg.length_m
        if self._flares:
            wanted = -max(2.0 * above / _FLARE_S, _TOUCH_MPS)
            wanted += 0.5 * (wanted + self.body.velocity_mps[2])
            bank = min(max(self._bank(pull), -_FLARE_BANK_RAD), _FLARE_BANK_RAD)
            return Controls(bank, math.asin(max(wanted / self.aeroplane.airspeed_mps, -0.3)))
        return hold_energy(self.aeroplane, height, climb, self.aeroplane.parameters.approach_mps, self._bank(pull))

    def _roll_out(self, pull: float) -> Controls:
        if self._ground_speed() == 0.0:
            self._waits_s += DECIDES_EVERY_S
            if self._waits_s >= _STANDS_S:
                self._reach()
                self.is_armed, self.mode = False, "MANUAL"
                self.notes.append("Landed, disarmed")
        return Controls(turn_radps=self._steer(pull), is_braking=True)

    def _go_around(self, item: MissionItem, height_m: float | None) -> float:
        """The height to which it climbs."""
        self._climbs_to_m = self.spot(item).height_m + (height_m or _CLIMBS_OUT_M)
        self.notes.append("Going around")
        return self._climbs_to_m

    def _climb_out(self, height_m: float) -> Controls:
        """Straight on along the runway's line; then the approach from its beginning again."""
        assert self._leg is not None
        pull, on = self._pull_to(self._leg)
        if self.here.height_m > height_m - _REACHED_HEIGHT_M and on.along_m > self._leg.length_m:
            self._climbs_to_m = None
            begins = self.mission.landing_sequence()
            self._leg, self._begun = None, None
            self._do(self.mission.go_to(max(self.mission.current - 1, 1) if begins is None else begins) or [])
        return hold_energy(self.aeroplane, height_m, 0.0, self._cruise(), self._bank(pull))

    def _pull_to(self, leg: Leg) -> tuple[float, OnLeg]:
        on = place_on(leg, self.here)
        north, east, _ = self.body.velocity_mps
        return follow(on, north, east, self.settings["NAVL1_PERIOD"]), on

    def _bank(self, pull_mps2: float) -> float:
        limit = math.radians(self.settings["ROLL_LIMIT_DEG"])
        return min(max(math.atan(pull_mps2 / STANDARD_GRAVITY_MPS2), -limit), limit)

    def _steer(self, pull_mps2: float) -> float:
        speed = max(self._ground_speed(), 1.0)
        return min(max(pull_mps2 / speed, -_STEERS_RADPS), _STEERS_RADPS)

    def _ground_speed(self) -> float:
        return math.hypot(self.body.velocity_mps[0], self.body.velocity_mps[1])

    def _cruise(self) -> float:
        p = self.aeroplane.parameters
        return min(max(self.settings["AIRSPEED_CRUISE"], 1.1 * p.slowest_mps), p.fastest_mps)

    def _speed_error(self) -> float:
        return self._cruise() - self.aeroplane.airspeed_mps

    _WAYS: ClassVar[dict[int, Callable[[AeroplanePilot, MissionItem], Controls]]] = {
        TAKE_OFF: _take_off,
        LAND: _land,
        **dict.fromkeys(
            (LOITER_UNLIMITED, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALTITUDE, DELAY, RETURN_HOME), _fly_circle
        ),
    }
