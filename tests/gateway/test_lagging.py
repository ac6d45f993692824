"""A track that lags behind a manoeuvre says so."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators.kalman import Motion, start
from gateway.estimators.lagging import USUAL, faded, lag
from gateway.estimators.modes import Mode, Modes, begin, predict, stated, update

Floats = NDArray[np.float64]

PLACE = np.eye(3, 9)[None]
SIGMA_M = 20.0


def _followed(acceleration_mps2: float, runs: int = 60) -> tuple[Floats, Floats]:
    """Straight on for half a minute, then an acceleration that the mode does not know: NEES / 3 and told sigma, by second."""
    modes, random = Modes((Mode(0.0, Motion((0.02,) * 3, 0.0)),), "imm"), np.random.default_rng(2)
    true = np.zeros((runs, 3))
    state = start(true, np.tile(SIGMA_M**2 * np.eye(3), (runs, 1, 1)), np.zeros((runs, 3)), np.full(runs, 2.0), 0.0)
    state.mean[:, 3:6] += 2.0 * random.standard_normal((runs, 3))
    state.mean[:, :3] += SIGMA_M * random.standard_normal((runs, 3))
    mixture, nees, sigma = begin(state, modes), [], []
    for second in range(1, 46):
        true = true + np.array([0.0, acceleration_mps2 * max(second - 30.5, 0.0), 0.0])
        mixture = predict(mixture, np.ones(runs), modes)
        off = true + SIGMA_M * random.standard_normal((runs, 3)) - mixture.each().mean[:, :3]
        mixture, _ = update(mixture, off, PLACE, np.full((runs, 3), SIGMA_M**2), modes)
        told = stated(mixture)
        wrong = (told.mean[:, :3] - true)[:, :, None]
        nees.append((wrong.transpose(0, 2, 1) @ np.linalg.inv(told.covariance[:, :3, :3]) @ wrong).mean() / 3.0)
        sigma.append(np.sqrt(told.covariance[:, 1, 1].mean()))
    return np.array(nees), np.array(sigma)


def test_a_manoeuvre_that_nothing_expects_makes_the_track_less_sure() -> None:
    """Fifteen seconds into 2 m/s2 the sigma told is threefold, and the error below 2 of it; straight on, it is as told."""
    nees, sigma = _followed(2.0)
    quiet, calm = _followed(0.0)
    assert sigma[-1] > 3.0 * calm[-1]
    assert nees[-1] < 4.0
    assert quiet[10:].mean() == pytest.approx(1.0, abs=0.12)


def test_what_noise_makes_adds_nothing() -> None:
    """A mean of innovations as large as noise leaves it adds nothing at all; a larger one adds less than its own square."""
    covariance = np.diag([9.0, 9.0, 9.0, 1.0, 1.0, 1.0])[None]
    information = np.tile(np.eye(3), (1, 2, 1, 1))
    small = np.sqrt(0.99 * USUAL)[None, :, None] * [1.0, 0.0, 0.0]
    assert lag(small, information, covariance) is None
    large = np.array([[[10.0, 0.0, 0.0], [0.0, 20.0, 0.0]]])
    added = lag(large, information, covariance)
    assert added is not None
    expected = np.zeros((1, 6, 6))
    expected[0, 0, 0], expected[0, 4, 4] = np.array([100.0, 400.0]) - USUAL
    assert added == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_what_was_never_measured_lags_by_nothing() -> None:
    """Without any innovation in a direction nothing is said of it, and before the first of all nothing at all."""
    covariance = np.tile(100.0 * np.eye(9), (2, 1, 1))
    nothing, none = np.zeros((2, 2, 3)), np.zeros((2, 2, 3, 3))
    assert lag(nothing, none, covariance) is None
    level = np.eye(2, 9)[None].repeat(2, axis=0)
    score, information = faded(
        nothing, none, np.full((2, 2), 90.0), np.tile(100.0 * np.eye(2), (2, 1, 1)), level, np.ones(2)
    )
    added = lag(score, information, covariance)
    assert added is not None
    assert np.isfinite(added).all()
    assert (added[:, 0, 0] > 0.0).all()
    assert added[:, 2:] == pytest.approx(0.0, abs=1e-9)


def test_a_velocity_that_is_off_is_found_within_a_few_reports() -> None:
    """Five seconds into a turn that nothing expects innovations are within 4 of what is told, 20 of straight flight's."""
    modes, random, runs = Modes((Mode(0.0, Motion((0.25,) * 3, 0.0)),), "imm"), np.random.default_rng(4), 200
    state = start(np.zeros((runs, 3)), np.tile(np.eye(3), (runs, 1, 1)), np.zeros((runs, 3)), np.full(runs, 0.5), 0.0)
    mixture, variance = begin(state, modes), np.full((runs, 6), 0.25)
    fits, scatters = [], []
    for second in range(1, 26):
        since = max(second - 20.0, 0.0)
        true = np.array([0.0, 0.8 * since**3 / 6.0, 0.0, 0.0, 0.8 * since**2 / 2.0, 0.0])
        mixture = predict(mixture, np.ones(runs), modes)
        off = true + 0.5 * random.standard_normal((runs, 6)) - mixture.each().mean[:, :6]
        mixture, told = update(mixture, off, np.eye(6, 9)[None], variance, modes)
        fits.append(float((off[:, 4] ** 2 / told.scatter[:, 4, 4]).mean()))
        scatters.append(float(told.scatter[:, 4, 4].mean()))
    assert np.mean(fits[5:20]) == pytest.approx(1.0, abs=0.15)
    assert fits[-1] < 4.0
    assert float((off[:, 4] ** 2).mean()) > 20.0 * scatters[15]
