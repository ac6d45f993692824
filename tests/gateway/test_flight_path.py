"""Paths from flight parameters: integration, closing, fixes, sorties, air."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.estimators.flight_path import (
    closed,
    heading_bias,
    integrated,
    on_earth,
    pressure_height,
    smoothed,
    sorties,
    standard_pressure,
    true_airspeed,
)
from gateway.estimators.tied_path import Known, tied
from gateway.geodesy import enu_axes, geodetic_to_ecef


def _wandering(seed: int, count: int = 900) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, a path through the air, and where a wind that wanders at 0.2 m/s in a root second carried it."""
    generator = np.random.default_rng(seed)
    time = np.arange(count, dtype=np.float64)
    through_air = integrated(time, np.stack([20.0 * np.sin(time / 90.0), 20.0 * np.cos(time / 90.0)], axis=-1))
    wind = generator.normal(0.0, 6.0, 2) + np.cumsum(generator.normal(0.0, 0.2, (count, 2)), axis=0)
    return time, through_air, through_air + integrated(time, wind)


def test_one_exact_fix_at_the_end_is_closing() -> None:
    """Least squares with a wind that cannot wander spreads the error evenly over time."""
    time, path, true = _wandering(1)
    fixes = Known.places(time[-1:], true[-1:], np.array([1e-3]))
    found = tied(time, path, fixes, wind_sigma_mps=1e4, wanders_mps_per_sqrt_s=1e-6)
    expected, wind = closed(time, path, true[-1])
    np.testing.assert_allclose(found.path_m, expected, atol=0.01)
    np.testing.assert_allclose(found.wind_mps.mean(axis=0), wind, atol=1e-4)


def test_more_fixes_bring_the_path_closer_and_the_sigma_tells_by_how_much() -> None:
    """Over forty winds the squared error is the claimed variance within a third, and falls with each further fix."""
    ratios, errors = [], []
    for known in (1, 3, 8):
        share, off = [], []
        for seed in range(40):
            time, path, true = _wandering(seed)
            at = np.linspace(0, len(time) - 1, known + 1).astype(int)[1:]
            found = tied(time, path, Known.places(time[at], true[at], np.full(known, 3.0)))
            some = slice(20, -20, 20)
            error = (found.path_m - true)[some]
            share.append(np.mean(error**2 / found.sigma_m[some, None] ** 2))
            off.append(np.mean(np.sum(error**2, axis=1)))
        ratios.append(float(np.mean(share)))
        errors.append(math.sqrt(float(np.mean(off))))
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2]
    assert all(0.67 < ratio < 1.5 for ratio in ratios)


def test_the_first_sample_stays() -> None:
    """Whatever the fixes say, the path begins where it began."""
    time, path, true = _wandering(2)
    found = tied(time, path, Known.places(time[[300, 800]], true[[300, 800]], np.array([3.0, 3.0])))
    assert (found.path_m[0] == path[0]).all()
    assert found.sigma_m[0] == 0.0


def test_north_turns_along_the_way() -> None:
    """300 km to the east of lift-off along a parallel the path is where the ellipsoid has it, to 0.1 %; flat it is 3 % off."""
    latitude = math.radians(49.0)
    time = np.arange(0.0, 3001.0)
    velocity = np.tile([100.0, 0.0], (len(time), 1))
    around = latitude, 300e3 / (6_388_000.0 * math.cos(latitude))
    true = enu_axes(latitude, 0.0) @ (geodetic_to_ecef(*around, 0.0) - geodetic_to_ecef(latitude, 0.0, 0.0))
    flat = integrated(time, velocity)[-1]
    round_path = on_earth(time, velocity, latitude)[-1]
    assert np.linalg.norm(round_path - true[:2]) < 300.0
    assert np.linalg.norm(flat - true[:2]) > 7000.0


def test_a_recording_that_ends_in_the_air_ends_its_sortie_there() -> None:
    """The last sample is the sortie's end."""
    time = np.arange(300.0)
    assert sorties(time, np.where(time > 50, 30.0, 0.0), 15.0, 10.0, smoothed_over_s=0.0) == [(51, 299)]


def test_what_is_shorter_than_a_minute_is_no_sortie() -> None:
    """A run-up on the ground does not fly."""
    time = np.arange(300.0)
    speed = np.where((time > 20) & (time < 60), 30.0, 0.0) + np.where((time > 120) & (time < 200), 30.0, 0.0)
    assert [(first, last) for first, last in sorties(time, speed, 15.0, 10.0)] == [(121, 201)]


def test_a_landing_speed_above_the_take_off_speed_is_refused() -> None:
    """A sortie would end as it begins."""
    with pytest.raises(ValueError, match="below the take-off speed"):
        sorties(np.arange(9.0), np.zeros(9), 10.0, 10.0)


@given(st.floats(-400.0, 10_000.0), st.floats(-400.0, 10_000.0))
def test_pressure_and_height_undo_each_other(low: float, high: float) -> None:
    """Up from one pressure to another is the difference of their heights."""
    difference = pressure_height(standard_pressure(high), float(standard_pressure(low)))
    assert float(difference) == pytest.approx(high - low, abs=1e-6)


def test_thin_air_makes_the_airspeed_true() -> None:
    """At 10 000 ft in the standard air it is 16.4 % more than indicated; in warm air more."""
    pressure = standard_pressure(3048.0)
    assert float(true_airspeed(100.0, pressure)) == pytest.approx(116.4, abs=0.1)
    assert float(true_airspeed(100.0, pressure, 288.0)) == pytest.approx(
        100.0 * math.sqrt(101325.0 / pressure * 288.0 / 288.15)
    )


def test_without_a_roll_nothing_is_known_of_the_heading() -> None:
    """NaN, not nought."""
    assert all(math.isnan(one) for one in heading_bias(np.zeros(5), np.full(5, 80.0), 70.0, 0.0))


def test_smoothing_keeps_a_constant_and_its_edges() -> None:
    """The mean of equal numbers is that number, whatever the times."""
    time = np.sort(np.random.default_rng(1).uniform(0.0, 60.0, 200))
    np.testing.assert_allclose(smoothed(time, np.full(200, 7.0)), 7.0)
