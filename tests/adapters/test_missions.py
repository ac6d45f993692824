"""Condition, home, missions overheard, and where a vehicle says that it goes."""

import math
from typing import Any

import pytest

from adapters.plans import plan_point
from gateway.observation import FlightPlan, Intent, VehicleStatus

PX4 = 12


def _item(sequence: int, latitude_deg: float, **values: Any) -> dict[str, Any]:
    place = {"x": round(latitude_deg * 1e7), "y": 1_040_000_000, "z": 50.0}
    return {"seq": sequence, "command": 16, "frame": 3, "target_system": 255, **place, **values}


def _tell_mission(plane: Any, latitudes: tuple[float, ...], target: int = 255) -> tuple[Any, ...]:
    """Home and these waypoints; what came of the last item."""
    plane.say("MISSION_COUNT", count=len(latitudes) + 1, target_system=target)
    found: tuple[Any, ...] = plane.say("MISSION_ITEM_INT", **_item(0, 31.0, target_system=target))
    for number, latitude in enumerate(latitudes, 1):
        found = plane.say("MISSION_ITEM_INT", **_item(number, latitude, target_system=target))
    return found


def _latitudes(plan: FlightPlan) -> list[float]:
    return [round(math.degrees(point.latitude_rad), 6) for point in plan.points]


def test_the_landed_state_is_told_when_it_changes_and_with_each_heartbeat(plane: Any) -> None:
    status = plane.one("EXTENDED_SYS_STATE", landed_state=2)
    assert isinstance(status, VehicleStatus)
    assert (status.landed, status.armed, status.custom_mode) == ("in air", True, 10)
    assert plane.say("EXTENDED_SYS_STATE", landed_state=2) == ()
    assert plane.heartbeat()[0].landed == "in air"
    assert plane.one("EXTENDED_SYS_STATE", landed_state=4).landed == "landing"
    assert plane.one("EXTENDED_SYS_STATE", landed_state=0).landed is None
    assert plane.say("EXTENDED_SYS_STATE", landed_state=9) == ()
    assert plane.counter("landed state unknown") == 1


def test_how_it_circles_at_home_is_known_once_a_station_asks_for_its_parameters(plane: Any) -> None:
    """Its own radius for returning, or if that is 0 that of all circles; a height below 0 is none; NaN and others say nothing."""
    plane.one("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000)

    def told(name: str, value: float) -> Any:
        found = plane.say("PARAM_VALUE", param_id=name.encode(), param_value=value, param_count=900, param_index=1)
        return (found[0].points[0].radius_m, found[0].points[0].altitude_above_home_m) if found else None

    assert told("RTL_RADIUS", 0.0) is None
    assert told("WP_LOITER_RAD", 60.0) == (60.0, None)
    assert told("RTL_ALTITUDE", 100.0) == (60.0, 100.0)
    assert told("RTL_RADIUS", -80.0) == (-80.0, 100.0)
    assert told("RTL_ALTITUDE", -1.0) == (-80.0, None)
    assert told("RTL_RADIUS", math.nan) is None
    assert told("ARSPD_USE", 1.0) is None


def test_home_is_shown(plane: Any) -> None:
    plan = plane.one("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000)
    assert isinstance(plan, FlightPlan)
    assert plane.health().words["home"] == "31.000000, 104.000000, 500.0 m"
    assert plane.say("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000) == ()


def test_the_current_item_is_an_intent_with_the_plans_point(plane: Any) -> None:
    """50 m above a home at 500 m is 550 m above mean sea level."""
    plane.say("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000)
    _tell_mission(plane, (31.1, 31.2))
    intent = plane.one("MISSION_CURRENT", seq=2, mission_state=3, mission_mode=1)
    assert isinstance(intent, Intent)
    assert (intent.told_by, intent.sequence, intent.altitude_msl_m) == ("mission", 2, 550.0)
    assert math.degrees(intent.latitude_rad) == pytest.approx(31.2)
    assert plane.say("MISSION_CURRENT", seq=2, mission_state=3, mission_mode=1) == ()
    assert plane.health().words["plan"] == "2 points, next 2"
    assert plane.health().words["mission"] == "active"


def test_an_intent_is_told_again_once_its_point_is_known(plane: Any) -> None:
    assert plane.one("MISSION_CURRENT", seq=1).latitude_rad is None
    _tell_mission(plane, (31.1,))
    assert plane.one("MISSION_CURRENT", seq=1).latitude_rad == pytest.approx(math.radians(31.1))


@pytest.mark.parametrize(
    "values", [{"mission_mode": 2}, {"mission_state": 5}, {"mission_state": 1}, {"mission_state": 2}, {"seq": 0}]
)
def test_who_does_not_fly_its_mission_goes_nowhere(plane: Any, values: dict[str, int]) -> None:
    """Suspended, complete, none, not begun; item 0 of ArduPilot is home."""
    active = {"seq": 1, "mission_state": 3, "mission_mode": 1}
    assert plane.say("MISSION_CURRENT", **active | values) == ()
    assert plane.one("MISSION_CURRENT", **active).sequence == 1
    assert plane.one("MISSION_CURRENT", **active | values).sequence is None, "withdrawn"
    assert plane.say("MISSION_CURRENT", **active | values) == ()
    assert plane.one("MISSION_CURRENT", **active).sequence == 1, "told again when it goes on"


def test_item_zero_of_px4_is_a_point(speaker: Any) -> None:
    px4 = speaker()
    px4.heartbeat(autopilot=PX4)
    plan = _tell_mission(px4, (31.1,))[0]
    assert _latitudes(plan) == [31.0, 31.1]
    assert px4.one("MISSION_CURRENT", seq=0).latitude_rad == pytest.approx(math.radians(31.0))


def test_a_mission_that_the_vehicle_refuses_leaves_the_plan_it_had(plane: Any, speaker: Any) -> None:
    assert _latitudes(_tell_mission(plane, (31.1, 31.2))[0]) == [31.1, 31.2]
    station = speaker(plane.decoder, system=255, component=190)
    station.heartbeat(6, 8)
    assert _latitudes(_tell_mission(station, (32.0,), target=1)[0]) == [32.0]
    plan = plane.one("MISSION_ACK", target_system=255, type=14)
    assert _latitudes(plan) == [31.1, 31.2]


def test_a_mission_that_the_vehicle_takes_stays(plane: Any, speaker: Any) -> None:
    _tell_mission(plane, (31.1, 31.2))
    station = speaker(plane.decoder, system=255, component=190)
    _tell_mission(station, (32.0,), target=1)
    assert plane.say("MISSION_ACK", target_system=255, type=0) == ()
    assert plane.say("MISSION_ACK", target_system=255, type=1) == (), "that was about something else"


@pytest.mark.parametrize("message", ["MISSION_CLEAR_ALL", "MISSION_COUNT"], ids=["cleared", "none left"])
def test_a_cleared_mission_empties_the_plan_unless_that_is_refused(plane: Any, speaker: Any, message: str) -> None:
    _tell_mission(plane, (31.1, 31.2))
    station = speaker(plane.decoder, system=255, component=190)
    assert station.one(message, target_system=1).points == ()
    assert plane.health().words["plan"] == "none known"
    assert _latitudes(plane.one("MISSION_ACK", target_system=255, type=14)) == [31.1, 31.2]


def test_fences_and_guided_targets_are_no_plan(plane: Any) -> None:
    assert plane.say("MISSION_ITEM_INT", **_item(1, 31.1, mission_type=1)) == ()
    assert plane.say("MISSION_ITEM_INT", **_item(1, 31.1, current=2)) == ()
    assert plane.say("MISSION_CLEAR_ALL", target_system=1, mission_type=2) == ()


@pytest.mark.parametrize(
    ("command", "frame", "latitude", "altitude", "expected"),
    [
        (16, 0, 31.0, 120.0, ("waypoint", 120.0, None)),
        (21, 3, 31.0, 0.0, ("landing", None, 0.0)),
        (22, 6, 31.0, 30.0, ("take-off", None, 30.0)),
        (31, 10, 31.0, 30.0, ("loiter", None, None)),
        (16, 3, 31.0, math.nan, ("waypoint", None, None)),
        (201, 0, 31.0, 0.0, None),
        (80, 0, 31.0, 0.0, None),
        (16, 2, 31.0, 0.0, None),
        (16, 0, math.nan, 0.0, None),
        (16, 0, 91.0, 0.0, None),
    ],
)
def test_an_item_is_a_point_where_it_is_a_place_to_pass(
    command: int, frame: int, latitude: float, altitude: float, expected: tuple[Any, ...] | None
) -> None:
    point = plan_point(5, command, frame, latitude, 104.0, altitude)
    told = None if point is None else (point.kind, point.altitude_msl_m, point.altitude_above_home_m)
    assert told == expected


@pytest.mark.parametrize(
    ("command", "parameters", "radius_m", "turns"),
    [
        (18, (2.0, 0.0, -180.0), -180.0, 2.0),  # so many turns, to the left
        (17, (0.0, 0.0, 220.0), 220.0, None),
        (31, (1.0, 90.0, 0.0), 90.0, None),  # until it has its altitude: the radius is the second
        (18, (1.5, 0.0, 0.0), None, 1.5),  # the vehicle's own radius
        (16, (3.0, 4.0, 5.0), None, None),
        (18, (math.nan, 0.0, math.inf), None, None),
    ],
)
def test_a_circle_has_its_radius_and_turns(
    command: int, parameters: tuple[float, float, float], radius_m: float | None, turns: float | None
) -> None:
    """Where a mission item is flown round a point, radius and turns are known where the item says them."""
    point = plan_point(5, command, 3, 31.0, 104.0, 50.0, parameters)
    assert point is not None
    assert (point.radius_m, point.turns) == (radius_m, turns)
