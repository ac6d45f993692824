"""Accelerations that last: their motion and noise, what the course does to noise, and the two states more in a set of modes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from gateway.estimators.holding import WIDE, Held, usual
from gateway.estimators.kalman import Motion, start
from gateway.estimators.modes import Mode, Modes, begin, combine, moved, predict, update

Floats = NDArray[np.float64]

HELD = Held(1.0, 0.2, 30.0)
CALM = Motion((0.4, 0.4, 0.1), 20.0, 900.0)
SHARE = 0.25
MODES = Modes((Mode(0.0, CALM, along=SHARE), Mode(0.0, CALM, holds=True), Mode(1.0, CALM)), "imm", acceleration=HELD)
PLACE = np.eye(3, 9)[None]


def _moved(elapsed_s: float, course_rad: float) -> tuple[Floats, Floats]:
    """Transition and noise (3, 11, 11) of the modes at 100 m/s on a course."""
    mean = np.zeros((1, 3, WIDE))
    mean[..., 3:5] = 100.0 * np.cos(course_rad), 100.0 * np.sin(course_rad)
    carry, noise = moved(mean, np.full((1, 3), 1.0 / 3.0), np.array([elapsed_s]), MODES)
    return carry[0], noise[0]


def _differential(turned: Floats) -> tuple[Floats, Floats]:
    """Equation of motion and noise density (11, 11) of the mode that holds."""
    a, q = np.zeros((WIDE, WIDE)), np.zeros((WIDE, WIDE))
    a[:3, 3:6], a[3:5, 9:] = np.eye(3), np.eye(2)
    a[6:9, 6:9], a[9:, 9:] = -np.eye(3) / CALM.error_time_constant_s, -np.eye(2) / HELD.lasts_s
    q[3:6, 3:6] = np.diag(CALM.acceleration_density)
    q[6:9, 6:9] = 2.0 * CALM.error_sigma_m**2 / CALM.error_time_constant_s * np.eye(3)
    variance = np.diag([HELD.along_mps2**2, HELD.across_mps2**2])
    q[9:, 9:] = 2.0 / HELD.lasts_s * turned @ variance @ turned.T
    return a, q


@given(st.floats(0.05, 200.0), st.floats(-math.pi, math.pi))
def test_what_is_held_moves_as_its_differential_equation_says(elapsed_s: float, course_rad: float) -> None:
    """Transition and noise are those of the matrix exponential (Van Loan), from parts of a second to minutes, on any course."""
    carry, noise = _moved(elapsed_s, course_rad)
    turned = np.array([[math.cos(course_rad), -math.sin(course_rad)], [math.sin(course_rad), math.cos(course_rad)]])
    a, q = _differential(turned)
    wanted, shaken, step = np.eye(WIDE), np.zeros((WIDE, WIDE)), elapsed_s / 8.0
    both = expm(np.block([[-a, q], [np.zeros((WIDE, WIDE)), a.T]]) * step)
    part, grown = both[WIDE:, WIDE:].T, both[WIDE:, WIDE:].T @ both[:WIDE, WIDE:]
    for _ in range(8):
        wanted, shaken = part @ wanted, part @ shaken @ part.T + grown
    # The reference is a product of eight exponentials: where nothing stands it has what rounding leaves of its largest entry.
    np.testing.assert_allclose(carry[1], wanted, rtol=1e-8, atol=1e-8 + 1e-11 * wanted.max())
    scale = np.sqrt(np.outer(shaken.diagonal(), shaken.diagonal()))
    np.testing.assert_allclose(noise[1] / scale, shaken / scale, rtol=1e-7, atol=1e-7)


@given(st.floats(0.01, 100.0), st.floats(0.0, 1.0), st.floats(-math.pi, math.pi))
def test_two_moves_are_one(elapsed_s: float, share: float, course_rad: float) -> None:
    """Straight modes over two times are those over the sum: whatever was measured in between may as well not have been."""
    whole, noise = _moved(elapsed_s, course_rad)
    first, before = _moved(elapsed_s * share, course_rad)
    last, after = _moved(elapsed_s * (1.0 - share), course_rad)
    for mode in (0, 1):
        np.testing.assert_allclose(last[mode] @ first[mode], whole[mode], rtol=1e-9, atol=1e-9)
        carried = last[mode] @ before[mode] @ last[mode].T + after[mode]
        scale = np.sqrt(np.outer(noise[mode].diagonal(), noise[mode].diagonal()))
        np.testing.assert_allclose(carried / scale, noise[mode] / scale, rtol=1e-7, atol=1e-7)


@given(st.floats(0.1, 10.0), st.floats(-math.pi, math.pi))
def test_calm_flight_wanders_across_its_course(elapsed_s: float, course_rad: float) -> None:
    """Along the course the noise's sigma is the share of the one across, in position and velocity; upright it is untouched."""
    _, noise = _moved(elapsed_s, course_rad)
    along, across = (
        np.array([math.cos(course_rad), math.sin(course_rad)]),
        np.array([-math.sin(course_rad), math.cos(course_rad)]),
    )
    for rows in (slice(0, 2), slice(3, 5)):
        block = noise[0][rows, rows]
        assert along @ block @ along == pytest.approx(SHARE**2 * (across @ block @ across), rel=1e-9)
        assert along @ block @ across == pytest.approx(0.0, abs=1e-9 * np.trace(block))
    assert noise[0][5, 5] == pytest.approx(CALM.acceleration_density[2] * elapsed_s)


def test_an_aircraft_that_brakes_is_followed_without_lagging() -> None:
    """Two minutes of braking with 0.3 m/s2, reported each second to 5 m: the mode that holds finds it, and lags half as far."""
    runs, random = 20, np.random.default_rng(1)
    held = Held(1.0, 0.5, 40.0)
    calm = Motion((0.02,) * 3, 0.0)
    sets = {
        "holds": Modes((Mode(0.0, calm), Mode(0.0, calm, holds=True)), "imm", 20.0, acceleration=held),
        "does not": Modes((Mode(0.0, calm), Mode(0.0, replace(calm, acceleration_density=(0.1,) * 3))), "imm", 20.0),
    }
    true = np.zeros((runs, 3))
    state = start(
        true, np.tile(25.0 * np.eye(3), (runs, 1, 1)), np.tile([100.0, 0.0, 0.0], (runs, 1)), np.ones(runs), 0.0
    )
    mixtures = {name: begin(state, modes) for name, modes in sets.items()}
    speed, lags = 100.0, {name: [] for name in sets}
    for second in range(120):
        true = true + np.array([speed - 0.15, 0.0, 0.0])
        speed -= 0.3
        measured = true + 5.0 * random.standard_normal((runs, 3))
        for name, modes in sets.items():
            ahead = predict(mixtures[name], np.ones(runs), modes)
            off = np.repeat(measured, modes.count, axis=0) - ahead.each().mean[:, :3]
            mixtures[name], _ = update(ahead, off, PLACE, np.full(off.shape, 25.0), modes)
            if second >= 40:
                lags[name].append((combine(mixtures[name]).mean[:, 0] - true[:, 0]).mean())
    assert 0.0 < np.mean(lags["holds"]) < 0.5 * np.mean(lags["does not"])
    assert combine(mixtures["holds"]).mean.shape == (runs, 9)
    assert mixtures["holds"].weight[:, 1].mean() > 0.6
    assert mixtures["holds"].mean[:, 1, 9].mean() == pytest.approx(-0.3, abs=0.05)


@pytest.mark.parametrize(
    ("speed_mps", "along_mps2"), [(0.0, 0.2), (15.0, 0.2), (80.0, 0.2), (100.0, 0.3), (120.0, 0.432), (300.0, 1.0)]
)
def test_the_fast_brake_by_their_drag(speed_mps: float, along_mps2: float) -> None:
    """Along the course it grows with the square of speed, from what slow aircraft have to what is usual across it."""
    held, course = Held(1.0, 0.2, 30.0, drag_mps2=0.3), np.array([0.6, 0.8])
    drawn = usual(course[None], np.array([speed_mps]), held)[0]
    np.testing.assert_allclose(drawn @ course, along_mps2**2 * course, rtol=1e-12)
    np.testing.assert_allclose(drawn @ [-0.8, 0.6], [-0.8, 0.6], rtol=1e-12)


def test_a_move_draws_by_the_speed_of_all_modes_together() -> None:
    """At 200 m/s what is drawn where nothing is held, and what shakes that which is held, are as wide as at that speed."""
    fast = replace(MODES, acceleration=replace(HELD, drag_mps2=0.2))
    mean, weight, elapsed_s = np.zeros((1, 3, WIDE)), np.array([[0.5, 0.25, 0.25]]), np.ones(1)
    mean[0, :, 3] = 100.0, 200.0, 400.0
    _, noise = moved(mean, weight, elapsed_s, fast)
    assert noise[0, 0, 9, 9] == pytest.approx(0.8**2)
    _, before = moved(mean, weight, elapsed_s, MODES)
    assert noise[0, 1, 9, 9] / before[0, 1, 9, 9] == pytest.approx(4.0**2)
    assert noise[0, 1, 10, 10] == before[0, 1, 10, 10]


def test_who_stands_has_no_course() -> None:
    """At no speed noise is alike on both level axes, and nothing is undefined."""
    carry, noise = moved(np.zeros((1, 3, WIDE)), np.full((1, 3), 1.0 / 3.0), np.ones(1), MODES)
    assert np.isfinite(carry).all()
    assert np.isfinite(noise).all()
    assert noise[0, 0, 3, 3] == noise[0, 0, 4, 4]
