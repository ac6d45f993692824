"""Vehicles fly their missions: how near they pass, how they land, what their inertial unit feels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from adapters.mission_writing import MissionItem
from gateway.estimators import inertial
from sim.vehicles.flying import HELICOPTER, QUADROTOR, Flyer, aeroplane, rotorcraft
from sim.vehicles.motion import Arm, ChangeSpeed, GoAround, GoTo, GoToItem, Home, Moment, SetMode, TakeOff
from sim.vehicles.steering import Spot, bearing_rad, distance_m
from sim.vehicles.wind import WindParameters

Place = Callable[..., MissionItem]
Begin = Callable[[Flyer], None]
STORM = WindParameters(8.0, math.radians(240.0), 1.5)
LONGEST_S = 400.0


def flown(vehicle: Flyer, until_s: float = LONGEST_S) -> list[Spot]:
    """Where it was ten times a second, until it is disarmed."""
    track = [vehicle.pilot.here]
    while vehicle.is_armed and vehicle.moment.time_s < until_s:
        for _ in range(5):
            vehicle.step()
        track.append(vehicle.pilot.here)
    return track


def misses(vehicle: Flyer, track: list[Spot]) -> list[float]:
    """How near each item of the mission was passed, m."""
    places = [vehicle.pilot.spot(item) for item in vehicle.mission.items[1:]]
    return [min(distance_m(here, place) for here in track) for place in places]


def ticks(vehicle: Flyer, seconds: float) -> list[Moment]:
    return [vehicle.step() for _ in range(round(seconds / vehicle.step_s))]


def test_an_aeroplane_in_wind_and_gusts_passes_every_waypoint_and_lands_to_a_standstill(
    home: Home, place: Place, begin: Begin
) -> None:
    """Below 15 m at 22 m/s, where 40 m are asked for; it stands on the runway's line, disarmed, at the right height."""
    items = (
        place(0, 0, 40, 22),
        place(700, 0, 60),
        place(700, 500, 80),
        place(-100, 700, 60),
        MissionItem(189),
        place(-700, 0, 40),
        place(0, 0, 0, 21),
    )
    plane = aeroplane(home, items, wind=STORM, seed=5)
    begin(plane)
    track = flown(plane)
    assert not plane.is_armed
    assert plane.mission.is_complete
    assert plane.mission.reached == [1, 2, 3, 4, 6, 7]
    assert max(misses(plane, track)[1:4]) < 15.0
    end = track[-1]
    assert plane.moment.velocity_mps == (0.0, 0.0, 0.0)
    assert abs(end.east_m) < 3.0
    assert 0.0 < end.north_m < 150.0
    assert end.height_m == pytest.approx(home.height_m, abs=0.01)


@pytest.mark.parametrize("is_told", [False, True])
def test_an_aeroplane_goes_around_and_comes_back_by_the_landing_sequence(
    home: Home, place: Place, begin: Begin, is_told: bool
) -> None:
    items = (place(0, 0, 40, 22), MissionItem(189), place(-600, 0, 35), place(0, 0, 0, 21))
    plane = aeroplane(home, items, seed=1, goes_around=0 if is_told else 1)
    begin(plane)
    lowest, highest = math.inf, 0.0
    while plane.is_armed and plane.moment.time_s < LONGEST_S:
        above = plane.step().height_m - home.height_m
        if plane.mission.current == 4 and "Going around" not in plane.notes:
            lowest = min(lowest, above)
            if is_told and above < 12.0:
                assert plane.order(GoAround(50.0)).result == "accepted"
        elif lowest < math.inf:
            highest = max(highest, above)
    assert plane.notes.count("Going around") == 1
    assert plane.mission.reached == [1, 3, 3, 4]
    assert lowest == pytest.approx(12.0 if is_told else 30.0, abs=1.0)
    assert highest > lowest + 15.0
    assert plane.is_landed


@pytest.mark.parametrize("kind", [QUADROTOR, HELICOPTER])
def test_rotors_carry_to_every_waypoint_wait_there_and_land_on_the_spot(
    home: Home, place: Place, begin: Begin, kind: int
) -> None:
    items = (place(0, 0, 20, 22), place(80, 0, 20), place(80, 60, 30, 16, 5.0), place(0, 0, 0, 21))
    craft = rotorcraft(home, items, kind=kind, wind=STORM, seed=2)
    begin(craft)
    track = flown(craft)
    assert craft.mission.reached == [1, 2, 3, 4]
    assert max(misses(craft, track)) < 3.0
    waits = [here for here in track if distance_m(here, craft.pilot.spot(items[2])) < 2.0]
    assert len(waits) >= 50  # five seconds
    assert not craft.is_armed
    assert distance_m(track[-1], Spot(0.0, 0.0, 0.0)) < 2.5


def test_circles_are_flown_as_often_and_as_long_as_asked_for(home: Home, place: Place, begin: Begin) -> None:
    """Two turns of 80 m radius to the left: the bearing from the centre has turned by two circles."""
    plane = aeroplane(home, (place(0, 0, 40, 22), place(500, 0, 60, 18, 2.0, 0.0, -80.0), place(900, 0, 60)), seed=1)
    begin(plane)
    turned, radii, before, centre = 0.0, [], 0.0, plane.pilot.spot(plane.mission.items[2])
    while plane.mission.current < 3:
        plane.step()
        bearing = bearing_rad(centre, plane.pilot.here)
        if distance_m(plane.pilot.here, centre) < 110.0:
            turned += math.remainder(bearing - before, 2.0 * math.pi)
            radii.append(distance_m(plane.pilot.here, centre))
        before = bearing
    assert turned == pytest.approx(-4.0 * math.pi, abs=0.2)
    assert np.median(radii) == pytest.approx(80.0, abs=5.0)


def test_strapdown_navigation_of_what_the_unit_feels_makes_the_same_way(home: Home, place: Place, begin: Begin) -> None:
    """Through take-off and a turn in gusts: within 1 cm in 15 s, of rates and forces as they are told every 20 ms."""
    plane = aeroplane(home, (place(0, 0, 20, 22), place(150, 300, 40)), wind=STORM, seed=4)
    begin(plane)
    start = plane.moment
    spots = (np.array(start.latitude_rad), np.array(start.longitude_rad), np.array(start.height_m))
    reckoned = inertial.Motion(*spots, np.zeros(3), inertial.from_angles(*start.attitude_rad))
    turned = 0.0
    for moment in ticks(plane, 15.0):
        turned = max(turned, *map(abs, moment.rate_radps))
        reckoned = inertial.advanced(reckoned, moment.rate_radps, moment.force_mps2, plane.step_s)
    there = (np.array(moment.latitude_rad), np.array(moment.longitude_rad), np.array(moment.height_m))
    assert np.linalg.norm(inertial.between(*there, reckoned)) < 0.01
    assert turned > 0.05


def test_the_same_seed_gives_the_same_bits_and_another_another_flight(home: Home, place: Place, begin: Begin) -> None:
    def end(seed: int) -> Moment:
        plane = aeroplane(home, (place(0, 0, 40, 22), place(700, 0, 60)), wind=STORM, seed=seed)
        begin(plane)
        return ticks(plane, 15.0)[-1]

    assert end(1) == end(1)
    assert end(1) != end(2)


def test_orders_are_taken_where_they_make_sense_and_denied_where_not(home: Home, place: Place) -> None:
    craft = rotorcraft(home, (), seed=1)
    assert craft.order(TakeOff(20.0)).why == "it is not armed"
    assert craft.order(SetMode("AUTO")).why == "there is no mission"
    assert craft.order(SetMode("FLIP")).result == "unsupported"
    assert craft.order(GoTo(home.latitude_rad, home.longitude_rad)).result == "denied"
    assert craft.order(GoAround()).result == "unsupported"
    assert craft.order(GoToItem(3)).result == "denied"
    assert craft.order(ChangeSpeed(-1.0)).result == "denied"
    assert craft.order(Arm(True)).result == "accepted"
    assert craft.order(TakeOff(20.0)).result == "accepted"
    ticks(craft, 12.0)
    assert craft.moment.height_m - home.height_m == pytest.approx(20.0, abs=1.0)
    assert craft.order(Arm(False)).why == "it is in the air"
    assert craft.order(GoTo(home.latitude_rad, home.longitude_rad + 1e-5)).result == "accepted"
    ticks(craft, 15.0)
    assert craft.moment.longitude_rad == pytest.approx(home.longitude_rad + 1e-5, abs=3e-7)
    assert craft.order(SetMode("RTL")).result == "accepted"
    ticks(craft, 60.0)
    assert (craft.is_landed, craft.is_armed) == (True, False)


def test_a_return_home_in_a_mission_is_reached_at_home(home: Home, place: Place, begin: Begin) -> None:
    """A copter's when it has landed there, from a safe height; an aeroplane's when it has come to the circle over it."""
    home_again = MissionItem(20)
    craft = rotorcraft(home, (place(0, 0, 10, 22), place(60, 0, 10), home_again), seed=1)
    begin(craft)
    highest = max(one.height_m for one in flown(craft)) - home.height_m
    assert craft.mission.reached == [1, 2, 3]
    assert (craft.is_landed, craft.is_armed) == (True, False)
    assert distance_m(craft.pilot.here, Spot(0.0, 0.0, 0.0)) < 2.5
    assert highest > 14.0
    plane = aeroplane(home, (place(0, 0, 40, 22), place(500, 0, 60), home_again), seed=1)
    begin(plane)
    while not plane.mission.is_complete and plane.moment.time_s < 200.0:
        plane.step()
    assert plane.mission.reached == [1, 2, 3]
    radius = distance_m(plane.pilot.here, Spot(0.0, 0.0, 0.0))
    assert radius == pytest.approx(plane.settings["WP_LOITER_RAD"], abs=35.0)


def test_an_aeroplane_that_has_no_landing_circles_over_home_at_the_end(home: Home, place: Place, begin: Begin) -> None:
    plane = aeroplane(home, (place(0, 0, 40, 22), place(300, 0, 60)), seed=1)
    begin(plane)
    ticks(plane, 90.0)
    assert plane.mode == "RTL"
    radius = distance_m(plane.pilot.here, Spot(0.0, 0.0, 0.0))
    assert radius == pytest.approx(plane.settings["WP_LOITER_RAD"], abs=6.0)
    assert plane.moment.height_m - home.height_m == pytest.approx(100.0, abs=3.0)
