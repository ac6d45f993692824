"""A ship as a vehicle: she takes orders, sails her mission, and tells where she is on it."""

from __future__ import annotations

import math

import pytest

from adapters.mavlink_frames import Frame, FrameEncoder, parse
from adapters.mission_writing import MissionItem
from sim.ships.autopilots import build_autopilot
from sim.ships.fitting_out import vessel
from sim.ships.helmsman import Helmsman
from sim.ships.hull import Hull, Weather
from sim.ships.linked import ShipSpeaker
from sim.ships.vessel import Vessel
from sim.ships.voyage import STEP_S
from sim.ships.waves import Waves
from sim.vehicles.motion import Arm, ChangeSpeed, GoTo, GoToItem, Home, SetMode, TakeOff
from sim.vehicles.speaking import sensors_of
from sim.vehicles.steering import distance_m

HOME = Home(math.radians(31.0), math.radians(122.0), 5.0)
PLACES = ((800.0, 0.0), (1400.0, 800.0))  # north, east


def _item(north_m: float, east_m: float) -> MissionItem:
    return MissionItem(16, 31.0 + north_m / 110_860.0, 122.0 + east_m / 95_500.0, 0.0)


def _parsed(raw: bytes) -> Frame:
    frame = parse(raw)
    assert frame is not None
    return frame


def _under_way(**fitted: object) -> Vessel:
    ship = vessel(HOME, tuple(_item(*place) for place in PLACES), **fitted)  # type: ignore[arg-type]
    assert ship.order(Arm(True)).result == "accepted"
    assert ship.order(SetMode("AUTO")).result == "accepted"
    return ship


def test_a_ship_passes_each_place_of_her_mission_within_40_m_and_stops() -> None:
    """In wind, waves and a current, on the PID: both places within 40 m, in their order, then HOLD, and she comes to rest."""
    ship = _under_way(weather=Weather(math.radians(2.0), (0.5, 0.0)), waves=Waves())
    spots = [
        ship.plane.spot(math.radians(one.latitude_deg), math.radians(one.longitude_deg), 5.0)
        for one in ship.mission.items
    ]
    nearest = [math.inf] * len(spots)
    while ship.mode == "AUTO" and ship.moment.time_s < 900.0:
        moment = ship.step()
        here = ship.plane.spot(moment.latitude_rad, moment.longitude_rad, 5.0)
        nearest = [min(least, distance_m(here, spot)) for least, spot in zip(nearest, spots, strict=True)]
    assert max(nearest) <= 40.0
    assert ship.mission.reached == [1, 2]
    assert ship.mode == "HOLD"
    for _ in range(1000):
        ship.step()
    assert ship.moment.airspeed_mps is not None
    assert ship.moment.airspeed_mps < 0.5


def test_the_same_seed_gives_the_same_bits() -> None:
    """Two ships of one seed in waves say the same; of another seed not."""
    ends = []
    for seed in (1, 1, 2):
        ship = _under_way(waves=Waves(), seed=seed)
        for _ in range(100):
            ship.step()
        ends.append(ship.moment)
    assert ends[0] == ends[1]
    assert ends[0] != ends[2]


def test_a_ship_lies_still_until_she_is_armed_and_told_to_go() -> None:
    """In HOLD, and in AUTO unarmed, she does not move."""
    ship = vessel(HOME, (_item(1500.0, 0.0),))
    for mode in ("HOLD", "AUTO"):
        ship.order(SetMode(mode))
        for _ in range(20):
            ship.step()
        assert ship.moment.velocity_mps == (0.0, 0.0, 0.0)


def test_in_manual_whoever_is_at_the_helm_steers_and_is_told_the_cross_track_error() -> None:
    """Hard to starboard turns her to starboard, and she tells how far to the right of her leg she is."""
    ship = vessel(HOME, (_item(1500.0, 0.0),))
    ship.order(Arm(True))
    ship.order(SetMode("MANUAL"))
    for _ in range(400):
        ship.take_helm(math.radians(35.0), 1.0)
        ship.step()
    assert ship.moment.attitude_rad[2] > math.radians(10.0)
    east = ship.plane.spot(ship.moment.latitude_rad, ship.moment.longitude_rad, 5.0).east_m
    assert ship.progress.cross_track_m == pytest.approx(east, abs=2.0)  # as of the step before
    assert east > 10.0


def test_a_mission_that_ends_with_the_return_home_ends_there() -> None:
    """Two items at one place are both reached; then the way home, and HOLD."""
    out = _item(400.0, 0.0)
    ship = vessel(HOME, (out, out, MissionItem(20)))
    for order in (Arm(True), SetMode("AUTO")):
        assert ship.order(order).result == "accepted"
    while ship.mode != "HOLD" and ship.moment.time_s < 600.0:
        moment = ship.step()
    assert ship.mission.reached == [1, 2, 3]
    home = ship.plane.spot(HOME.latitude_rad, HOME.longitude_rad, 5.0)
    assert distance_m(ship.plane.spot(moment.latitude_rad, moment.longitude_rad, 5.0), home) < 60.0


def test_a_helmsman_takes_a_ship_there_and_home_again() -> None:
    """Over MAVLink, by a mission that names one place twice and ends with the return home."""
    out = _item(300.0, 0.0)
    ship = vessel(HOME, (out, out, MissionItem(20)))
    speaker = ShipSpeaker.of(1, ship, sensors_of(1, 1), 0)
    helmsman = Helmsman(build_autopilot("pid", Hull(), None, STEP_S))
    voice = FrameEncoder(253, 191)
    while not helmsman.is_done and ship.moment.time_s < 600.0:
        now = round(ship.step().time_s * 1e9)
        asks, frames = helmsman.due(now), speaker.say(now)
        while asks or frames:
            asks += [ask for frame in frames for ask in helmsman.hear(_parsed(frame), now)]
            said = [_parsed(voice.encode(name, **values)) for name, values in asks]
            asks, frames = [], [frame for one in said for frame in speaker.hear(one, now)]
    assert helmsman.is_done
    assert "Her mission has 2 places to go to." in helmsman.notes
    assert ship.mission.reached == [1, 2, 3]
    spot = ship.plane.spot(ship.moment.latitude_rad, ship.moment.longitude_rad, 5.0)
    assert abs(spot.north_m) < 20.0  # abeam of home: a leg of 300 m is too short to come out of so tight a turn


def test_a_ship_without_a_way_does_not_go() -> None:
    """No mission, no AUTO; GUIDED without a place leaves the engine stopped; senseless speeds of a mission change nothing."""
    ship = vessel(HOME)
    ship.order(Arm(True))
    assert ship.order(SetMode("AUTO")).why == "there is no mission"
    assert ship.order(SetMode("GUIDED")).result == "accepted"
    assert ship.step().throttle == 0.0
    fast = vessel(HOME, (MissionItem(178, parameters=(0.0, math.inf, 0.0, 0.0)), _item(500.0, 0.0)))
    for order in (Arm(True), SetMode("AUTO")):
        fast.order(order)
    fast.step()
    assert fast.settings["CRUISE_SPEED"] == fast.hull.speed_mps


def test_what_a_ship_cannot_do_is_refused() -> None:
    """She does not take off, has no mode FBWA, no item 7, and no speed of 0 m/s; another speed and a place are taken."""
    ship = _under_way()
    assert ship.order(TakeOff(10.0)).result == "unsupported"
    assert ship.order(SetMode("FBWA")).result == "unsupported"
    assert ship.order(GoToItem(7)).result == "denied"
    assert ship.order(ChangeSpeed(0.0)).result == "denied"
    assert ship.order(GoTo(3.0, HOME.longitude_rad)).why == "that is no place on earth"
    assert ship.order(ChangeSpeed(5.0)).result == "accepted"
    assert ship.order(GoTo(HOME.latitude_rad + 1e-4, HOME.longitude_rad)).result == "accepted"
    assert ship.mode == "GUIDED"
