"""Where a vehicle says that it goes: its home and the item of its mission that it is at. The items themselves: plans.py.

    HOME_POSITION (242)     latitude, longitude degE7, altitude mm above mean sea level: point 0 of the plan
    MISSION_CURRENT (42)    seq: the item it goes to; total; mission_state 1 no mission, 2 not begun, 5 complete;
                            mission_mode 2 suspended: then it does not go there, and what was declared is withdrawn
    PARAM_VALUE (22)        of ArduPilot's aeroplanes RTL_RADIUS, or if that is 0 WP_LOITER_RAD, m, negative to the left, and
                            RTL_ALTITUDE, m above home (once ALT_HOLD_RTL, cm): how it circles at home, where a station asks

MISSION_CURRENT comes each second: an intent is told when it has changed. Item 0 of ArduPilot is home and no goal.
"""

from __future__ import annotations

from collections import Counter

from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations
from adapters.plans import RETURN_PARAMETERS
from adapters.positions import is_altitude
from adapters.roles import PX4
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import FlightPlan, Intent

HOME_POSITION, _read_home = fields("HOME_POSITION", "latitude", "longitude", "altitude")
MISSION_CURRENT, _read_current = fields("MISSION_CURRENT", "seq", "mission_state", "mission_mode")
PARAM_VALUE, _read_parameter = fields("PARAM_VALUE", "param_value", "param_id")

_STATES = {1: "no mission", 2: "not begun", 3: "active", 4: "paused", 5: "complete"}
_IDLE_STATES = frozenset((1, 2, 5))
_SUSPENDED = 2


def home(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """HOME_POSITION."""
    latitude, longitude, altitude_mm = _read_home(payload)
    if not is_altitude(altitude_mm, counters):
        return ()
    changed = vehicle.plan.hear_home(latitude / 1e7, longitude / 1e7, altitude_mm / 1000)
    if not changed:
        return ()
    vehicle.words["home"] = f"{latitude / 1e7:.6f}, {longitude / 1e7:.6f}, {altitude_mm / 1000:.1f} m"
    valid_at, _ = moments.at_receipt(component, received_at)
    return (FlightPlan(vehicle.name, valid_at, received_at, vehicle.plan.points()),)


def parameter(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """PARAM_VALUE: what it says of the way home."""
    value, told = _read_parameter(payload)
    name = told.split(b"\0")[0].decode("ascii", "replace")
    if name not in RETURN_PARAMETERS or not vehicle.plan.hear_return(name, value):
        return ()
    valid_at, _ = moments.at_receipt(component, received_at)
    return (FlightPlan(vehicle.name, valid_at, received_at, vehicle.plan.points()),)


def current_item(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """MISSION_CURRENT."""
    sequence, state, mode = _read_current(payload)
    vehicle.words["mission"] = "suspended" if mode == _SUSPENDED else _STATES.get(state, "not told")
    idle = state in _IDLE_STATES or mode == _SUSPENDED or (sequence == 0 and begins_with_home(vehicle))
    vehicle.plan.next_item = None if idle else sequence
    vehicle.words["plan"] = vehicle.plan.summary()
    valid_at, _ = moments.at_receipt(component, received_at)
    if idle:
        withdrawn = vehicle.plan.is_withdrawn("mission")
        return (Intent(vehicle.name, valid_at, received_at, "mission"),) if withdrawn else ()
    intent = mission_intent(vehicle, "mission", sequence, valid_at, received_at)
    return () if intent is None else (intent,)


def begins_with_home(vehicle: Vehicle) -> bool:
    """Whether item 0 of its missions is a copy of home, as with ArduPilot, and no point to pass, as with PX4."""
    return vehicle.status is None or vehicle.status.autopilot != PX4


def mission_intent(vehicle: Vehicle, told_by: str, sequence: int, valid_at: int, received_at: int) -> Intent | None:
    """That a vehicle goes to this item of its plan, with the point where it is known; None where that is no news."""
    plan = vehicle.plan
    point = plan.point(sequence)
    altitude = None if point is None else plan.altitude_msl_m(point)
    latitude, longitude = (None, None) if point is None else (point.latitude_rad, point.longitude_rad)
    if not plan.is_new_intent(told_by, (sequence, latitude, longitude, altitude)):
        return None
    return Intent(vehicle.name, valid_at, received_at, told_by, sequence, latitude, longitude, altitude)
