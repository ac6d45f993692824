"""Strapdown navigation and the error-state filter about it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators import inertial as ins
from gateway.estimators import plane_reckoning as plane
from gateway.estimators.inertial import Motion
from sim.inertial import Ride, aeroplane, car

Floats = NDArray[np.float64]
NAMES = ("latitude_rad", "longitude_rad", "height_m", "velocity_mps", "attitude")


def _at(truth: Ride, place: int) -> Motion:
    return Motion(*(np.asarray(getattr(truth.motion, name)[place]) for name in NAMES))


def _off_m(truth: Ride, place: int, motion: Motion) -> float:
    here = _at(truth, place)
    return float(np.linalg.norm(ins.between(here.latitude_rad, here.longitude_rad, here.height_m, motion)))


def test_a_perfect_unit_at_100_hz_reckons_200_seconds_to_half_a_metre() -> None:
    """A car and an aeroplane. The truth is made in steps of 2 ms; the unit tells the mean of five of them, as a real one does."""
    truths = [kind(np.random.default_rng(4), 200.0, 500.0) for kind in (car, aeroplane)]
    rates, forces = (
        np.stack([getattr(one, name).reshape(-1, 5, 3).mean(axis=1) for one in truths], axis=1)
        for name in ("rate_radps", "force_mps2")
    )
    motion = Motion(*(np.stack([getattr(one.motion, name)[0] for one in truths]) for name in NAMES))
    for rate, force in zip(rates, forces, strict=True):
        motion = ins.advanced(motion, rate, force, 0.01)
    for place, truth in enumerate(truths):
        ended = Motion(*(np.asarray(getattr(motion, name)[place]) for name in NAMES))
        assert _off_m(truth, -1, ended) < 0.5


def test_without_the_harmful_acceleration_it_is_tens_of_metres_off() -> None:
    """The earth turns below; the page has 41 m after 199 s at 25 m/s."""
    truth = aeroplane(np.random.default_rng(4), 199.0, 50.0)
    motion = _at(truth, 0)
    for rate, force in zip(truth.rate_radps, truth.force_mps2, strict=True):
        motion = ins.advanced(motion, rate, force, 0.02, harmful=False)
    assert 15.0 < _off_m(truth, -1, motion) < 100.0


def test_many_vehicles_have_the_bits_of_one() -> None:
    """A batch of three is three of one, to the last bit."""
    rides = [aeroplane(np.random.default_rng(seed), 3.0, 50.0) for seed in (1, 2, 3)]
    stacked = Motion(*(np.stack([np.asarray(getattr(one.motion, name)[0]) for one in rides]) for name in NAMES))

    def reckoned(motion: Motion, rates: Floats, forces: Floats) -> dr.Reckoning:
        state = dr.started(motion, 1.0, 0.1, 0.01)
        for rate, force in zip(rates, forces, strict=True):
            state = dr.carried_on(state, rate, force, 0.02)
            state, _ = dr.with_airspeed(state, 25.0, 1.0, 1.0)
        return state

    batch = reckoned(
        stacked, *(np.stack([getattr(one, name) for one in rides], axis=1) for name in ("rate_radps", "force_mps2"))
    )
    for place, one in enumerate(rides):
        alone = reckoned(_at(one, 0), one.rate_radps, one.force_mps2)
        assert (batch.motion.velocity_mps[place] == alone.motion.velocity_mps).all()
        assert (batch.covariance[place] == alone.covariance).all()


def test_standing_still_it_does_not_drift_and_nothing_is_nan() -> None:
    """A minute at rest, with a rest that is told once a second: it stays within a metre, biases are found."""
    generator = np.random.default_rng(7)
    attitude = ins.from_angles(0.02, -0.01, 1.0)
    motion = Motion(np.asarray(0.8), np.asarray(0.15), np.asarray(500.0), np.zeros(3), attitude)
    still = Motion(motion.latitude_rad, motion.longitude_rad, motion.height_m, np.zeros(3), attitude)
    state = dr.started(motion, 0.1, 0.1, 0.02)
    body = ins.matrix(attitude)
    force = body.T @ np.array([0.0, 0.0, -float(ins.gravity(0.8, 500.0))])
    rate = body.T @ ins.earth_rate(0.8)
    for sample in range(60 * 50):
        noisy = rate + 0.004 + 1e-3 * generator.standard_normal(3), force + 0.02 * generator.standard_normal(3)
        state = dr.carried_on(state, *noisy, 0.02)
        if sample % 50 == 0:
            state, _ = dr.with_velocity(state, np.zeros(3), 0.02)
    assert np.linalg.norm(ins.between(still.latitude_rad, still.longitude_rad, still.height_m, state.motion)) < 1.0
    assert np.isfinite(state.covariance).all()
    np.testing.assert_allclose(state.rate_bias_radps[:2], 0.004, atol=1e-3)
    literal = plane.Plane(np.zeros(6), np.eye(6))
    for _ in range(500):
        literal = plane.with_inertial(plane.predicted(literal, 0.02), 0.0, np.zeros(2))
    assert np.isfinite(literal.state).all()
    assert np.abs(literal.state).max() < 1e-9


def _measurements() -> list[tuple[str, Callable[[dr.Reckoning], tuple[dr.Reckoning, dr.Innovation]]]]:
    turned = ins.product(ins.turned_by([0.01, -0.02, 0.03]), ins.from_angles(0.3, 0.1, 0.5))
    return [
        ("place", lambda state: dr.with_place(state, 0.8, 0.15, 503.0, np.ones(3))),
        ("velocity", lambda state: dr.with_velocity(state, np.array([1.0, 2.0, 3.0]), np.ones(3))),
        ("attitude", lambda state: dr.with_attitude(state, turned, np.ones(3))),
        ("airspeed", lambda state: dr.with_airspeed(state, 27.0, 1.0, 1.0)),
        ("wheels", lambda state: dr.with_wheels(state, np.ones(2))),
    ]


@pytest.mark.parametrize(("name", "measure"), _measurements(), ids=[name for name, _ in _measurements()])
def test_what_a_measurement_expects_changes_with_the_state_as_the_filter_thinks(
    name: str, measure: Callable[[dr.Reckoning], tuple[dr.Reckoning, dr.Innovation]]
) -> None:
    """Each error state moved a little changes the innovation by the filter's own slope: told by gains of one state at a time."""
    motion = Motion(
        np.asarray(0.8),
        np.asarray(0.15),
        np.asarray(500.0),
        np.array([20.0, 9.0, -1.0]),
        ins.from_angles(0.3, 0.1, 0.5),
    )
    base = dr.started(motion, 1.0, 1.0, 1.0)
    base = dr.Reckoning(motion, base.rate_bias_radps, base.force_bias_mps2, np.array([3.0, -2.0]), base.covariance)
    _, expected = measure(base)
    small = 1e-6
    for place in range(dr.STATES):
        moved = np.zeros(dr.STATES)
        moved[place] = small
        _, after = measure(dr._corrected(base, moved, base.covariance))
        slope = -(after.off - expected.off) / small
        only = np.zeros((dr.STATES, dr.STATES))
        only[place, place] = 1.0
        _, alone = measure(dr.Reckoning(motion, base.rate_bias_radps, base.force_bias_mps2, base.wind_mps, only))
        claimed = np.diagonal(alone.covariance) - 1.0  # the square of the filter's slope, beside noise of 1
        np.testing.assert_allclose(
            slope**2, claimed, atol=1e-3 + 0.04 * (name == "attitude"), err_msg=f"{name}, state {place}"
        )


def test_the_covariance_is_carried_as_the_motion_is() -> None:
    """Each error state moved a little before a step is where the covariance's transition says it is after it."""
    truth = aeroplane(np.random.default_rng(3), 1.0, 50.0)
    motion, rate, force = _at(truth, 10), truth.rate_radps[10], truth.force_mps2[10]
    quiet = dr.Unit(*[0.0] * 8)
    base = dr.started(motion, 1.0, 1.0, 1.0)
    after = dr.carried_on(base, rate, force, 0.02, quiet)
    for place in range(15):
        moved = np.zeros(dr.STATES)
        moved[place] = 1e-5
        other = dr.carried_on(dr._corrected(base, moved, base.covariance), rate, force, 0.02, quiet)
        here = after.motion
        apart = np.concatenate(
            [
                ins.between(other.motion.latitude_rad, other.motion.longitude_rad, other.motion.height_m, here),
                other.motion.velocity_mps - here.velocity_mps,
                2.0 * ins.product(other.motion.attitude, here.attitude * [1.0, -1.0, -1.0, -1.0])[1:],
            ]
        )
        only = np.zeros((dr.STATES, dr.STATES))
        only[place, place] = 1.0
        carried = dr.carried_on(
            dr.Reckoning(motion, np.zeros(3), np.zeros(3), np.zeros(2), only), rate, force, 0.02, quiet
        )
        np.testing.assert_allclose((apart / 1e-5) ** 2, np.diagonal(carried.covariance)[:9], atol=2e-3)


def test_the_literal_filters_slopes_are_those_of_its_turn_rate() -> None:
    """The analytic derivatives agree with differences to 1e-6."""
    state = np.array([5.0, 12.0, 0.7, -3.0, -8.0, 1.1])
    slopes = plane.turn_rate_slopes(state)
    for place in range(6):
        step = np.zeros(6)
        step[place] = 1e-6
        difference = (plane.turn_rate(state + step) - plane.turn_rate(state - step)) / 2e-6
        assert slopes[place] == pytest.approx(float(difference), abs=1e-6)


def test_an_attitude_is_yaw_then_pitch_then_roll() -> None:
    """Three turns about the vehicle's own axes, one after the other; gravity at 45 degrees is the known one."""
    for roll, pitch, yaw in [(0.3, -0.2, 2.5), (-1.0, 0.9, -3.0), (0.0, 0.0, 0.0)]:
        turns = [ins.turned_by([0.0, 0.0, yaw]), ins.turned_by([0.0, pitch, 0.0]), ins.turned_by([roll, 0.0, 0.0])]
        wanted = ins.product(ins.product(turns[0], turns[1]), turns[2])
        np.testing.assert_allclose(ins.from_angles(roll, pitch, yaw), wanted, atol=1e-12)
    assert math.isclose(float(ins.gravity(math.radians(45.0), 0.0)), 9.80620, abs_tol=2e-4)
