"""Two-segment prediction: paths whose ends can be reckoned by hand."""

import math

import numpy as np
import pytest

from gateway.estimators.circling import Circles
from gateway.estimators.turns_and_straights import angle_to_go
from gateway.estimators.two_segment import Ahead, Moving, Rule, ahead

DEG = math.pi / 180.0
RATE = 3.0 * DEG
SPEED = 100.0
RADIUS = SPEED / RATE
EAST = np.array([[SPEED, 0.0]])


def flown(
    route: list[list[float]], horizons: list[float], rate: float = 0.0, rule: Rule = "default", **more: float
) -> Ahead:
    now = Moving(np.zeros((1, 2)), EAST, np.array([rate]))
    wind = np.array([[more["wind_x"], more.get("wind_y", 0.0)]]) if more else None
    return ahead(now, np.array([route]), np.array(horizons), np.array([RATE]), rule=rule, wind=wind)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_turn_ends_where_the_tangent_goes_through_the_point(side: float) -> None:
    """From a point that is 90 degrees and a straight away the turn is exactly 90 degrees, to either side."""
    point = np.array([[RADIUS, side * (RADIUS + 5000.0)]])
    go = angle_to_go(np.zeros((1, 2)), np.zeros(1), np.array([RADIUS]), np.array([side]), point)
    assert go[0] == pytest.approx(90 * DEG)


def test_a_point_inside_the_circle_is_never_ahead() -> None:
    """There is no P, and the prediction is the model's: on in the turn."""
    route = [[0.0, RADIUS]]
    found = flown(route, [30.0], RATE, "literal")
    assert not found.follows[0]
    assert found.position[0, 0] == pytest.approx([RADIUS, RADIUS])


@pytest.mark.parametrize("rule", ["literal", "default"])
def test_a_turn_and_a_straight(rule: Rule) -> None:
    """30 s of turning by 90 degrees, then straight on to the point and, there being no other, beyond."""
    found = flown([[RADIUS, RADIUS + 3000.0]], [15.0, 30.0, 40.0, 70.0], RATE, rule)
    assert found.follows[0]
    half = RADIUS * math.sqrt(0.5)
    assert found.position[0, 0] == pytest.approx([half, RADIUS - half])
    assert found.position[0, 1] == pytest.approx([RADIUS, RADIUS])
    assert found.position[0, 2] == pytest.approx([RADIUS, RADIUS + 1000.0])
    assert found.position[0, 3] == pytest.approx([RADIUS, RADIUS + 4000.0])
    assert found.course[0] == pytest.approx([45 * DEG, 90 * DEG, 90 * DEG, 90 * DEG])


def test_who_flies_straight_turns_to_a_declared_point_the_short_way_unlike_in_the_print() -> None:
    """Default: right at the standard rate. Literal: no mode leads there, so the model's straight line."""
    route = [[RADIUS, -RADIUS - 3000.0]]
    assert flown(route, [40.0]).position[0, 0] == pytest.approx([RADIUS, -RADIUS - 1000.0])
    literal = flown(route, [40.0], rule="literal")
    assert not literal.follows[0]
    assert literal.position[0, 0] == pytest.approx([4000.0, 0.0])


def test_a_long_turn_goes_the_way_it_has_begun() -> None:
    """Turning left with the point to the right and behind: 270 degrees to the left."""
    found = flown([[-RADIUS, -3000.0 + RADIUS]], [90.0, 100.0], RATE)
    assert found.course[0] == pytest.approx([270 * DEG, 270 * DEG])
    assert found.turned[0, 1] == pytest.approx(270 * DEG)


def test_a_turn_that_has_gone_a_little_too_far_is_not_flown_round_again() -> None:
    """Turning left with the point 10 degrees to the right: it turns back."""
    found = flown([[10000.0 * math.cos(10 * DEG), -10000.0 * math.sin(10 * DEG)]], [60.0], RATE)
    assert found.turned[0, 0] < 15 * DEG


def test_further_points_are_flown_by() -> None:
    """East to a corner, then north: the turn begins a radius before the corner, and the point counts as passed in it."""
    corner = [6000.0, 0.0]
    found = flown([corner, [6000.0, 9000.0]], [(6000.0 - RADIUS) / SPEED, (6000.0 - RADIUS) / SPEED + 45.0])
    assert found.position[0, 0] == pytest.approx([6000.0 - RADIUS, 0.0])
    assert found.position[0, 1] == pytest.approx([6000.0, RADIUS + 1500.0])
    assert found.passed[0].tolist() == [1.0, 1.0]


def test_with_a_known_wind_the_ground_speed_follows_the_course() -> None:
    """Air speed 80 m/s in 20 m/s from the west: 100 eastward, after the turn westward 60."""
    found = flown([[0.0, 2 * RADIUS], [-20000.0, 2 * RADIUS]], [60.0, 100.0], RATE, wind_x=20.0)
    assert found.course[0, 0] == pytest.approx(180 * DEG, abs=0.01)
    assert np.linalg.norm(found.position[0, 1] - found.position[0, 0]) == pytest.approx(60.0 * 40.0, rel=0.01)


def test_without_a_point_it_is_the_model() -> None:
    """A route of NaN is no route: on in the turn, at constant speed."""
    found = flown([[math.nan, math.nan]], [60.0], RATE)
    assert not found.follows[0]
    assert found.position[0, 0] == pytest.approx([0.0, 2 * RADIUS], abs=1e-6)


def test_one_aircraft_has_the_same_bits_alone_and_among_many() -> None:
    """Nothing adds up over aircraft."""
    generator = np.random.default_rng(4)
    position, velocity = generator.normal(0, 3e3, (50, 2)), generator.normal(0, 60, (50, 2))
    rate, route = generator.choice([0.0, 0.05, -0.05], 50), generator.normal(0, 6e3, (50, 4, 2))
    route[::3, 2:] = math.nan
    wind, horizons, turning = generator.normal(0, 5, (50, 2)), np.array([10.0, 30.0, 60.0, 120.0]), np.full(50, 0.06)

    def some(rows: slice) -> Ahead:
        now = Moving(position[rows], velocity[rows], rate[rows])
        return ahead(now, route[rows], horizons, turning[rows], wind=wind[rows])

    together = some(slice(None))
    assert np.isfinite(together.position).all()
    for i in range(50):
        alone = some(slice(i, i + 1))
        assert (alone.position[0] == together.position[i]).all()


def test_who_begins_a_turn_late_turns_faster_and_is_on_the_next_leg() -> None:
    """East to a corner, then back at 120 degrees: with 900 m to turn in, it is on the line between the points, not beyond it."""
    now = Moving(np.zeros((1, 2)), EAST, np.zeros(1))
    back = [6000.0 - 9000.0 * 0.5, 9000.0 * math.sqrt(0.75)]
    route = np.array([[[6000.0, 0.0], back]])
    found = ahead(now, route, np.array([5100.0 / SPEED, 100.0]), np.array([RATE]), lead_m=np.array([900.0]))
    assert found.position[0, 0] == pytest.approx([5100.0, 0.0])
    way = found.position[0, 1] - [6000.0, 0.0]
    assert way[1] / -way[0] == pytest.approx(math.tan(60 * DEG), rel=0.01)


def test_past_the_last_point_it_is_straight_on() -> None:
    """A route that ends leads on as it came: there is no turn towards a point that is where it is."""
    found = flown([[6000.0, 0.0], [6000.0, 9000.0]], [200.0])
    assert found.course[0, 0] == pytest.approx(90 * DEG)
    assert found.over_s[0, 0] > 40.0


def test_a_circle_is_entered_from_its_middle_s_direction_and_left_towards_the_next_point() -> None:
    """Round a point to the left, at least once: on the circle in between, in the end on the way to the point after it.

    It is flown at the middle, with a turn away from it onto the circle that is made good for on it.
    """
    circles = Circles(np.array([[1000.0, math.nan]]), np.array([[2.0 * math.pi, 0.0]]))
    now = Moving(np.zeros((1, 2)), EAST, np.zeros(1))
    route = np.array([[[9000.0, 1000.0], [20000.0, 0.0]]])
    found = ahead(now, route, np.array([110.0, 140.0, 200.0]), np.array([0.2]), circles=circles)
    middle = np.array([9000.0, 1000.0])
    assert np.linalg.norm(found.position[0, 0] - middle) == pytest.approx(1000.0, rel=0.02)
    assert np.linalg.norm(found.position[0, 1] - middle) == pytest.approx(1000.0, rel=0.02)
    assert found.position[0, 2, 0] > 11_000.0
    assert 2.0 * math.pi + 2.0 < found.turned[0, 2] < 2.0 * math.pi + 3.0


def test_who_has_landed_comes_to_rest() -> None:
    """100 m/s, braked by 2 m/s2 from the last point on: 2500 m further, and no further."""
    now = Moving(np.zeros((1, 2)), EAST, np.zeros(1))
    found = ahead(now, np.array([[[1000.0, 0.0]]]), np.array([60.0, 120.0]), np.array([RATE]), braking=np.array([2.0]))
    assert found.position[0, :, 0] == pytest.approx([3500.0, 3500.0])
    assert found.over_s[0] == pytest.approx([50.0, 110.0])
