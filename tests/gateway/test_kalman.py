"""The filter against a textbook one written here, and what must hold for any input."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.estimators.kalman import Estimate, Motion, predict, start, update

Floats = NDArray[np.float64]

MOTION = Motion((1.6, 1.2, 0.4), 35.0, 600.0)


def _states(n: int, seed: int = 1) -> Estimate:
    """n states with full covariances of the sizes that tracks have: 30 m, 5 m/s, 20 m."""
    random = np.random.default_rng(seed)
    scale = np.repeat([30.0, 5.0, 20.0], 3)
    root = random.normal(size=(n, 9, 9)) * scale[:, None] / 3.0
    covariance = root @ root.transpose(0, 2, 1)
    return Estimate(random.normal(size=(n, 9)) * 100.0, 0.5 * (covariance + covariance.transpose(0, 2, 1)))


def _measurements(n: int, m: int, seed: int = 2) -> tuple[Floats, Floats, Floats]:
    """Innovations (n, m), sensitivities (n, m, 9) and variances (n, m) within the noise."""
    random = np.random.default_rng(seed)
    return random.normal(size=(n, m)) * 20.0, random.normal(size=(n, m, 9)), random.uniform(50.0, 500.0, (n, m))


def _textbook_predict(mean: Floats, covariance: Floats, t: float, motion: Motion) -> tuple[Floats, Floats]:
    """One axis at a time: x' = v, v' = white noise of density q, e' = -e / T + noise that keeps e's variance."""
    f, q = np.zeros((9, 9)), np.zeros((9, 9))
    stay = math.exp(-t / motion.error_time_constant_s)
    for axis, density in enumerate(motion.acceleration_density):
        x, v, e = axis, axis + 3, axis + 6
        f[x, x] = f[v, v] = 1.0
        f[x, v], f[e, e] = t, stay
        q[x, x], q[x, v], q[v, x], q[v, v] = density * np.array([t**3 / 3, t**2 / 2, t**2 / 2, t])
        q[e, e] = motion.error_sigma_m**2 * (1.0 - stay**2)
    return f @ mean, f @ covariance @ f.T + q


def test_predict_is_the_textbooks() -> None:
    """Mean and covariance after a step are F x and F P F' + Q of a nearly constant velocity and a Gauss-Markov error."""
    states, elapsed_s = _states(4), np.array([0.0, 0.4, 5.0, 60.0])
    after = predict(states, elapsed_s, MOTION)
    for i, t in enumerate(elapsed_s):
        mean, covariance = _textbook_predict(states.mean[i], states.covariance[i], t, MOTION)
        # 1e-12 of the largest: the products are summed in another order
        assert after.mean[i] == pytest.approx(mean, rel=1e-12, abs=1e-10)
        assert after.covariance[i] == pytest.approx(covariance, rel=1e-12, abs=1e-9)


def test_update_is_the_textbooks() -> None:
    """Mean and covariance after a measurement are x + K y and (I - K H) P, with K = P H' (H P H' + R)^-1."""
    states, (y, h, variance) = _states(5), _measurements(5, 3)
    after, told = update(states, y, h, variance)
    for i in range(5):
        p, r = states.covariance[i], np.diag(variance[i])
        s = h[i] @ p @ h[i].T + r
        k = np.linalg.solve(s, h[i] @ p).T
        # 1e-9 of the largest: S is inverted here by another method, and its condition is a few hundred
        assert after.mean[i] == pytest.approx(states.mean[i] + k @ y[i], rel=1e-9, abs=1e-9)
        assert after.covariance[i] == pytest.approx((np.eye(9) - k @ h[i]) @ p, rel=1e-9, abs=1e-7)
        assert told.covariance[i] == pytest.approx(s, rel=1e-12)
        assert told.normalised[i] == pytest.approx(y[i] @ np.linalg.solve(s, y[i]), rel=1e-9)
        density = math.exp(-0.5 * y[i] @ np.linalg.solve(s, y[i])) / math.sqrt(np.linalg.det(2.0 * math.pi * s))
        assert told.log_likelihood[i] == pytest.approx(math.log(density), rel=1e-9)


@given(st.floats(0.01, 30.0), st.floats(0.05, 0.95))
def test_two_steps_are_one(elapsed_s: float, share: float) -> None:
    """Predicting in two steps, wherever it is cut, is predicting in one."""
    states = _states(2)
    whole = predict(states, np.full(2, elapsed_s), MOTION)
    first = predict(states, np.full(2, elapsed_s * share), MOTION)
    both = predict(first, np.full(2, elapsed_s * (1.0 - share)), MOTION)
    # relative to entries of up to 1e5 m2: a dozen roundings
    assert both.mean == pytest.approx(whole.mean, rel=1e-12, abs=1e-10)
    assert both.covariance == pytest.approx(whole.covariance, rel=1e-11, abs=1e-8)


def test_no_time_changes_nothing() -> None:
    """A step of no time leaves every bit of the mean, and the covariance, alone."""
    states = _states(3)
    after = predict(states, np.zeros(3), MOTION)
    assert after.mean.tobytes() == states.mean.tobytes()
    assert after.covariance == pytest.approx(states.covariance, rel=1e-15)


def test_the_source_error_settles_at_its_allowed_size() -> None:
    """However long nothing is heard, the source error's sigma ends at the allowed one, from above and from below."""
    for sigma in (0.0, 200.0):
        state = start(np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3)), np.ones(1), sigma)
        after = predict(state, np.array([20.0 * MOTION.error_time_constant_s]), MOTION)
        assert np.sqrt(after.covariance[0, 6:, 6:].diagonal()) == pytest.approx([35.0] * 3, rel=1e-9)  # e^-40 remains


def test_no_allowed_error_is_the_plain_filter() -> None:
    """With no error allowed the error stays exactly zero, whatever is measured."""
    state = start(np.zeros((1, 3)), 100.0 * np.eye(3)[None], np.zeros((1, 3)), np.full(1, 10.0), 0.0)
    plain = Motion((1.0, 1.0, 1.0), 0.0)
    for _ in range(20):
        state = predict(state, np.array([0.4]), plain)
        y, h, variance = _measurements(1, 3)
        state, _ = update(state, y, h, variance)
    assert not state.mean[:, 6:].any()
    assert not state.covariance[:, 6:, :].any()
    assert not state.covariance[:, :, 6:].any()


@pytest.mark.parametrize("absent", [[0], [1], [2], [0, 2], [1, 2]])
def test_a_component_not_measured_is_as_if_it_were_not_there(absent: list[int]) -> None:
    """NaN components change nothing: the rest gives what it gives in a measurement of fewer rows."""
    states, (y, h, variance) = _states(4), _measurements(4, 3)
    there = [row for row in range(3) if row not in absent]
    holed = y.copy()
    holed[:, absent] = np.nan
    h_wild, variance_wild = h.copy(), variance.copy()
    h_wild[:, absent], variance_wild[:, absent] = 1e6, np.nan  # what stands where nothing was measured must not matter
    found, told = update(states, holed, h_wild, variance_wild, 3.0)
    wanted, fewer = update(states, y[:, there], h[:, there], variance[:, there], 3.0)
    # 1e-12: a matrix of another size is inverted in another order; nothing else differs
    assert found.mean == pytest.approx(wanted.mean, rel=1e-12, abs=1e-11)
    assert found.covariance == pytest.approx(wanted.covariance, rel=1e-11, abs=1e-9)
    assert told.normalised == pytest.approx(fewer.normalised, rel=1e-11)
    assert told.log_likelihood == pytest.approx(fewer.log_likelihood, rel=1e-11)
    assert told.measured.sum(axis=1).tolist() == [len(there)] * 4


def test_nothing_measured_changes_no_bit_of_the_mean() -> None:
    """A measurement of which nothing was measured leaves the state alone."""
    states, (y, h, variance) = _states(2), _measurements(2, 3)
    after, told = update(states, np.full_like(y, np.nan), h, variance, 3.0)
    assert after.mean.tobytes() == states.mean.tobytes()
    assert after.covariance.tobytes() == states.covariance.tobytes()
    assert not told.outlying.any()
    assert not told.normalised.any()


def test_one_track_has_the_bits_that_it_has_among_many() -> None:
    """A batch of tracks gives each the very bits that it has alone, with holes, outliers and different steps among them."""
    n = 37
    states, (y, h, variance) = _states(n), _measurements(n, 3)
    y[np.random.default_rng(4).uniform(size=y.shape) < 0.2] = np.nan
    y[5:9] *= 100.0
    elapsed_s = np.random.default_rng(5).uniform(0.0, 6.0, n)
    ahead = predict(states, elapsed_s, MOTION)
    after, told = update(ahead, y, h, variance, 3.0)
    assert told.outlying.any()
    assert not told.outlying.all()
    for i in range(n):
        one = slice(i, i + 1)
        alone = predict(Estimate(states.mean[one], states.covariance[one]), elapsed_s[one], MOTION)
        assert alone.mean[0].tobytes() == ahead.mean[i].tobytes()
        assert alone.covariance[0].tobytes() == ahead.covariance[i].tobytes()
        worked, said = update(alone, y[one], h[one], variance[one], 3.0)
        assert worked.mean[0].tobytes() == after.mean[i].tobytes()
        assert worked.covariance[0].tobytes() == after.covariance[i].tobytes()
        assert said.normalised[0] == told.normalised[i]


def test_a_sure_measurement_leaves_its_own_variance() -> None:
    """A millimetre measured after 10 km leaves the millimetre's variance to nine digits, alone or among others."""
    h, variance = np.eye(1, 9)[None], np.array([[1e-6], [1e4]])
    states = start(np.zeros((2, 3)), np.tile(1e8 * np.eye(3), (2, 1, 1)), np.zeros((2, 3)), np.full(2, 100.0), 0.0)
    after, _ = update(states, np.ones((2, 1)), h, variance)
    assert after.covariance[:, 0, 0] == pytest.approx(1.0 / (1e-8 + 1.0 / variance[:, 0]), rel=1e-9)
    for i in range(2):
        one = slice(i, i + 1)
        alone, _ = update(Estimate(states.mean[one], states.covariance[one]), np.ones((1, 1)), h, variance[one])
        assert alone.covariance[0].tobytes() == after.covariance[i].tobytes()


def test_an_outlier_pulls_no_more_than_the_limit_allows() -> None:
    """Far outside the robust limit the pull no longer grows as the innovation does, and never beyond the limit's."""
    states = _states(1)
    h, variance = np.zeros((1, 1, 9)), np.array([[100.0]])
    h[0, 0, 0] = 1.0
    spread = math.sqrt(float(states.covariance[0, 0, 0]) + 100.0)

    def pull(sigmas: float, robust: float | None) -> float:
        after, _ = update(states, np.array([[sigmas * spread]]), h, variance, robust)
        return float((after.mean - states.mean)[0, 0])

    at_limit = pull(3.0, None)
    assert pull(2.9, 3.0) == pull(2.9, None)  # inside nothing is bounded
    assert pull(30.0, None) == pytest.approx(10.0 * at_limit)
    for sigmas in (4.0, 10.0, 100.0, 1e4):
        assert 0.0 < pull(sigmas, 3.0) <= at_limit * (1.0 + 1e-12)
    # the noise is raised until the measurement stands just at the limit
    _, told = update(states, np.array([[30.0 * spread]]), h, variance, 3.0)
    assert told.outlying.tolist() == [True]
    assert float(told.covariance[0, 0, 0]) == pytest.approx((30.0 * spread / 3.0) ** 2, rel=1e-12)


def test_a_source_that_really_jumped_is_followed() -> None:
    """Bounded is not refused: measured 1 km away again and again, the track gets there."""
    state = start(np.zeros((1, 3)), 100.0 * np.eye(3)[None], np.zeros((1, 3)), np.full(1, 5.0), 0.0)
    h = np.zeros((1, 3, 9))
    h[0, np.arange(3), np.arange(3)] = 1.0
    for _ in range(100):
        state = predict(state, np.array([1.0]), Motion((1.6, 1.6, 0.4), 0.0))
        state, _ = update(state, [1000.0, 0.0, 0.0] - state.mean[:, :3], h, np.full((1, 3), 225.0), 3.0)
    # 30 m: two sigmas of one measurement
    assert state.mean[0, :3] == pytest.approx([1000.0, 0.0, 0.0], abs=30.0)


@settings(max_examples=150)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 30.0), st.floats(-1e5, 1e5) | st.just(math.nan), st.floats(1e-4, 1e4)),
        min_size=1,
        max_size=20,
    ),
    st.sampled_from([None, 3.0]),
    st.integers(0, 1000),
)
def test_covariance_stays_symmetric_and_positive(
    steps: list[tuple[float, float, float]], robust: float | None, seed: int
) -> None:
    """After any sequence of steps and measurements, from millimetres to tens of km off, no variance is negative."""
    random = np.random.default_rng(seed)
    state = start(np.zeros((1, 3)), 1e4 * np.eye(3)[None], np.zeros((1, 3)), np.full(1, 100.0), 35.0)
    for elapsed_s, innovation, sigma in steps:
        state = predict(state, np.array([elapsed_s]), MOTION)
        h = random.normal(size=(1, 3, 9))
        h[:, :, 3:6] = 0.0
        y = random.normal(size=(1, 3)) + innovation
        state, _ = update(state, y, h, np.full((1, 3), sigma * sigma), robust)
        covariance = state.covariance[0]
        assert np.array_equal(covariance, covariance.T)
        assert np.isfinite(state.mean).all()
        # seen relative to each component's own sigma: roundings of 1e-16 through sums of nine
        size = np.sqrt(covariance.diagonal())
        assert (size > 0.0).all()
        assert np.linalg.eigvalsh(covariance / np.outer(size, size)).min() > -1e-9
