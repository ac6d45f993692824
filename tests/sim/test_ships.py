"""Ships: the hull's model, the sea and the wave filter are what their formulas say."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim.ships.autopilots import Gains, Pid, Steering, build_autopilot, place_poles
from sim.ships.expert import RULES, Expert
from sim.ships.hull import Hull, Ship, Weather, sail
from sim.ships.track_control import Along, Route, TrackControl, deviation, is_arrived, next_leg, wanted_heading
from sim.ships.voyage import STEP_S, Sea, make_voyage
from sim.ships.wave_filter import wave_filter
from sim.ships.waves import Waves, draw

HULL = Hull()


def test_a_ship_under_constant_rudder_turns_as_nomotos_model_does() -> None:
    """The rate follows K d (1 - exp(-t / T)) to 1e-5 of itself, and the heading its integral."""
    rudder = math.radians(10.0)
    ship = replace(Ship.under_way((), 7.7), rudder_rad=np.array(rudder))
    for _ in range(500):
        ship = sail(HULL, ship, rudder, Weather(), STEP_S)
    steady, share = HULL.gain_per_s * rudder, 1.0 - math.exp(-100.0 / HULL.lag_s)
    assert float(ship.rate_radps) == pytest.approx(steady * share, rel=1e-5)
    assert float(ship.heading_rad) == pytest.approx(steady * (100.0 - HULL.lag_s * share), rel=1e-5)


def test_norrbins_term_makes_the_steady_rate_smaller() -> None:
    """The steady rate solves r + a r^3 = K d."""
    hull = Hull(norrbin_s2=400.0)
    ship = Ship.under_way((), 7.7)
    for _ in range(2000):
        ship = sail(hull, ship, math.radians(20.0), Weather(), STEP_S)
    rate = float(ship.rate_radps)
    assert rate + 400.0 * rate**3 == pytest.approx(hull.gain_per_s * math.radians(20.0), rel=1e-6)


def test_a_batch_of_ships_sails_as_each_alone() -> None:
    """Three speeds at once have the bits of each by itself."""
    speeds = np.array([3.0, 7.7, 12.0])
    autopilot = build_autopilot("adaptive", HULL, Waves(), STEP_S)
    together = make_voyage(HULL, Ship.under_way((3,), speeds), autopilot, Sea(), 60.0, heading_rad=1.0)
    for place, speed in enumerate(speeds):
        alone = make_voyage(HULL, Ship.under_way((), speed), autopilot, Sea(), 60.0, heading_rad=1.0)
        np.testing.assert_array_equal(together.heading_rad[:, place], alone.heading_rad)


def test_waves_have_the_deviation_and_the_period_that_were_asked_for() -> None:
    """Heading and rate deviate as asked for, 2 degrees and that times the frequency, and the one is the other's slope."""
    sea = Waves()
    heading, rate = draw(sea, 1500, (400,), STEP_S, np.random.default_rng(1))
    # 400 seas of 300 s hold some 20 000 independent values: 2 % is four standard errors of a deviation
    assert heading.std() == pytest.approx(sea.sigma_rad, rel=0.02)
    assert rate.std() == pytest.approx(sea.sigma_rad * sea.peak_radps, rel=0.02)
    slope = (heading[2:] - heading[:-2]) / (2.0 * STEP_S)
    assert np.std(slope - rate[1:-1]) < 0.15 * rate.std()  # what the rate wanders in two steps


def test_placed_poles_are_where_they_were_placed() -> None:
    """The closed loop's characteristic polynomial has the pair and the slow pole of the docstring, for three ships."""
    for gain, lag in ((0.072, 41.6), (0.028, 107.0), (0.2, 15.0)):
        gains = place_poles(gain, lag, 0.05, 0.9)
        loop = [lag, 1.0 + gain * gains.derivative, gain * gains.proportional, gain * gains.integral]
        wanted = np.poly([-0.005, *np.roots([1.0, 2 * 0.9 * 0.05, 0.05**2])])
        np.testing.assert_allclose(np.array(loop) / lag, wanted, rtol=1e-9)


def test_the_integral_learns_only_near_the_heading_and_within_the_stops() -> None:
    """Helm does not change at 10 degrees of error, nor while the order is at the limit; it does at 1 degree."""
    law = Pid(Gains(1.0, 0.1, 0.0), HULL.rudder_limit_rad)

    def learnt(error_deg: float, helm_deg: float = 0.0) -> float:
        still = np.zeros(())
        seen = Steering(np.radians(error_deg), still, np.array(7.7), still, np.radians(helm_deg))
        return float(law(seen, STEP_S)[1] - seen.helm_rad)

    assert learnt(10.0) == 0.0
    assert learnt(1.0) == pytest.approx(0.1 * STEP_S * math.radians(1.0))
    assert (
        Pid(Gains(100.0, 0.1), HULL.rudder_limit_rad)(
            Steering(np.radians(1.0), np.zeros(()), np.array(7.7), np.zeros(()), np.zeros(())), STEP_S
        )[1]
        == 0.0
    )


def test_the_wave_filter_tells_ship_from_waves() -> None:
    """It leaves a fifth of the waves at most, on a steady ship and through a turn that the rudder makes."""
    sea = Waves()
    seen, rates = draw(sea, 2000, (), STEP_S, np.random.default_rng(2))
    filter_ = wave_filter(HULL, 7.7, sea, STEP_S)
    state = filter_.start(np.zeros(()))
    ship, off = Ship.under_way((), 7.7), []
    for step in range(2000):
        rudder = ship.rudder_rad
        ship = sail(HULL, ship, math.radians(5.0 if step > 1000 else 0.0), Weather(), STEP_S)
        between = 0.5 * (rudder + ship.rudder_rad)
        state = filter_.step(state, between, ship.heading_rad + seen[step], ship.rate_radps + rates[step])
        off.append(float(state[2] - ship.heading_rad))
    assert np.sqrt(np.mean(np.square(off[300:]))) < 0.2 * sea.sigma_rad  # 0.15 is measured


def test_a_wave_filters_gain_is_the_one_a_kalman_filter_ends_with() -> None:
    """It is that of 3000 ordinary steps of the Riccati equation."""
    from sim.ships.wave_filter import steady_gain

    carry, seen = np.array([[1.0, 0.2], [0.0, 0.99]]), np.array([[1.0, 0.0]])
    noise, measured = np.diag([1e-6, 1e-4]), np.array([[1e-2]])
    uncertain = np.eye(2)
    for _ in range(3000):
        ahead = carry @ uncertain @ carry.T + noise
        gain = ahead @ seen.T @ np.linalg.inv(seen @ ahead @ seen.T + measured)
        uncertain = ahead - gain @ seen @ ahead
    np.testing.assert_allclose(steady_gain(carry, seen, noise, measured), gain, rtol=1e-9)


@pytest.mark.parametrize(
    ("error_deg", "rate_degps", "rudder_deg", "rule"),
    [
        (0.1, 0.0, 0.0, "steady so"),
        (40.0, 0.0, 0.0, "hard over"),
        (-40.0, 0.0, 0.0, "hard over"),
        (10.0, 0.0, 0.0, "steady"),
        (10.0, 2.0, 35.0, "meet her"),
        (-10.0, -2.0, -35.0, "meet her"),
        (60.0, 0.5, 35.0, "hard over"),
    ],
)
def test_each_rule_has_its_case(error_deg: float, rate_degps: float, rudder_deg: float, rule: str) -> None:
    """A helmsman's situations, to either side, and the rule that answers each."""
    law = build_autopilot("expert", HULL, None, STEP_S).law
    assert isinstance(law, Expert)
    angles = (np.radians(one) for one in (error_deg, rate_degps))
    seen = Steering(*angles, np.array(7.7), np.radians(rudder_deg), np.zeros(()))
    assert RULES[int(law.rule(seen))] == rule


def test_a_leg_ends_within_reach_or_once_passed() -> None:
    """Beyond reach it goes on; within reach, or abeam of its end, the next one is taken; after the last one is arrival."""
    route = Route(np.array([[0.0, 0.0], [0.0, 1000.0], [1000.0, 1000.0]]), reach_m=100.0)
    first = np.array([0, 0, 0])
    east, north = np.array([0.0, 0.0, 400.0]), np.array([800.0, 950.0, 1001.0])
    assert next_leg(route, first, east, north).tolist() == [0, 1, 1]
    last = np.array([1, 1])
    assert is_arrived(route, last, np.array([990.0, 1001.0]), np.array([1000.0, 1000.0])).tolist() == [False, True]


def test_track_control_steers_back_to_either_side_of_a_leg() -> None:
    """To the right of a northward leg the heading is to the left of it by atan(e / D), and the other way round."""
    route = Route(np.array([[0.0, 0.0], [0.0, 1000.0]]), reach_m=100.0)
    east = np.array([200.0, -200.0])
    place, still = (east, np.zeros(2)), np.zeros(2)
    off = deviation(route, np.zeros(2, np.int64), *place)
    np.testing.assert_allclose(off.right_m, east)
    wanted, _ = wanted_heading(
        TrackControl("los"), route, Along.start((2,)), place, still, (still, still + 7.7), STEP_S
    )
    np.testing.assert_allclose(wanted, -np.arctan(east / 400.0))
