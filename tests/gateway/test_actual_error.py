"""The error that a filter of several modes makes, beside the one that it reckons with."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators import actual_error, kalman
from gateway.estimators.kalman import SIZE, Motion
from gateway.estimators.modes import Mode, Modes, begin, combine, moved, predict, stated, update

Floats = NDArray[np.float64]

FIX = np.eye(3, SIZE)[None]
SIGMA_M = 30.0
CALM, SHAKEN = Motion((0.0225,) * 3, 0.0), Motion((2.0,) * 3, 0.0)
MODES = Modes((Mode(0.0, CALM, 6.0), Mode(0.0, SHAKEN, 2.0), Mode(1.0, CALM), Mode(-1.0, CALM)), "rmimm", 6.0)


def _flown(modes: Modes, runs: int, seconds: int) -> tuple[Floats, Floats]:
    """NEES of the position, by second and run, on straight flight at 100 m/s: as told, and as the filter reckons."""
    chance = np.random.default_rng(5)
    true = np.zeros((runs, SIZE))
    true[:, 3] = 100.0
    place = SIGMA_M * chance.standard_normal((runs, 3))
    state = kalman.start(place, np.tile(SIGMA_M**2 * np.eye(3), (runs, 1, 1)), true[:, 3:6], np.full(runs, 20.0), 0.0)
    state.mean[:, 3:6] += 20.0 * chance.standard_normal((runs, 3))
    mixture, second = begin(state, modes), np.ones(runs)
    told, reckoned = [], []
    for _ in range(seconds):
        true[:, :3] += true[:, 3:6]
        mixture = predict(mixture, second, modes)
        measured = np.repeat(true[:, :3] + SIGMA_M * chance.standard_normal((runs, 3)), modes.count, axis=0)
        innovation = measured - mixture.each().mean[:, :3]
        mixture, _ = update(mixture, innovation, FIX, np.full((len(innovation), 3), SIGMA_M**2), modes)
        for one, into in ((stated(mixture), told), (combine(mixture), reckoned)):
            off = (one.mean - true)[:, :3, None]
            into.append((off.transpose(0, 2, 1) @ np.linalg.inv(one.covariance[:, :3, :3]) @ off)[:, 0, 0])
    return np.array(told), np.array(reckoned)


def test_what_is_told_is_the_error_of_straight_flight() -> None:
    """On straight flight the mean NEES of what is told is within 7 % of 3; of what the filter reckons with it is below 2.5."""
    told, reckoned = _flown(MODES, 150, 60)
    assert told[20:].mean() == pytest.approx(3.0, rel=0.07)
    assert reckoned[20:].mean() < 2.5


def test_one_mode_that_is_shaken_as_it_reckons_makes_the_error_that_it_reckons_with() -> None:
    """With all of the noise taking place, the error of a single mode is its own covariance, to rounding."""
    modes = Modes((Mode(0.0, SHAKEN),), "imm")
    state = kalman.start(np.zeros((2, 3)), np.tile(900.0 * np.eye(3), (2, 1, 1)), np.ones((2, 3)), np.ones(2), 10.0)
    mixture = begin(state, modes)
    error = mixture.error
    for _ in range(5):
        before, elapsed_s = mixture, np.array([0.4, 3.0])
        mixture = predict(mixture, elapsed_s, modes)
        carry, noise = moved(before.mean, before.weight, elapsed_s, modes)
        error = actual_error.carried_on(error, mixture.weight, carry, noise, share=1.0)
        state, told = kalman.update(mixture.each(), np.ones((2, 3)), FIX, np.full((2, 3), 400.0))
        error = actual_error.corrected(error, mixture.weight, told, state.mean[:, None], state.covariance[:, None])
        mixture, _ = update(mixture, np.ones((2, 3)), FIX, np.full((2, 3), 400.0), modes)
        assert error == pytest.approx(mixture.covariance[:, 0], rel=1e-9, abs=1e-9)


def test_modes_that_the_measurements_speak_against_hardly_count() -> None:
    """At its usual share of the time or above a mode counts by its weight, at a tenth of it by a hundredth."""
    shares = np.array([0.8, 0.1, 0.1])
    assert actual_error.counted(shares, shares) == pytest.approx(shares)
    assert actual_error.counted(np.array([0.09, 0.9, 0.01]), shares) == pytest.approx([0.09**2 / 0.8, 0.9, 0.001])


def test_what_something_else_has_bounded_is_bounded_here_too() -> None:
    """Where the filter's own covariance is less than half of the error's, the filter's is taken."""
    modes = Modes((Mode(0.0, CALM),), "imm")
    state = kalman.start(np.zeros((1, 3)), 900.0 * np.eye(3)[None], np.ones((1, 3)), np.ones(1), 0.0)
    _, told = kalman.update(state, np.full((1, 3), math.nan), FIX, np.full((1, 3), 400.0))
    reckoned = state.covariance.copy()
    reckoned[:, 2, 2] = 100.0
    weight = begin(state, modes).weight
    error = actual_error.corrected(state.covariance, weight, told, state.mean[:, None], reckoned[:, None])
    assert (error == reckoned).all()


def test_a_prediction_counts_the_modes_as_they_were_before_they_mixed() -> None:
    """What mixing gives a mode speaks for nothing: a turn that nothing speaks for is not counted ten seconds on either."""
    state = kalman.start(np.zeros((1, 3)), 900.0 * np.eye(3)[None], np.full((1, 3), 50.0), np.ones(1), 0.0)
    mixture = replace(begin(state, MODES), weight=np.array([[0.899, 0.1, 5e-4, 5e-4]]))
    ahead = predict(mixture, np.array([10.0]), MODES)
    assert ahead.weight[0, 2] > 0.05
    assert ahead.counted == pytest.approx(actual_error.counted(mixture.weight, MODES.shares))
    assert ahead.counted[0, 2] < 1e-5
