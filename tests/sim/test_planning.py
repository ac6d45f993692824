"""Routes: areas, turns, courses, levels, files, and missions."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapters.mission_files import read_mission
from adapters.mission_writing import LAND, TAKE_OFF, format_plan
from gateway.settings import DEMO_SITE, SiteError
from sim.planning import modern
from sim.planning.areas import Area
from sim.planning.case import Case, Plane, drawn_case
from sim.planning.field import Threats, measure, resampled
from sim.planning.files import parse_case
from sim.planning.flight import Flight, Wishes, heights, plan_flight
from sim.planning.mission import mission, waypoints
from sim.planning.spline import _Search
from sim.planning.task import TOLERANCE_M, PlanError, Task

BOX = np.array([[-2e3, -5e3], [12e3, 5e3]])
START, GOAL = np.array([0.0, 0.0]), np.array([10e3, 0.0])
AHEAD = np.array([1.0, 0.0])
POND = Area(np.array([[4e3, -2e3], [6e3, -2e3], [6e3, 1.5e3], [5e3, -1e3], [4e3, 1.5e3]]), name="pond")  # concave


def task(*threats: tuple[float, float], **changed: object) -> Task:
    return replace(Task(START, GOAL, Threats.level(np.array(threats).reshape(-1, 2)), BOX), **changed)  # type: ignore[arg-type]


def case(*areas: Area, height_m: float = math.nan) -> Case:
    threat = np.array([[5e3, 0.0]])
    return Case("test", Plane(31.0, 104.0), START, GOAL, threat, np.array([height_m]), areas, box_m=BOX)


def test_a_straight_way_past_a_threat_costs_what_the_integral_says() -> None:
    """At distance d along all of a straight line the integral of 1/d^4 is pi/2/d^3; cut at 20 d either end it lacks 1e-5."""
    line = np.array([[-40e3, 2e3], [40e3, 2e3]])
    found = measure(line, Threats.level([[0.0, 0.0]]), lambda_m4=1e12)
    assert found.exposure_m3 == pytest.approx(math.pi / 2.0 / 2e3**3, rel=1e-4)
    assert found.cost_m == pytest.approx(80e3 + 1e12 * found.exposure_m3)
    assert found.clearance_m == pytest.approx(2e3)


def test_the_derivatives_that_are_written_out_are_those_of_the_cost() -> None:
    search = _Search.of(
        task((5e3, 500.0), areas=(POND,), turn_radius_m=2_000.0, start_course=AHEAD, goal_course=AHEAD), 15
    )
    free = search.begin(np.stack([START, [5e3, 300.0], GOAL]))
    free = free + np.random.default_rng(1).normal(0.0, 0.2, len(free))
    _, by_free = search.cost(free, 10.0, 1.1)
    steps = 1e-6 * np.eye(len(free))
    differences = [
        (search.cost(free + step, 10.0, 1.1)[0] - search.cost(free - step, 10.0, 1.1)[0]) / 2e-6 for step in steps
    ]
    np.testing.assert_allclose(by_free, differences, rtol=1e-5, atol=1e-6 * float(np.abs(by_free).max()))


def test_a_route_keeps_out_of_areas_turns_wide_enough_and_leaves_and_arrives_along_its_courses() -> None:
    circle = Area(np.array([[8e3, 1e3]]), 800.0)
    up = np.array([0.0, 1.0])
    route = modern.plan(task((5e3, 3e3), areas=(POND, circle), turn_radius_m=600.0, start_course=up, goal_course=AHEAD))
    for area in (POND, circle):
        assert area.distance(route.curve_m)[0].min() >= 0.0
    assert route.measures.turn_radius_m >= 600.0
    first, last = np.diff(route.curve_m, axis=0)[[0, -1]]
    assert first @ up / np.hypot(*first) > 0.999  # a chord of 25 m of a turn of 600 m is 1.2 degrees off the course
    assert last @ AHEAD / np.hypot(*last) > 0.999


def test_a_route_that_must_leave_backwards_turns_round_in_time() -> None:
    """A turning point with no curvature, a cusp, would be shorter."""
    route = modern.plan(task(turn_radius_m=500.0, start_course=-AHEAD))
    assert route.measures.turn_radius_m >= 500.0
    assert route.curve_m[:, 0].min() < -100.0
    assert route.measures.length_m > 10e3 + 0.5 * math.pi * 500.0


def test_without_threats_the_route_is_the_straight_way() -> None:
    assert modern.plan(task()).measures.length_m == pytest.approx(10e3, rel=1e-6)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"areas": (Area(START[None], 500.0),)}, "The start is within an area"),
        ({"areas": (Area(np.array([[4e3, -6e3], [6e3, -6e3], [6e3, 6e3], [4e3, 6e3]])),)}, "No way leads"),
        ({"turn_radius_m": 9e3, "start_course": -AHEAD}, "No way turns as wide as 9000 m"),
    ],
)
def test_what_is_in_the_way_is_said_in_one_sentence(changed: dict[str, object], says: str) -> None:
    with pytest.raises(PlanError, match=says):
        modern.plan(task(**changed))


def test_an_area_that_ends_below_the_band_is_flown_over_and_threats_are_further_away_higher_up() -> None:
    """The band's lowest level would have to go round the area; with a threat on the ground the top is best."""
    wall = Area(np.array([[8e3, -3e3], [9e3, -3e3], [9e3, 3e3], [8e3, 3e3]]), top_m=400.0)
    over = plan_flight(case(wall), Wishes(300.0, 600.0))
    assert over.level_m == pytest.approx(420.0)
    assert over.areas == ()
    assert heights(over)[over.route.curve_m[:, 0] > 8e3].min() == 420.0  # it has climbed by then
    assert plan_flight(case(height_m=0.0), Wishes(300.0, 600.0)).level_m == 600.0
    assert plan_flight(case(), Wishes(300.0, 600.0)).level_m == 300.0


@pytest.fixture(scope="module")
def homeward() -> Flight:
    """A drawn case that ends on the demo field's runway."""
    runway = DEMO_SITE.runway
    return plan_flight(drawn_case(2).moved_to(runway), Wishes(500.0, 500.0), runway=runway)


def test_few_waypoints_keep_the_polyline_near_the_curve(homeward: Flight) -> None:
    points, curve = waypoints(homeward), homeward.route.curve_m
    assert np.array_equal(points[[0, -1], :2], curve[[0, -1]])
    assert len(points) <= 20
    along = np.diff(points[:, :2], axis=0)
    from_each = curve[:, None] - points[:-1, :2]
    share = np.clip((from_each * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    apart = np.hypot(*(from_each - share[..., None] * along).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() <= TOLERANCE_M
    assert heights(homeward).max() == 500.0


def test_the_straights_between_waypoints_keep_out_of_areas_too() -> None:
    """The curve keeps away from them by as much as the straights may be off it."""
    circle = Area(np.array([[5e3, -1e3]]), 1.2e3)
    flight = plan_flight(replace(case(circle), threat_m=np.array([[5e3, 3e3]])))
    assert circle.distance(resampled(waypoints(flight)[:, :2], 5.0))[0].min() >= 0.0
    assert flight.route.measures.length_m > 10e3 + 10.0  # it goes round


def test_a_mission_to_a_runway_ends_on_its_glide_path_and_comes_back_from_the_file(
    homeward: Flight, tmp_path: Path
) -> None:
    runway, final = DEMO_SITE.runway, homeward.final
    items, home = mission(homeward, 40.0)
    ground_msl_m = runway.height_m - (runway.geoid_separation_m or 0.0)
    assert (items[0].command, items[-1].command) == (TAKE_OFF, LAND)
    assert items[-1].altitude_m == home[2] == pytest.approx(ground_msl_m)
    assert final is not None
    slope = final.height_m / math.dist(final.meets_m, final.aims_m)
    assert math.atan(slope) == pytest.approx(runway.glide_path_rad, abs=1e-4)
    path = tmp_path / "route.plan"
    path.write_text(format_plan(items, home))
    places = [one for one in items if one.command <= 95]
    for point, item in zip(read_mission(path)[1:], places, strict=True):
        assert abs(math.degrees(point.latitude_rad) - item.latitude_deg) <= 1e-7
        assert abs(math.degrees(point.longitude_rad) - item.longitude_deg) <= 1e-7


def test_places_on_the_plane_come_back_from_the_earth() -> None:
    plane, places = Plane(31.0, 104.0), np.array([[0.0, 0.0], [15e3, -8e3], [-40e3, 30e3]])
    np.testing.assert_allclose(plane.place_m(plane.place_deg(places)), places, atol=1e-5)


LOCAL = """
[route]
start_km = [1.0, 2.0]
goal_km = [9.0, 2.0]
[[threat]]
east_km = 5.0
north_km = 2.5
height_m = 40.0
[[area]]
name = "pond"
polygon_km = [[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]]
top_m = 200.0
"""


def test_a_case_is_read_from_toml_and_from_json_in_kilometres_and_in_degrees() -> None:
    local = parse_case(LOCAL, "t.toml", "t")
    assert local.threat_m.tolist() == [[5e3, 2.5e3]]
    assert local.threat_height_m.tolist() == [40.0]
    assert local.areas[0].top_m == 200.0
    assert not local.is_placed
    written = {
        "route": {"start_deg": [31.0, 104.0], "goal": "runway"},
        "threat": [{"latitude_deg": 31.1, "longitude_deg": 104.0}],
    }
    earthly = parse_case(json.dumps(written), "t.json", "t")
    assert earthly.is_placed
    assert earthly.goal == "runway"
    np.testing.assert_allclose(
        earthly.threat_m[0] - earthly.start, [0.0, 11_087.0], atol=2.0
    )  # a tenth of a degree there


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LOCAL.replace("[[threat]]", "[[thread]]"), "t.toml, line 5: unknown table 'thread'; perhaps threat is meant"),
        (LOCAL.replace("east_km = 5.0\n", ""), "threat]] 1 needs east_km and north_km"),
        (LOCAL.replace("top_m", "radius_m"), "area]] 1 needs a place and radius_m, or polygon_km"),
        (LOCAL.replace("start_km", "start_deg = [1, 2]\nstart_km"), "says start_km and start_deg"),
        ("{", "t.toml, line 1: this is not JSON"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(SiteError) as refused:
        parse_case(text, "t.toml", "t")
    assert says in str(refused.value)
