"""The alpha-beta-gamma estimator as the gateway uses it: any batch, any interval, anything missing, an honest covariance."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.estimators.alpha_beta_gamma import Estimate, Tuning, covariance, predict, start, update
from gateway.estimators.axis_covariance import settled
from gateway.estimators.completed_plots import completed
from gateway.estimators.source_error import begun
from gateway.estimators.steady_gains import lost_memory
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from sim.cases import case_003
from sim.studies.alpha_beta_gamma_tables import TURNS, consistency, defaults, wandering

Floats = NDArray[np.float64]

TUNINGS = (Tuning(), Tuning(robust=3.0), Tuning(follows_covariance=False), Tuning(q=0.01, follows_covariance=False))


def _tracks(n: int, rng: np.random.Generator, tuning: Tuning) -> Estimate:
    speed = np.where(rng.random((n, 3)) < 0.3, np.nan, 100.0 * rng.standard_normal((n, 3)))
    state = start(1e4 * rng.standard_normal((n, 3)), rng.uniform(1.0, 100.0, (n, 3)), tuning, speed, 2.0)
    return replace(state, error=begun(rng.integers(0, 2, (n, 3)).astype(np.float64), 30.0))


def track_covariance(state: Estimate) -> Floats:
    """Over the positions and then the velocities of independent axes, (n, 2 axes, 2 axes)."""
    single = covariance(state)
    n, axes = single.shape[:2]
    matrix, along = np.zeros((n, 2 * axes, 2 * axes)), np.arange(axes)
    for i in range(2):
        for j in range(2):
            matrix[:, along + axes * i, along + axes * j] = single[:, :, i, j]
    return matrix


def _worked(state: Estimate, steps: list[tuple[Floats, ...]], tuning: Tuning) -> Estimate:
    for elapsed, position, sigma, velocity, share in steps:
        state, _ = update(predict(state, elapsed), position, sigma, tuning, velocity, 0.5, share)
    return state


def _steps(n: int, count: int, rng: np.random.Generator) -> list[tuple[Floats, ...]]:
    steps = []
    for _ in range(count):
        position = 1e4 * rng.standard_normal((n, 3))
        position[rng.random((n, 3)) < 0.3] = np.nan
        velocity = np.where(rng.random((n, 3)) < 0.7, np.nan, 100.0 * rng.standard_normal((n, 3)))
        share = np.where(rng.random((n, 3)) < 0.7, 1.0, rng.random((n, 3)))
        sigma = np.exp(rng.uniform(-3.0, 6.0, (n, 3)))
        steps.append((rng.choice([0.0, 1e-3, 0.4, 5.0, 30.0], n), position, sigma, velocity, share))
    return steps


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), tuning=st.sampled_from(TUNINGS))
def test_a_batch_equals_one_by_one_to_the_bit(seed: int, tuning: Tuning) -> None:
    """Nothing of a track depends on how many come along."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    state, steps = _tracks(n, rng, tuning), _steps(n, 5, rng)
    together = _worked(state, steps, tuning)
    for i in range(n):
        alone = {
            f.name: getattr(state, f.name)[:, i : i + 1]
            if getattr(state, f.name).ndim == 3
            else getattr(state, f.name)[i : i + 1]
            for f in fields(state)
        }
        one = _worked(Estimate(**alone), [tuple(a[i : i + 1] for a in step) for step in steps], tuning)
        for f in fields(state):
            whole = getattr(together, f.name)
            expected = whole[:, i : i + 1] if whole.ndim == 3 else whole[i : i + 1]
            np.testing.assert_array_equal(getattr(one, f.name), expected)


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), tuning=st.sampled_from(TUNINGS[:3]))  # a fixed q is for equal intervals
def test_covariances_stay_symmetric_and_positive(seed: int, tuning: Tuning) -> None:
    """Whatever is missing, however long or short the intervals and good or bad the measurements."""
    rng = np.random.default_rng(seed)
    state = _worked(_tracks(4, rng, tuning), _steps(4, 12, rng), tuning)
    for matrices in (covariance(state), track_covariance(state)):
        assert np.isfinite(matrices).all()
        np.testing.assert_array_equal(matrices, np.swapaxes(matrices, -1, -2))
        scale = np.sqrt(np.diagonal(matrices, axis1=-2, axis2=-1))
        assert (scale > 0.0).all()
        # correlations, since the units differ by many powers of ten; 1e-9 is rounding over a sigma of 1e5 to 0.05
        assert np.linalg.eigvalsh(matrices / scale[..., :, None] / scale[..., None, :]).min() > -1e-9


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), tuning=st.sampled_from(TUNINGS))
def test_what_is_not_measured_changes_nothing(seed: int, tuning: Tuning) -> None:
    """A NaN axis is only predicted, adds nothing to the innovation, and leaves the other axes' bits alone."""
    rng = np.random.default_rng(seed)
    state = predict(_tracks(3, rng, tuning), np.full(3, 0.4))
    position, sigma = state.position + rng.standard_normal((3, 3)), np.full((3, 3), 10.0)
    whole, told = update(state, position, sigma, tuning)
    position[:, 1] = np.nan
    part, less = update(state, position, sigma, tuning)
    for f in fields(state):
        before, after, other = (getattr(one, f.name) for one in (state, part, whole))
        np.testing.assert_array_equal(after[..., 1], before[..., 1])
        np.testing.assert_array_equal(after[..., [0, 2]], other[..., [0, 2]])
    assert not less.measured[:, 1].any()
    np.testing.assert_allclose(less.normalised, told.normalised - (told.innovation**2 / told.variance)[:, 1], rtol=1e-9)
    nothing, silent = update(state, np.full((3, 3), np.nan), sigma, tuning)
    assert (silent.log_likelihood == 0.0).all()
    np.testing.assert_array_equal(nothing.terms, state.terms)


def test_two_short_predictions_equal_one_long_one() -> None:
    """States and covariances carried 0.3 s and 0.7 s are those carried 1 s."""
    rng = np.random.default_rng(1)
    state = _worked(_tracks(5, rng, Tuning()), _steps(5, 6, rng), Tuning())
    twice = predict(predict(state, np.full(5, 0.3)), np.full(5, 0.7))
    once = predict(state, np.ones(5))
    np.testing.assert_allclose(twice.position, once.position, rtol=1e-12)
    np.testing.assert_allclose(twice.velocity, once.velocity, rtol=1e-12)
    np.testing.assert_allclose(covariance(twice), covariance(once), rtol=1e-9)


def test_the_likelihood_is_that_of_a_gaussian() -> None:
    """Summed over the measured components, with the velocities' after the positions'."""
    tuning = Tuning()
    state = predict(start(np.zeros((1, 3)), np.full((1, 3), 5.0), tuning), np.ones(1))
    _, told = update(
        state, np.array([[1.0, np.nan, -3.0]]), np.full((1, 3), 5.0), tuning, np.array([[np.nan, 2.0, 1.0]]), 1.0
    )
    assert told.measured.tolist() == [[True, False, True, False, True, True]]
    y, v = told.innovation[told.measured], told.variance[told.measured]
    density = np.prod(np.exp(-0.5 * y * y / v) / np.sqrt(2.0 * np.pi * v))
    assert float(told.log_likelihood[0]) == pytest.approx(float(np.log(density)), rel=1e-12)
    assert told.covariance.shape == (1, 6, 6)


def test_the_running_covariance_settles_to_the_closed_form() -> None:
    """With nothing adapting and one interval it becomes what steady gains mean."""
    tuning = Tuning(q=0.05, least_p=1.0, greatest_p=1.0)
    state = start(np.zeros((1, 1)), np.full((1, 1), 20.0), tuning)
    for _ in range(400):
        state, _ = update(predict(state, np.full(1, 0.4)), np.zeros((1, 1)), np.full((1, 1), 20.0), tuning)
    gamma = np.full((1, 1), 0.05)
    expected = settled(lost_memory(gamma), gamma, np.full((1, 1), 0.4), np.full((1, 1), 400.0))
    np.testing.assert_allclose(state.terms, expected, rtol=1e-8)


@pytest.mark.parametrize(("density", "sigma_m", "interval_s"), [(0.1, 30.0, 1.0), (10.0, 15.0, 0.4), (1.0, 5.0, 5.0)])
def test_matched_targets_are_as_far_off_as_the_filter_says(density: float, sigma_m: float, interval_s: float) -> None:
    """NEES of position, velocity and acceleration and NIS of targets that move as thought, defaults otherwise."""
    truth, measured = wandering(density, sigma_m, interval_s, 200, 1)
    nees, nis, _ = consistency(truth, measured, sigma_m, interval_s, Tuning(density=density))
    # 200 runs of some 15 independent stretches scatter by 1.5 %; p follows ten residuals and moves NEES by up to 5 % more
    assert nees[20:].mean() / 3.0 == pytest.approx(1.0, abs=0.10)
    assert nis[20:].mean() == pytest.approx(1.0, abs=0.05)


def test_noise_that_is_said_too_small_shows() -> None:
    """With sigma 1.5 times what is said NIS and NEES leave their bands: nothing hides it."""
    truth, measured = wandering(0.1, 30.0, 1.0, 100, 1)
    nees, nis, _ = consistency(truth, measured, 20.0, 1.0, Tuning(density=0.1))
    assert nees[20:].mean() / 3.0 > 1.2
    assert nis[20:].mean() > 1.1


def test_the_density_is_learnt() -> None:
    """A target that wanders much more or less than first thought is known better in the end."""
    for factor in (0.01, 100.0):
        truth, measured = wandering(1.0, 5.0, 5.0, 50, 1)
        sigma = np.full((50, 1), 5.0)
        state = start(measured[0][:, None], sigma, Tuning(density=factor), np.zeros((50, 1)), 1.0)
        for row in measured[1:]:
            state, _ = update(predict(state, np.full(50, 5.0)), row[:, None], sigma, Tuning())
        off = np.abs(np.log(state.density))
        assert np.median(off) < 0.3 * abs(np.log(factor))
    assert truth.shape[0] == 240


def test_one_set_of_defaults_serves_drones_and_jets() -> None:
    """RMS error at most 1.15 times that of the best starting density, from 15 to 130 m/s, sigma 1.5 to 50 m, 0.2 to 5 s."""
    _, figures = defaults(10, 1)
    assert len(figures) == len(TURNS)
    # paired draws: the ratio of 10 runs scatters by less than 0.01; the greatest of 100 runs is 1.11
    assert max(figures.values()) <= 1.15


@pytest.mark.parametrize("every", [1, 5])
def test_measured_velocity_is_used(every: int) -> None:
    """Velocities good to 0.5 m/s, with each position or each fifth, give the error of a Kalman filter that knows the target."""
    truth, measured = wandering(1.0, 30.0, 0.4, 100, 1)
    speed = truth[:, :, 1] + 0.5 * np.random.default_rng(2).standard_normal(measured.shape)
    sigma, gap = np.full((100, 1), 30.0), np.full(100, 0.4)
    state, squares, nees = start(measured[0][:, None], sigma, Tuning(density=1.0), np.zeros((100, 1)), 1.0), [], []
    carry = np.array([[1.0, 0.4, 0.08], [0.0, 1.0, 0.4], [0.0, 0.0, 1.0]])
    best = np.diag([900.0, 1.0, 25.0])
    for k in range(1, len(measured)):
        velocity = speed[k][:, None] if k % every == 0 else None
        state, _ = update(predict(state, gap), measured[k][:, None], sigma, Tuning(), velocity, 0.5)
        off = np.stack([state.position, state.velocity], axis=-1)[:, 0] - truth[k, :, :2]
        nees.append(float((off[:, None] @ np.linalg.inv(track_covariance(state)) @ off[:, :, None]).mean()))
        squares.append(float(np.square(off[:, 0]).mean()))
        best = carry @ (best + np.diag([0.0, 0.0, 0.4])) @ carry.T
        for place, noise in ((0, 900.0), (1, 0.25))[: 1 if velocity is None else 2]:
            best = best - np.outer(best[:, place], best[place]) / (best[place, place] + noise)
    assert np.mean(nees[30:]) / 2.0 == pytest.approx(1.0, abs=0.2)
    # 100 runs scatter by 5 %; p and the density that is learnt cost the rest
    assert np.sqrt(np.mean(squares[-60:])) < 1.25 * np.sqrt(best[0, 0])


def test_an_outlier_pulls_a_bounded_amount() -> None:
    """With `robust`, a measurement 10 km off moves a settled track by at most three of the residual's sigmas, and is told."""
    tuning = Tuning(robust=3.0)
    state = start(np.zeros((1, 3)), np.full((1, 3), 10.0), tuning, np.zeros((1, 3)), 1.0)
    for _ in range(30):
        state, _ = update(predict(state, np.ones(1)), np.zeros((1, 3)), np.full((1, 3), 10.0), tuning)
    position = np.array([[1e4, 0.0, 0.0]])
    after, told = update(predict(state, np.ones(1)), position, np.full((1, 3), 10.0), tuning)
    assert told.outlying.all()
    assert abs(after.position[0, 0]) <= 3.0 * np.sqrt(told.variance[0, 0])
    assert float(after.p[0, 0]) <= 4.0  # one residual of ten, itself at most 30


def test_a_source_of_another_quality_at_the_same_instant_is_used() -> None:
    """After plots of 50 m a position of 2 m at almost the same time puts the track there, whatever the tiny interval."""
    tuning = Tuning()
    state = start(np.zeros((1, 1)), np.full((1, 1), 50.0), tuning, np.zeros((1, 1)), 1.0)
    for _ in range(50):
        state, _ = update(predict(state, np.full(1, 0.4)), np.zeros((1, 1)), np.full((1, 1), 50.0), tuning)
    for gap_s in (0.0, 0.01):
        after, _ = update(predict(state, np.full(1, gap_s)), np.full((1, 1), 30.0), np.full((1, 1), 2.0), tuning)
        assert 25.0 < float(after.position[0, 0]) < 30.0
        assert float(after.terms[0, 0, 0]) < 2.0**2


@pytest.mark.parametrize("missing", [(), ("azimuth",), ("elevation",), ("range",)])
def test_plots_that_always_lack_a_component_are_used_and_the_covariance_stays_honest(missing: tuple[str, ...]) -> None:
    """003's approach by radar and position source: the position's NEES is in its band, and the error that of the sources."""
    runs = 20
    case = case_003(runs, 1, gps_error=False, missing=missing)
    frame = RunwayFrame(case.site.runway)
    antenna = case.site.radars[0]
    radar = RadarFrame.of(antenna, frame)
    noise = np.array([antenna.range_sigma_m, antenna.azimuth_sigma_rad, antenna.elevation_sigma_rad])
    source_sigma = np.full((runs, 3), case.site.position.sigma_m)
    reports = frame.enu_from_geodetic(case.gps.latitude_rad, case.gps.longitude_rad, case.gps.height_m)
    events = [(at, 0, i) for i, at in enumerate(case.plot_s)]
    events += [(at, 1, i) for i, at in enumerate(np.broadcast_to(case.gps.valid_s, case.gps.received_s.shape)[0])]
    tuning, now = Tuning(), 0.0
    state = start(reports[:, 0], source_sigma, tuning)
    squares, nees = [], []
    for at, kind, i in sorted(events):
        state, now = predict(state, np.full(runs, max(at - now, 0.0))), max(at, now)
        if kind == 0:
            polar = np.where(case.plots.seen[:, i, None], case.plots.polar[:, i], np.nan)
            variance = np.diagonal(track_covariance(state), axis1=1, axis2=2)[:, :3]
            position, sigma, share = completed(polar, np.tile(noise, (runs, 1)), state.position, variance, radar)
            state, _ = update(state, position, sigma, tuning, share=share)
        else:
            position = np.where(case.gps.heard[:, i, None], reports[:, i], np.nan)
            state, _ = update(state, position, source_sigma, tuning)
        if kind == 0 and at > 20.0:
            off = state.position - case.true_enu_m[i]
            inverse = np.linalg.inv(track_covariance(state)[:, :3, :3])
            nees.append(float((off[:, None] @ inverse @ off[:, :, None]).mean()))
            squares.append(float(np.square(off).sum(axis=1).mean()))
    # measured over 60 runs: 2.5 to 2.7 of 3 (a p above 1 is as often luck), 16 m with all components, 25 to 26 m without one
    assert 2.2 < np.mean(nees) < 3.3
    assert np.sqrt(np.mean(squares)) < (17.5 if not missing else 29.0)


def test_a_missing_component_neither_moves_nor_reassures_its_axis() -> None:
    """North of a radar that looks north only range is measured: it is the north that moves, east and up stay as unsure."""
    case = case_003(1, 1)
    frame = RunwayFrame(case.site.runway)
    radar = RadarFrame.of(case.site.radars[0], frame)
    state = start(radar.to_enu(np.array([[2e4, 0.0, 500.0]])), np.full((1, 3), 40.0), Tuning(), np.zeros((1, 3)), 1.0)
    ahead = radar.to_enu(np.array([[2.01e4, 0.0, 500.0]])) - state.position
    polar = polar_from_xyz(np.array([[2.01e4, 0.0, 500.0]]))
    polar[:, 1:] = np.nan
    variance = np.diagonal(track_covariance(state), axis1=1, axis2=2)[:, :3]
    position, sigma, share = completed(polar, np.array([[15.0, 1e-3, 1e-3]]), state.position, variance, radar)
    after, told = update(state, position, sigma, Tuning(), share=share)
    moved = after.position - state.position
    along = np.abs(ahead[0]) > 50.0
    assert (np.abs(moved[0, along]) > 0.5 * np.abs(ahead[0, along])).all()
    assert (np.abs(moved[0, ~along]) < 5.0).all()
    assert (after.terms[0, 0, ~along] > 0.98 * state.terms[0, 0, ~along]).all()
    assert (after.terms[0, 0, along] < 0.3 * state.terms[0, 0, along]).all()
    assert told.measured[0, along].all()


def test_no_component_at_all_is_no_measurement() -> None:
    """A plot without range, azimuth and elevation leaves the state as predicted."""
    case = case_003(1, 1)
    radar = RadarFrame.of(case.site.radars[0], RunwayFrame(case.site.runway))
    state = start(np.array([[5e3, 1e3, 500.0]]), np.full((1, 3), 40.0), Tuning())
    nothing = np.full((1, 3), np.nan)
    position, sigma, share = completed(nothing, np.full((1, 3), 1.0), state.position, np.full((1, 3), 1600.0), radar)
    assert np.isnan(position).all()
    after, _ = update(state, position, sigma, Tuning(), share=share)
    np.testing.assert_array_equal(after.terms, state.terms)
    assert replace(after, terms=state.terms).since_s.tolist() == state.since_s.tolist()
