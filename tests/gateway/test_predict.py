"""Predictions of live tracks: where plans, declared points and published ones lead, and what happens when they are not kept."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from gateway.frames import RunwayFrame
from gateway.observation import AirData, FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint, VehicleStatus
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.predict import TOGETHER, Predicting
from gateway.predict.minds import UNKNOWN, Remembered
from gateway.predict.modes import returning
from gateway.predict.predicting import FEW
from gateway.predict.told import Tellings
from gateway.settings import DEMO_SITE, Options, Site, Waypoint

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
LATITUDE, LONGITUDE = math.radians(31.3), math.radians(104.3)  # 40 km from the runway
NORTH_RAD = 1.0 / 6_362_000.0
EAST_RAD = 1.0 / (6_386_000.0 * math.cos(LATITUDE))
SPEED = 60.0
OPTIONS = Options(horizons_s=(10.0, 60.0))
AIRCRAFT = "mavlink:1"


def place(east_m: float, north_m: float) -> tuple[float, float]:
    return LATITUDE + north_m * NORTH_RAD, LONGITUDE + east_m * EAST_RAD


def report(at_s: float, east_m: float, north_m: float, course_deg: float) -> GpsReport:
    at = T0 + round(at_s * SECOND)
    velocity = SPEED * math.sin(math.radians(course_deg)), SPEED * math.cos(math.radians(course_deg)), 0.0
    there = place(east_m, north_m)
    return GpsReport(AIRCRAFT, at, at, *there, 1000.0, None, *velocity, 3.0, 5.0, 0.3)


def northward(seconds: int) -> list[GpsReport]:
    """A report each half second."""
    return [report(half / 2, 0.0, SPEED * half / 2, 0.0) for half in range(2 * seconds)]


def plan(*points: tuple[float, float], at_s: float = 0.0) -> FlightPlan:
    items = [PlanPoint(k, "waypoint", *place(*point), altitude_msl_m=1000.0) for k, point in enumerate(points, 1)]
    return FlightPlan(AIRCRAFT, T0 + round(at_s * SECOND), T0 + round(at_s * SECOND), tuple(items))


def goes_to(sequence: int, at_s: float = 0.0, told_by: str = "mission") -> Intent:
    at = T0 + round(at_s * SECOND)
    return Intent(AIRCRAFT, at, at, told_by, sequence)


def run(
    said: Sequence[Observation], site: Site = DEMO_SITE, together: int = 1, options: Options = OPTIONS
) -> list[Picture]:
    """What was said, in the order in which it was heard, some arrivals a tick; and a watermark at the end."""
    ordered = sorted(said, key=lambda one: one.received_at)
    heard = [Heard(one.received_at + place, (one,)) for place, one in enumerate(ordered)]
    heard.append(Heard(heard[-1].now + 1))
    state, pictures = initial(site, options), []
    for first in range(0, len(heard), together):
        state, picture = step(state, heard[first : first + together])
        pictures.append(picture)
    return pictures


def rows(
    pictures: Sequence[Picture], horizon_s: float = 60.0
) -> list[tuple[float, str, str | None, str | None, float]]:
    """Of each second: when, method, intent, kind, confidence."""
    found = []
    for one in (picture.predict for picture in pictures):
        for row in np.flatnonzero(one.horizon_s == horizon_s).tolist():
            made_s = (int(one.made[row]) - T0) / SECOND
            found.append((made_s, one.method[row], one.intent[row], one.intent_kind[row], float(one.confidence[row])))
    return found


def ahead(pictures: Sequence[Picture], horizon_s: float = 60.0) -> tuple[float, float]:
    """East and north of the last point foretold, from where all begins."""
    last = [picture.predict for picture in pictures if len(picture.predict.made)][-1]
    row = int(np.flatnonzero(last.horizon_s == horizon_s)[-1])
    return (last.longitude_rad[row] - LONGITUDE) / EAST_RAD, (last.latitude_rad[row] - LATITUDE) / NORTH_RAD


def test_a_declared_point_of_the_plan_leads_round_the_corner() -> None:
    """Northward to a corner 3 km ahead and then east: in 60 s it is on the eastern leg, and says why."""
    pictures = run([plan((0.0, 3000.0), (6000.0, 3000.0)), goes_to(1), *northward(25)])
    _, method, name, kind, confidence = rows(pictures)[-1]
    assert (method, name, kind) == ("two segments", "waypoint 1", "declared")
    assert confidence > 0.9
    east, north = ahead(pictures)
    assert north == pytest.approx(3000.0, abs=60.0)
    assert 2000.0 < east < 2500.0  # 84 s at 60 m/s, less 3000 m, and a little for the corner that is cut


def test_a_vehicle_that_leaves_its_plan_is_not_believed_for_longer_than_ten_seconds() -> None:
    """It is said to go east from the corner and flies on northward: confidence falls, and the model's prediction is back."""
    said = [plan((0.0, 1500.0), (6000.0, 1500.0)), goes_to(1), goes_to(2, 24.0), *northward(45)]
    told = rows(run(said))
    before = [one for one in told if 10.0 < one[0] < 24.0]
    assert all(one[1] == "two segments" for one in before)
    after = [one for one in told if one[0] >= 35.0]
    assert after
    assert all(one[1] == "model" and one[4] < 0.5 for one in after)
    assert all(one[2] == "waypoint 2" for one in after)


@pytest.mark.parametrize("goal", [(0.0, -20_000.0), (30_000.0, 0.0)])
def test_a_wrong_plan_is_found_out(goal: tuple[float, float]) -> None:
    """A plan that leads behind or aside of the way that is flown is doubted within ten seconds, and flown no more."""
    told = rows(run([plan(goal), goes_to(1), *northward(20)]))
    assert all(one[1] == "model" and one[4] < 0.5 for one in told if one[0] >= 11.0)


def test_a_mission_uploaded_in_flight_takes_the_place_of_the_old_one() -> None:
    """From the second on in which the new plan is heard its point is the one flown to."""
    old, new = plan((0.0, 20_000.0)), plan((0.0, 9000.0), (5000.0, 9000.0), at_s=12.0)
    pictures = run([old, goes_to(1), new, goes_to(1, 12.0), *northward(25)])
    east, north = ahead(pictures)
    assert rows(pictures)[-1][1:4] == ("two segments", "waypoint 1", "declared")
    assert (east, north) == (pytest.approx(0.0, abs=20.0), pytest.approx(24 * SPEED + 60 * SPEED, abs=60.0))


def test_an_outdated_plan_is_doubted_ten_seconds_after_its_point_was_passed() -> None:
    """It flies on past the point, and nobody says which is the next: confidence falls, and the prediction is the model's."""
    told = rows(run([plan((0.0, 900.0), (6000.0, 900.0)), goes_to(1), *northward(36)]))
    assert all(one[1] == "two segments" for one in told if 5.0 < one[0] < 15.0)
    late = [one for one in told if one[0] >= 25.0]
    assert late
    assert all(one[1] == "model" and one[4] < 0.5 for one in late)


def test_an_item_of_a_plan_that_nobody_knows_is_no_goal() -> None:
    """The plan is missing: which item is flown to says nothing, and the prediction is the model's from the beginning."""
    told = rows(run([goes_to(4), *northward(12)]))
    assert told
    assert all(one[1:4] == ("model", None, None) for one in told)


def test_who_comes_back_to_its_plan_is_believed_again() -> None:
    """Doubted while it flew elsewhere, believed again once it has flown at its goal for half a minute."""
    away = [report(half / 2, 0.0, SPEED * half / 2, 0.0) for half in range(40)]
    back = [report(20.0 + half / 2, SPEED * half / 2, 1200.0, 90.0) for half in range(100)]
    told = rows(run([plan((20_000.0, 1200.0)), goes_to(1), *away, *back]))
    assert all(one[1] == "model" for one in told if 12.0 <= one[0] < 20.0)
    assert [one[1] for one in told if one[0] >= 60.0] == ["two segments"] * len([one for one in told if one[0] >= 60.0])


def test_a_loiter_is_flown_round_at_the_radius_that_the_mission_says() -> None:
    """Two turns of 900 m about a point 1.6 km ahead: in 60 s it is on that circle; with another radius it would be elsewhere."""
    where = place(0.0, 3000.0)
    items = (PlanPoint(1, "loiter", *where, altitude_msl_m=1000.0, radius_m=900.0, turns=2.0),)
    pictures = run([FlightPlan(AIRCRAFT, T0, T0, items), goes_to(1), *northward(24)])
    east, north = ahead(pictures)
    assert math.hypot(east, north - 3000.0) == pytest.approx(900.0, rel=0.03)
    assert rows(pictures)[-1][1:4] == ("two segments", "loiter 1", "declared")


def in_mode(mode: int, at_s: float, vehicle_type: int = 1) -> VehicleStatus:
    """ArduPilot's heartbeat: an aeroplane in AUTO is in mode 10, in RTL in 11."""
    at = T0 + round(at_s * SECOND)
    return VehicleStatus(AIRCRAFT, at, at, vehicle_type, 3, True, mode)


def home_and(*points: tuple[float, float], home: tuple[float, float]) -> FlightPlan:
    """A plan with a home."""
    told = plan(*points)
    return replace(told, points=(PlanPoint(0, "home", *place(*home), altitude_msl_m=900.0), *told.points))


def test_an_aeroplane_of_ardupilot_flies_home_from_the_end_of_its_plan() -> None:
    """Its only point is 1.5 km ahead, home south of it: in 60 s it comes back. A copter's way ends there, and goes on."""
    told = home_and((0.0, 3900.0), home=(0.0, -9000.0))
    east, north = ahead(run([told, goes_to(1), in_mode(10, 0.0), *northward(40)]))
    assert north < 3500.0
    east, north = ahead(run([told, goes_to(1), in_mode(3, 0.0, vehicle_type=2), *northward(40)]))
    assert (east, north) == (pytest.approx(0.0, abs=50.0), pytest.approx(60.0 * 99.5, abs=150.0))


@pytest.mark.parametrize(
    ("vehicle_type", "autopilot", "mode", "home"),
    [
        (1, 3, 11, True),
        (1, 3, 10, False),
        (2, 3, 6, True),
        (2, 3, 11, False),
        (10, 3, 11, True),
        (1, 12, 5 << 24 | 4 << 16, True),
        (1, 12, 4 << 24 | 4 << 16, False),
        (1, 0, 11, False),
    ],
)
def test_modes_that_fly_home_are_known(vehicle_type: int, autopilot: int, mode: int, home: bool) -> None:
    """ArduPilot's aeroplanes, copters and rovers have numbers of their own, PX4 has one; of others nobody knows."""
    assert returning(VehicleStatus(AIRCRAFT, T0, T0, vehicle_type, autopilot, True, mode)) is home


def test_who_is_in_the_mode_that_flies_home_goes_home() -> None:
    """Whatever item its mission is at, from the second on in which its mode is heard; and no more when it is in another one."""
    told = home_and((9000.0, 3000.0), home=(0.0, 30_000.0))
    found = rows(run([told, goes_to(1), in_mode(11, 20.0), in_mode(10, 40.0), *northward(50)]))
    assert {row[2] for row in found if 22.0 <= row[0] < 40.0} == {"home"}
    assert "home" not in {row[2] for row in found if row[3] == "declared" and not 20.0 <= row[0] <= 41.0}


def test_who_flies_home_circles_there_as_wide_and_as_high_as_its_parameters_say() -> None:
    """Home is 2 km ahead, its circle 600 m wide, 200 m above home: in a minute it is on it, 100 m higher than now."""
    told = home_and((9000.0, 3000.0), home=(0.0, 5000.0))
    told = replace(
        told, points=(replace(told.points[0], radius_m=600.0, altitude_above_home_m=200.0), *told.points[1:])
    )
    pictures = run([told, goes_to(1), in_mode(11, 1.0), *northward(50)])
    east, north = ahead(pictures)
    assert math.hypot(east, north - 5000.0) == pytest.approx(600.0, rel=0.05)
    heights = np.concatenate([one.predict.height_m[one.predict.horizon_s == 60.0] for one in pictures])
    assert heights[-1] - heights[0] == pytest.approx(100.0, abs=3.0)


def test_who_is_beside_the_line_of_its_plan_comes_back_to_it() -> None:
    """The line to its point leads eastward, 600 m north of it, it flies at it: in 60 s it is on it, not on a way from here."""
    told = [plan((-3000.0, 3000.0), (9000.0, 3000.0)), goes_to(2)]
    speed = SPEED * math.sqrt(0.5)
    towards = [report(half / 2, speed * half / 2, 1600.0 + speed * half / 2, 45.0) for half in range(40)]
    assert ahead(run([*told, *towards]))[1] == pytest.approx(3000.0, abs=30.0)


def test_a_landing_is_flown_to_slower_from_the_second_on_in_which_it_is_declared() -> None:
    """It has not slowed down yet, and will: in 60 s it is where 80 % of its speed lead."""
    before = plan((0.0, -3000.0), (0.0, 20_000.0))
    landing = replace(before, points=(before.points[0], replace(before.points[1], kind="landing")))
    found = {}
    for name, told in (("waypoint", before), ("landing", landing)):
        found[name] = ahead(run([told, goes_to(1), goes_to(2, 30.0), *northward(34)]))[1] - SPEED * 33.0
    assert found["waypoint"] == pytest.approx(60.0 * SPEED, rel=0.02)
    assert found["landing"] == pytest.approx(0.8 * 60.0 * SPEED, rel=0.02)


def test_a_turn_that_begins_is_as_sharp_as_its_corner() -> None:
    """A second into a turn of 90 degrees the measured rate is half straight flight: in 10 s it has turned all the way."""
    told = [plan((0.0, 1800.0), (9000.0, 1860.0)), goes_to(1), goes_to(2, 29.0)]
    turned = report(29.5, 8.0, SPEED * 29.5, 15.0)
    pictures = run(
        [*told, *northward(29), report(29.0, 0.0, SPEED * 29.0, 0.0), turned, report(30.0, 30.0, SPEED * 29.9, 30.0)]
    )
    east, north = ahead(pictures, 10.0)
    assert east > 350.0
    assert north == pytest.approx(1860.0, abs=120.0)


def test_further_points_of_a_plan_are_flown_one_after_another() -> None:
    """Three corners within the horizon: in 60 s it is on the way to the fourth point, westward."""
    corners = plan((0.0, 1800.0), (1100.0, 1800.0), (1100.0, 2900.0), (-9000.0, 2900.0))
    pictures = run([corners, goes_to(1), *northward(20)], options=Options(horizons_s=(10.0, 60.0)))
    last = [picture.predict for picture in pictures if len(picture.predict.made)][-1]
    assert ahead(pictures) == (pytest.approx(350.0, abs=300.0), pytest.approx(2900.0, abs=150.0))
    assert math.degrees(float(last.course_rad[-1])) == pytest.approx(270.0, abs=8.0)


def test_what_was_said_earlier_but_heard_later_changes_nothing() -> None:
    """Plans and intents count by when they were valid."""
    newer, older = goes_to(2, 5.0), replace(goes_to(1, 1.0), received_at=T0 + 8 * SECOND)
    tellings = Tellings().hearing(newer).hearing(older)
    assert tellings.by_aircraft[AIRCRAFT].declared == newer


def test_utm_is_believed_before_the_mission_until_withdrawn() -> None:
    """A point that UTM declares overrides the mission's; one without a goal takes it back."""
    ordered = Intent(AIRCRAFT, T0, T0, "utm", latitude_rad=0.5, longitude_rad=1.8)
    tellings = Tellings().hearing(goes_to(3, 5.0)).hearing(ordered)
    assert tellings.by_aircraft[AIRCRAFT].declared == ordered
    withdrawn = tellings.hearing(Intent(AIRCRAFT, T0 + SECOND, T0 + SECOND, "utm"))
    assert withdrawn.by_aircraft[AIRCRAFT].declared == goes_to(3, 5.0)


def test_a_published_point_ahead_is_inferred() -> None:
    """Without any plan the published point that is flown at is told as inferred; one aside is not."""
    points = (Waypoint("ABEAM", *place(8000.0, 8000.0)), Waypoint("AHEAD", *place(0.0, 9000.0)))
    told = rows(run(northward(20), replace(DEMO_SITE, waypoints=points)))
    assert told[-1][1:4] == ("two segments", "AHEAD", "inferred")
    assert told[-1][4] > 0.8


def test_without_any_goal_there_is_the_model_and_no_intent() -> None:
    """No plan, no published point, far from the runway: straight on, and nobody pretends."""
    pictures = run(northward(12))
    _, method, name, kind, confidence = rows(pictures)[-1]
    assert (method, name, kind) == ("model", None, None)
    assert math.isnan(confidence)
    assert ahead(pictures) == (pytest.approx(0.0, abs=20.0), pytest.approx(71 * SPEED, abs=40.0))


def test_how_arrivals_fall_into_ticks_changes_no_bit() -> None:
    """Plans, intents, modes and winds among the reports: ticks of one arrival and one of everything foretell the same."""
    wind = [
        AirData(AIRCRAFT, T0 + k * SECOND, T0 + k * SECOND, wind_east_mps=4.0, wind_north_mps=1.0) for k in range(9)
    ]
    told = home_and((0.0, 900.0), (4000.0, 900.0), home=(0.0, -9000.0))
    modes = [in_mode(10, 0.0), in_mode(11, 17.0)]
    said = [told, goes_to(1), goes_to(2, 14.0), *modes, *wind, *northward(20)]
    columns = ("made", "latitude_rad", "longitude_rad", "height_m", "sigma_along_m", "sigma_across_m", "confidence")
    one, all_at_once = (
        [np.concatenate([getattr(picture.predict, name) for picture in run(said, together=count)]) for name in columns]
        for count in (1, 1000)
    )
    assert len(one[0]) == 38
    assert all(left.tobytes() == right.tobytes() for left, right in zip(one, all_at_once, strict=True))


def test_many_tracks_are_predicted_part_by_part_within_the_second() -> None:
    """Of fewer than three times as many as go together three parts, each at its own instant; every track once. Few are
    predicted at the whole second."""
    many = range(1, 3 * TOGETHER - TOGETHER // 2)
    planned = Predicting().planning(many, T0)
    at, found = [], []
    while planned.due < T0 + SECOND:
        at.append(planned.due)
        planned, tracks = planned.begun(planned.due)
        found += tracks
        assert len(tracks) <= TOGETHER
    assert at == [T0 + SECOND // 6, T0 + SECOND // 2, T0 + 5 * SECOND // 6]
    assert found == list(many)
    assert Predicting().planning(range(FEW), T0).planned == ((T0, tuple(range(FEW))),)


def on_final(climb_mps: float) -> list[Picture]:
    """Along the centreline at 70 m/s from 9 km before the aiming point, on the glide path or climbing from it."""
    runway, frame, reports = DEMO_SITE.runway, RunwayFrame(DEMO_SITE.runway), []
    for second in range(20):
        along = runway.aiming_point_x_m - 9000.0 + 70.0 * second
        up = 9000.0 * math.tan(runway.glide_path_rad) + climb_mps * second
        latitude, longitude, height = map(float, frame.geodetic_from_runway([along, 0.0, up]))
        at = T0 + second * SECOND
        told = GpsReport(AIRCRAFT, at, at, latitude, longitude, None, height, 70.0, 0.0, climb_mps, 3.0, 3.0, 0.3)
        reports.append(told)
    return run(reports)


def test_on_final_the_glide_path_leads_to_the_runway() -> None:
    """Going down along it, the runway is what is inferred, and in 60 s it is lower by what the glide path asks for."""
    pictures = on_final(-70.0 * math.tan(math.radians(3.0)))
    assert rows(pictures)[-1][1:4] == ("two segments", "runway", "inferred")
    last = [picture.predict for picture in pictures if len(picture.predict.made)][-1]
    near, far = last.runway_m[-2:]
    assert far[2] - near[2] == pytest.approx(-50.0 * 70.0 * math.tan(math.radians(3.0)), rel=0.05)
    assert abs(far[1]) < 30.0


def test_who_climbs_on_final_goes_around() -> None:
    """Climbing along the centreline, a go-around is what is inferred."""
    assert rows(on_final(3.0))[-1][2:4] == ("go-around", "inferred")


def test_minds_are_those_of_their_tracks_however_parts_are_cut() -> None:
    """Tracks come, end and move from part to part; each is given back what was thought of it, and a new one nothing."""
    chance, known, remembered = np.random.default_rng(1), dict[int, float](), Remembered()
    for turn in range(60):
        tracks = chance.permutation(20)[: chance.integers(1, 20)].tolist()
        for part in (tracks[:6], tracks[6:]) if turn % 3 else (sorted(tracks),):
            if part:
                minds = remembered.of(part)
                assert minds.speed.tolist() == [known.get(track, 0.0) for track in part]
                assert (minds.at == UNKNOWN).tolist() == [track not in known for track in part]
                speed = chance.uniform(1.0, 99.0, len(part))
                remembered = remembered.after(part, replace(minds, at=np.full(len(part), turn), speed=speed))
                known |= dict(zip(part, speed.tolist(), strict=True))
        if turn % 7 == 6:
            known = {track: speed for track, speed in known.items() if track % 5}
            remembered = remembered.without(dict.fromkeys(known))
    assert sorted(track for part, _ in remembered.parts for track in part) == sorted(known)
