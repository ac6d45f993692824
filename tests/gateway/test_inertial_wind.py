"""What accelerations tell of the wind: where an aircraft stands, and how the wind changed while it flew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gateway.estimators.inertial_wind import Felt, stands
from sim.studies.reconstruction_wind import RATE_HZ, START_NS, Windy, rebuilt, windy


@pytest.fixture(scope="module")
def flown() -> Windy:
    """Ten minutes in a wind that wanders."""
    return windy(5)


def _felt(flown: Windy) -> Felt:
    felt = flown.told.felt(START_NS)
    assert felt is not None
    return felt


def test_accelerations_tell_how_the_wind_changed(flown: Windy) -> None:
    """Closed with one constant wind it is more than twice as far off; three sigma hold both ways."""
    constant, by_constant = rebuilt(flown, accelerations=False)
    felt, by_felt = rebuilt(flown, accelerations=True)
    assert not constant.by_accelerations
    assert felt.by_accelerations
    assert np.sqrt(np.mean(by_felt**2)) < 0.5 * np.sqrt(np.mean(by_constant**2))
    assert felt.sigma_m.max() < 0.67 * constant.sigma_m.max()
    assert np.mean(by_felt < 3.0 * felt.sigma_m + 1.0) > 0.95
    assert by_felt[0] == 0.0


def test_it_stands_before_it_rolls_and_after_it_has_stopped(flown: Windy) -> None:
    """Nothing within the roll counts as rest, and of what is at rest that next to the flight is taken."""
    before, after = stands(_felt(flown), 23.0, 623.0)
    assert before is not None
    assert after is not None
    assert 5.0 < before.since_s < before.until_s <= 15.0
    assert 631.0 <= after.since_s < 640.0


def test_steady_braking_is_no_rest(flown: Windy) -> None:
    """It is as quiet, but what is felt is not what was felt before it flew."""
    felt = _felt(flown)
    brakes = felt.force_mps2.copy()
    brakes[felt.time_s > 631.0] -= [1.0, 0.0, 0.0]
    before, after = stands(replace(felt, force_mps2=brakes), 23.0, 623.0)
    assert before is not None
    assert after is None


def test_vibration_that_samples_miss_leaves_the_wind_constant(flown: Windy) -> None:
    """Shaken by 5 m/s2 at a tenth of the samples accelerations tell too little to bend the wind; the path is the closed one."""
    told = windy(5).told
    time, force = told.forces[1].columns()
    told.forces.clear()
    moving = np.abs(force[:, :2]).max(axis=1, keepdims=True) > 1.5
    shaken = force + np.where(moving, 5.0, 0.0) * np.random.default_rng(1).standard_normal(force.shape)
    told.feel(1, time[::10], shaken[::10])
    sortie, off = rebuilt(replace(flown, told=told), accelerations=True)
    _, closed = rebuilt(flown, accelerations=False)
    assert not sortie.by_accelerations
    np.testing.assert_array_equal(off, closed)


def test_where_accelerations_are_missing_for_long_they_are_not_used(flown: Windy) -> None:
    """A minute without any in mid-flight."""
    told = windy(5).told
    time, force = told.forces[1].columns()
    told.forces.clear()
    second = (time - START_NS) / 1e9
    kept = (second < 200.0) | (second > 260.0)
    told.feel(1, time[kept], force[kept])
    sortie, _ = rebuilt(replace(flown, told=told), accelerations=True)
    assert not sortie.by_accelerations
    assert len(time) > 600 * RATE_HZ
