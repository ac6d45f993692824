"""Intent: the paper's formulas on numbers that can be reckoned by hand, and what keeps a batch from touching a result."""

import math

import numpy as np
import pytest

from gateway.estimators import intent
from gateway.estimators.intent import Inference, Seen
from gateway.estimators.kalman import Motion
from gateway.estimators.modes import Mode, Modes

DEG = math.pi / 180.0
HERE, NORTH = np.zeros((1, 2)), np.array([[0.0, 100.0]])
CALM = Motion((0.04, 0.04, 0.04), 0.0)
PAPER = Modes((Mode(0.0, CALM), Mode(1.0, CALM), Mode(-1.0, CALM)), "rmimm", -1.0 / math.log(0.955))


def point(compass_deg: float, distance_m: float = 1000.0) -> list[float]:
    return [distance_m * math.sin(compass_deg * DEG), distance_m * math.cos(compass_deg * DEG)]


def test_angles_are_to_the_left_and_do_not_mirror_about_north() -> None:
    """Points 20 degrees left and right of a northern course differ, which the printed arccos could not tell."""
    off = intent.off_course(HERE, NORTH, np.array([[point(-20), point(20), point(180)]]))
    assert off[0, :2] == pytest.approx([20 * DEG, -20 * DEG])
    assert abs(off[0, 2]) == pytest.approx(math.pi)


def test_agreement_falls_with_the_angle_by_five_degrees() -> None:
    """One sigma off weighs exp(-1/2) of dead ahead (eq 17, without its constant)."""
    off = np.array([[0.0, 5 * DEG, 10 * DEG]])
    _, weight = intent.seen(Seen.nothing(1, 3), off, np.zeros(1, dtype=np.int64), np.ones(1), Inference())
    assert weight[0] == pytest.approx([1.0, math.exp(-0.5), math.exp(-2.0)])


def test_the_past_fades_by_a_tenth_a_second() -> None:
    """After agreements 1 and then exp(-2) the weight is (0.9 + exp(-2)) / 1.9 (eq 18); the gap's length counts."""
    straight = np.zeros(1, dtype=np.int64)
    before, _ = intent.seen(Seen.nothing(1, 1), np.zeros((1, 1)), straight, np.ones(1), Inference())
    _, weight = intent.seen(before, np.full((1, 1), 10 * DEG), straight, np.ones(1), Inference())
    assert weight[0, 0] == pytest.approx((0.9 + math.exp(-2.0)) / 1.9)
    _, later = intent.seen(before, np.full((1, 1), 10 * DEG), straight, np.full(1, 3.0), Inference())
    assert later[0, 0] == pytest.approx((0.9**3 + math.exp(-2.0)) / (0.9**3 + 1.0))


def test_a_change_of_mode_begins_anew() -> None:
    """What was seen before a turn does not count after it."""
    straight, left = np.zeros(1, dtype=np.int64), np.ones(1, dtype=np.int64)
    one, _ = intent.seen(Seen.nothing(1, 1), np.full((1, 1), 10 * DEG), straight, np.ones(1), Inference())
    two, _ = intent.seen(one, np.zeros((1, 1)), left, np.ones(1), Inference())
    _, weight = intent.seen(two, np.zeros((1, 1)), straight, np.ones(1), Inference())
    assert weight[0, 0] == 1.0


def test_in_a_manoeuvre_the_literal_rule_takes_the_growth_and_the_default_the_angle_to_go() -> None:
    """Turning left with points 30 degrees ahead on either side: literal sees both alike, default the one to the left."""
    left = np.ones(1, dtype=np.int64)
    off = np.array([[30 * DEG, -30 * DEG]])
    nearer = off - 5 * DEG
    before, _ = intent.seen(Seen.nothing(1, 2), off, left, np.ones(1), Inference.of("literal"))
    _, literal = intent.seen(before, nearer, left, np.ones(1), Inference.of("literal"))
    grown = math.exp(-0.5 * 5.0**2) - math.exp(-0.5 * 6.0**2)
    shrunk = math.exp(-0.5 * 7.0**2) - math.exp(-0.5 * 6.0**2)
    assert literal[0] == pytest.approx([grown, shrunk])
    _, default = intent.seen(Seen.nothing(1, 2), off, left, np.ones(1), Inference())
    assert default[0] == pytest.approx([math.exp(-0.5), math.exp(-330.0 / 60.0)])


def test_who_has_turned_a_little_too_far_does_not_go_round() -> None:
    """10 degrees beyond its point is 10 degrees; 20 degrees beyond is all the way round but 20."""
    left = intent.to_turn(np.array([[-10 * DEG, -20 * DEG, 90 * DEG]]), np.ones(1, dtype=np.int64))
    assert left[0] == pytest.approx([10 * DEG, 340 * DEG, 90 * DEG])


def test_regulation_outweighs_the_plan() -> None:
    """At equal times to go the un-normalised weights are exp(-t^2 / 2 sigma^2) with 900, 170 and, as printed, 17 s."""
    time_s, planned = np.array([[85.0, 85.0]]), np.array([[True, False]])
    default = intent.by_time(time_s, planned, Inference())[0]
    assert default == pytest.approx([math.exp(-0.125), math.exp(-0.5 * (85 / 900) ** 2)])
    literal = intent.by_time(time_s, planned, Inference.of("literal"))[0]
    assert literal[0] == pytest.approx(math.exp(-12.5))
    assert literal[1] == default[1]


def test_a_point_that_does_not_fit_is_not_believed_for_want_of_another() -> None:
    """A lone candidate 20 degrees off has next to no confidence, dead ahead nearly all; without candidates there is none."""
    off = np.array([[0.0, math.nan], [20 * DEG, math.nan], [math.nan, math.nan]])
    _, weight = intent.seen(Seen.nothing(3, 2), off, np.zeros(3, dtype=np.int64), np.ones(3), Inference())
    belief = intent.believed(weight, off, Inference())
    assert belief.best.tolist() == [0, 0, -1]
    assert belief.confidence[0] > 0.95
    assert belief.confidence[1] < 0.02
    assert belief.confidence[2] == 0.0


def test_two_points_in_one_line_share_the_confidence_but_not_the_direction() -> None:
    """Each has half of it, and where the aircraft is going is sure all the same."""
    off = np.array([[0.0, 1 * DEG, 40 * DEG]])
    _, weight = intent.seen(Seen.nothing(1, 3), off, np.zeros(1, dtype=np.int64), np.ones(1), Inference())
    belief = intent.believed(weight, off, Inference())
    assert belief.confidence[0] == pytest.approx(0.5, abs=0.02)
    assert belief.direction[0] > 0.95


def test_a_known_point_makes_straight_flight_stay_and_turns_end() -> None:
    """Of modes kept with 0.97 over a second: 0.98 and 0.90 with the point ahead, 0.97 all without (2.2, feedback)."""
    second, aligned = np.ones(2), np.array([True, False])
    changes = intent.transition(PAPER, second, aligned)
    assert changes.sum(axis=2) == pytest.approx(np.ones((2, 3)))
    assert np.diag(changes[1]) == pytest.approx([0.97, 0.97, 0.97])
    assert changes[0, 0, 0] == pytest.approx(0.98, abs=2e-4)
    assert changes[0, 1, 0] == pytest.approx(1.0 - 0.985 ** (10.0 / 3.0))
    assert changes[0, 1, 2] > 0.0


def test_one_aircraft_has_the_same_bits_alone_and_among_many() -> None:
    """Nothing adds up over aircraft."""
    generator = np.random.default_rng(5)
    position, velocity = generator.normal(0, 5e3, (40, 2)), generator.normal(0, 80, (40, 2))
    points = generator.normal(0, 2e4, (40, 20, 2))
    turning = generator.integers(-1, 2, 40)

    def share(some: slice) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        off = intent.off_course(position[some], velocity[some], points[some])
        count = len(off)
        _, weight = intent.seen(Seen.nothing(count, 20), off, turning[some], np.ones(count), Inference())
        time_s = intent.time_to_go(position[some], velocity[some], points[some])
        weight = weight * intent.by_time(time_s, np.zeros((count, 20), dtype=np.bool_), Inference())
        return intent.believed(weight, off, Inference()).share

    together = share(slice(None))
    assert all((share(slice(i, i + 1))[0] == together[i]).all() for i in range(40))
