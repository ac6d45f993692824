"""An autopilot in a process of its own: it reads a ship's MAVLink and steers her by MANUAL_CONTROL.

    ship                                             helmsman
    HEARTBEAT (surface boat)                    ->
                                                <-   MISSION_REQUEST_LIST, MISSION_REQUEST_INT ..., MISSION_ACK
                                                <-   COMMAND_LONG: arm; DO_SET_MODE MANUAL, until her heartbeat shows both
    GLOBAL_POSITION_INT: place, velocity        ->
    VFR_HUD: airspeed, of the water             ->
    ATTITUDE: heading, rate of turn             ->   (of the same time as the position)
                                                <-   MANUAL_CONTROL: y rudder (1000: hard to starboard), z engine (1000: cruise)
    ... the end of the mission                  <-   COMMAND_LONG: DO_SET_MODE HOLD

Each pair of position and attitude is answered by one MANUAL_CONTROL. That message is what ArduPilot's boats take for a
person's stick (its y steers, its z is the throttle); a step of y is 0.035 degrees of rudder.
Track control and the heading autopilot are those of one process, fed with what came over the wire.

Pure: frames in, messages out; no socket, no clock. Source: 002-5 2 (simulation on two computers).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.mavlink_frames import Frame, fields
from adapters.mission_client import MISSION_COUNT, QUIET_NS, Ask, MissionClient
from sim.ships.autopilots import Autopilot, Memory, listen, steer
from sim.ships.track_control import Along, Route, TrackControl, is_arrived, wanted_heading
from sim.ships.vessel import MODES, WAYPOINT_RADIUS_M
from sim.ships.voyage import STEP_S
from sim.vehicles.flying import SURFACE_BOAT
from sim.vehicles.missions import LAST_NAVIGATION, RETURN_HOME
from sim.vehicles.motion import Home
from sim.vehicles.steering import Plane, distance_m

Floats = NDArray[np.float64]

HEARTBEAT, _heartbeat = fields("HEARTBEAT", "custom_mode", "type", "base_mode")
POSITION, _position = fields("GLOBAL_POSITION_INT", "time_boot_ms", "lat", "lon", "vx", "vy")
SPEED, _speed = fields("VFR_HUD", "airspeed", "groundspeed")
ATTITUDE, _attitude = fields("ATTITUDE", "time_boot_ms", "yaw", "yawspeed")
ITEM, _item = fields("MISSION_ITEM_INT", "x", "y", "z", "seq", "command")
ACK, _ = fields("MISSION_ACK", "type", "target_system")
_ARM, _SET_MODE, _CUSTOM_MODE, _ARMED = 400, 176, 1, 128
MANUAL, HOLD = MODES["MANUAL"], MODES["HOLD"]
FULL = 1000


@dataclass
class Helmsman:
    """Steers one ship. `waypoint_m`: how near an item counts as reached. `is_done` when she has arrived and holds."""

    autopilot: Autopilot
    control: TrackControl = TrackControl()
    waypoint_m: float = WAYPOINT_RADIUS_M
    step_s: float = STEP_S
    ship: int | None = None
    is_done: bool = False
    is_at_the_helm: bool = False
    notes: list[str] = field(default_factory=list)
    _asks: MissionClient | None = None
    _items: dict[int, tuple[float, float]] = field(default_factory=dict)
    _route: Route | None = None
    _plane: Plane | None = None
    _place: tuple[int, Floats, Floats, Floats, Floats] | None = None  # when (ms), east, north, and their velocities
    _heading: tuple[int, Floats, Floats] | None = None  # when (ms), heading and rate
    _speed_mps: float | None = None
    _said_ms: int | None = None
    _memory: Memory | None = None
    _along: Along = field(default_factory=lambda: Along.start(()))
    _order: Floats = field(default_factory=lambda: np.zeros(()))
    _is_there: bool = False
    _arrived: bool = False

    def hear(self, frame: Frame, now_ns: int) -> list[Ask]:
        """One good frame of the link; what to answer, without whom it is for. `now_ns` counts the mission's time-outs."""
        if frame.message == HEARTBEAT:
            return self._hear_heartbeat(frame, now_ns)
        if frame.system != self.ship:
            return []
        if frame.message == POSITION:
            self._hear_position(frame.payload)
            return self._steer()
        elif frame.message == SPEED:
            self._speed_mps = float(_speed(frame.payload)[0])
        elif frame.message == ATTITUDE:
            time_ms, yaw, rate = _attitude(frame.payload)
            self._heading = (time_ms, np.array(float(yaw)), np.array(float(rate)))
            return self._steer()
        elif self._route is None and frame.message in (ITEM, MISSION_COUNT, ACK):
            return self._hear_mission(frame, now_ns)
        return []

    def due(self, now_ns: int) -> list[Ask]:
        """What to ask again for because no answer came."""
        asked = self._asks.due(now_ns) if self._asks is not None else None
        return [] if asked is None else [(asked[0], asked[1] | self._to_her(has_kind=True))]

    def _hear_heartbeat(self, frame: Frame, now_ns: int) -> list[Ask]:
        mode, kind, base = _heartbeat(frame.payload)
        if kind != SURFACE_BOAT or self.ship not in (None, frame.system):
            return []
        if self.ship is None:
            self.ship = frame.system
            self._asks = MissionClient(f"mavlink:{frame.system}", now_ns - QUIET_NS)
            self.notes.append(f"A ship is there: mavlink:{frame.system}; her mission is read.")
            return self.due(now_ns)
        if self._arrived:
            self.is_done = mode == HOLD
            return [] if self.is_done else [self._command(_SET_MODE, _CUSTOM_MODE, HOLD)]
        if self._route is None:
            return []
        is_hers = bool(base & _ARMED) and mode == MANUAL
        if is_hers != self.is_at_the_helm:
            self.is_at_the_helm = is_hers
            self.notes.append("The helm is ours." if is_hers else "The helm was taken from us.")
            self._memory, self._said_ms = None, None
        return [] if is_hers else [self._command(_ARM, 1.0, 0.0), self._command(_SET_MODE, _CUSTOM_MODE, MANUAL)]

    def _hear_mission(self, frame: Frame, now_ns: int) -> list[Ask]:
        asks = self._asks
        if asks is None or not asks.is_active:
            return []
        if frame.message == ITEM:
            latitude, longitude, _, number, command = _item(frame.payload)
            if command == RETURN_HOME and 0 in self._items:
                self._items[number] = self._items[0]
            elif command <= LAST_NAVIGATION and (latitude, longitude) != (0, 0):
                self._items[number] = (math.radians(latitude / 1e7), math.radians(longitude / 1e7))
        asks.hear(frame.message, frame.payload, now_ns)
        answers = self.due(now_ns)
        if asks.finished_at is not None and len(self._items) > 1:
            self._lay_route()
        return answers

    def _lay_route(self) -> None:
        places = [self._items[number] for number in sorted(self._items)]
        self._plane = Plane.about(Home(*places[0], 0.0))
        spots = [self._plane.spot(*places[0], 0.0)]
        for place in places[1:]:
            spot = self._plane.spot(*place, 0.0)
            if distance_m(spots[-1], spot) > 1.0:  # a leg has a course
                spots.append(spot)
        if len(spots) > 1:
            self._route = Route(np.array([[spot.east_m, spot.north_m] for spot in spots]), self.waypoint_m)
        self.notes.append(f"Her mission has {len(spots) - 1} places to go to.")

    def _hear_position(self, payload: bytes) -> None:
        time_ms, latitude, longitude, north_cmps, east_cmps = _position(payload)
        if self._plane is not None:
            spot = self._plane.spot(math.radians(latitude / 1e7), math.radians(longitude / 1e7), 0.0)
            velocity = np.array(east_cmps / 100.0), np.array(north_cmps / 100.0)
            self._place = (time_ms, np.array(spot.east_m), np.array(spot.north_m), *velocity)

    def _steer(self) -> list[Ask]:
        """The loop of one process: what her last order did is learnt, the wanted heading found, and the rudder ordered."""
        route, place, speed = self._route, self._place, self._speed_mps
        if route is None or place is None or speed is None or self._heading is None:
            return []
        time_ms, heading, turning = self._heading
        if not self.is_at_the_helm or self._arrived or place[0] != time_ms or self._said_ms == time_ms:
            return []
        if self._memory is None or self._said_ms is None:
            self._memory, self._order = self.autopilot.start(heading), np.zeros(())
        else:
            # what was lost on the way: the steps without a measurement are taken together, as one
            steps = max(round((time_ms - self._said_ms) / 1000.0 / self.step_s), 1)
            for _ in range(min(steps, 10)):
                self._memory = listen(self.autopilot, self._memory, heading, turning, self._order, self.step_s)
        self._said_ms = time_ms
        _, east, north, *ground = place
        steered = self._memory.heading(heading)
        wanted, self._along = wanted_heading(
            self.control, route, self._along, (east, north), steered, (ground[0], ground[1]), self.step_s
        )
        end = route.points_m[-1]
        is_last = int(self._along.leg) == len(route.points_m) - 2
        near = math.hypot(float(end[0] - east), float(end[1] - north)) < route.reach_m
        was_there, self._is_there = self._is_there, near or bool(is_arrived(route, self._along.leg, east, north))
        if is_last and was_there and self._is_there:  # a step later: by then she has counted it herself
            self._arrived = True
            self.notes.append("Arrived.")
            return [self._control(0.0, 0), self._command(_SET_MODE, _CUSTOM_MODE, HOLD)]
        self._order, self._memory = steer(
            self.autopilot, self._memory, heading, turning, np.array(speed), wanted, self.step_s
        )
        return [self._control(float(self._order), FULL)]

    def _control(self, rudder_rad: float, engine: int) -> Ask:
        share = rudder_rad / self.autopilot.hull.rudder_limit_rad
        return "MANUAL_CONTROL", {
            "target": self.ship,
            "x": 0,
            "y": round(FULL * share),
            "z": engine,
            "r": 0,
            "buttons": 0,
        }

    def _command(self, number: int, first: float, second: float) -> Ask:
        parameters: dict[str, Any] = {f"param{place}": 0.0 for place in range(1, 8)}
        parameters |= {"param1": float(first), "param2": float(second)}
        return "COMMAND_LONG", {"command": number, "confirmation": 0, **parameters, **self._to_her()}

    def _to_her(self, *, has_kind: bool = False) -> dict[str, Any]:
        return {"target_system": self.ship, "target_component": 1} | ({"mission_type": 0} if has_kind else {})
