"""The interacting models against a slow textbook filter written here, and what must hold for any input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.estimators import kalman
from gateway.estimators.kalman import Estimate, Motion, start
from gateway.estimators.modes import LEAST_WEIGHT, Mixture, Mode, Modes, Rule, begin, combine, predict, update
from gateway.estimators.turning import Shaken, carried

Floats = NDArray[np.float64]

CALM, HARD = Motion((0.04, 0.04, 0.04), 35.0, 600.0), Motion((0.5, 0.5, 0.25), 35.0, 600.0)
THREE = (Mode(0.0, CALM), Mode(1.0, HARD), Mode(-1.0, HARD))
RULES: tuple[Rule, ...] = ("imm", "rmimm", "literal")
FIX = np.zeros((1, 3, 9))
FIX[0, np.arange(3), np.arange(3)] = FIX[0, np.arange(3), np.arange(6, 9)] = 1.0


def _states(n: int, seed: int = 1) -> Estimate:
    """n aircraft of 5 to 150 m/s, known to 30 m and 10 m/s, their sources to 35 m."""
    random = np.random.default_rng(seed)
    speed, course = random.uniform(5.0, 150.0, n), random.uniform(0.0, 2.0 * math.pi, n)
    velocity = np.stack([speed * np.cos(course), speed * np.sin(course), random.normal(size=n)], axis=1)
    place = random.normal(size=(n, 3)) * 1000.0
    return start(place, np.tile(900.0 * np.eye(3), (n, 1, 1)), velocity, np.full(n, 10.0), 35.0)


def _step(
    mixture: Mixture, elapsed_s: Floats, place: Floats, variance: Floats, modes: Modes, robust: float | None = 3.0
) -> Mixture:
    """Predicted and updated by a position (n, 3), NaN components left out."""
    ahead = predict(mixture, elapsed_s, modes)
    innovation = np.repeat(place, modes.count, axis=0) - (FIX @ ahead.each().mean[:, :, None])[:, :, 0]
    return update(ahead, innovation, FIX, np.repeat(variance, modes.count, axis=0), modes, robust)[0]


def _textbook_motion(t: float, rate: float, motion: Motion) -> tuple[Floats, Floats]:
    """Transition and noise of a turn by the matrix exponential's power series and by adding up thin slices of noise."""
    a = np.zeros((9, 9))
    a[:3, 3:6] = np.eye(3)
    a[3, 4], a[4, 3] = -rate, rate
    a[6:, 6:] = -np.eye(3) / motion.error_time_constant_s
    density = np.diag([*[0.0] * 3, *motion.acceleration_density, *[2 * 35.0**2 / motion.error_time_constant_s] * 3])

    def grown(s: float) -> Floats:
        whole, term = np.eye(9), np.eye(9)
        for k in range(1, 60):
            term = term @ a * (s / k)
            whole = whole + term
        return whole

    nodes, weights = np.polynomial.legendre.leggauss(40)
    slices = [
        0.5 * t * w * grown(0.5 * t * (x + 1)) @ density @ grown(0.5 * t * (x + 1)).T
        for x, w in zip(nodes, weights, strict=True)
    ]
    return grown(t), np.sum(slices, axis=0)


@pytest.mark.parametrize("rate", [0.0, 1e-6, 0.01, math.radians(3.0), 0.4, -0.4])
@pytest.mark.parametrize("elapsed_s", [0.02, 0.4, 5.0, 20.0])
def test_a_turn_moves_as_its_differential_equation_says(rate: float, elapsed_s: float) -> None:
    """Transition and noise are those of x'' = rate x v + white noise, however long it lasts and however little it turns."""
    carry, noise = carried(Shaken.of([HARD]), np.array([elapsed_s]), np.array([[rate]]))
    wanted, spread = _textbook_motion(elapsed_s, rate, HARD)
    # 1e-9: the series at 8 rad cancels from terms of a few hundred
    np.testing.assert_allclose(carry[0, 0], wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(noise[0, 0], spread, rtol=1e-9, atol=1e-9 * spread.max())


@given(st.floats(0.0, 30.0), st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
def test_two_moves_are_one(elapsed_s: float, share: float, rate: float) -> None:
    """Moving in two steps, wherever the time is cut, is moving in one: transition and noise."""
    rates = np.array([[rate]])
    whole, noise = carried(Shaken.of([HARD]), np.array([elapsed_s]), rates)
    first, before = carried(Shaken.of([HARD]), np.array([elapsed_s * share]), rates)
    last, after = carried(Shaken.of([HARD]), np.array([elapsed_s * (1.0 - share)]), rates)
    np.testing.assert_allclose(last @ first, whole, rtol=1e-9, atol=1e-9)
    carried_noise = last @ before @ last.swapaxes(-1, -2) + after
    np.testing.assert_allclose(carried_noise, noise, rtol=1e-9, atol=1e-9 * max(float(noise.max()), 1.0))


@given(st.floats(0.0, 100.0), st.floats(0.0, 1.0), st.integers(1, 6))
def test_two_transitions_are_one(elapsed_s: float, share: float, count: int) -> None:
    """Modes change at a constant rate: the chances over two short times multiply to those over the whole, and sum to 1."""
    modes = Modes(THREE[:1] * count)
    whole = modes.transition(np.array([elapsed_s]))
    both = modes.transition(np.array([elapsed_s * share])) @ modes.transition(np.array([elapsed_s * (1.0 - share)]))
    np.testing.assert_allclose(both, whole, atol=1e-12)
    np.testing.assert_allclose(whole.sum(axis=2), 1.0, atol=1e-12)
    assert (whole >= 0.0).all()


def test_a_mode_is_left_at_its_rate_and_shares_are_kept() -> None:
    """Of three equal modes drawn anew after 22 s each is left after 33 s; at last the modes have their shares."""
    chance = Modes(THREE, lasts_s=22.0).transition(np.array([1e-4]))
    assert (1.0 - chance[0].diagonal()) / 1e-4 == pytest.approx([1.0 / 33.0] * 3, rel=1e-4)
    uneven = Modes((Mode(0.0, CALM, 3.0), Mode(1.0, HARD, 1.0)))
    assert uneven.transition(np.array([1e4]))[0] == pytest.approx(np.array([[0.75, 0.25]] * 2))
    assert uneven.shares @ uneven.transition(np.array([7.0]))[0] == pytest.approx([0.75, 0.25])


def test_slow_aircraft_turn_faster() -> None:
    """3 degrees/s for an airliner, a 30 degree bank's rate for a drone of 15 m/s; the sign is the mode's."""
    rate = np.degrees(Modes(THREE).turn_rate(np.array([130.0, 15.0, 0.0])))
    assert rate[0] == pytest.approx([0.0, 3.0, -3.0])
    assert rate[1] == pytest.approx([0.0, 21.63, -21.63], abs=0.01)
    assert np.isfinite(rate[2]).all()


@pytest.mark.parametrize("rule", RULES)
def test_one_mode_is_the_kalman_filter(rule: Rule) -> None:
    """A set of one straight mode gives what `kalman` gives, outliers and holes included."""
    modes, random = Modes(THREE[:1], rule), np.random.default_rng(3)
    state = _states(4)
    mixture = begin(state, modes)
    for _ in range(10):
        elapsed_s = random.uniform(0.0, 6.0, 4)
        place = state.mean[:, :3] + random.normal(size=(4, 3)) * 200.0
        place[0, 2] = math.nan
        mixture = _step(mixture, elapsed_s, place, np.full((4, 3), 400.0), modes)
        state = kalman.predict(state, elapsed_s, CALM)
        state, _ = kalman.update(
            state, place - (FIX @ state.mean[:, :, None])[:, :, 0], FIX, np.full((4, 3), 400.0), 3.0
        )
        found = combine(mixture)
        # 1e-11: the same sums in another order
        np.testing.assert_allclose(found.mean, state.mean, rtol=1e-11, atol=1e-8)
        np.testing.assert_allclose(found.covariance, state.covariance, rtol=1e-10, atol=1e-7)
    assert (mixture.weight == 1.0).all()


def _textbook_imm(mixture: Mixture, t: float, place: Floats, r: float, modes: Modes) -> tuple[Floats, Floats, Floats]:
    """One track, one mode after the other, with loops and by the formulas 5 to 10."""
    mu, chance = mixture.weight[0], modes.transition(np.array([t]))[0]
    m = modes.count
    c = [sum(chance[i, j] * mu[i] for i in range(m)) for j in range(m)]
    mixed = []
    for j in range(m):
        share = [chance[i, j] * mu[i] / c[j] for i in range(m)]
        mean = sum(share[i] * mixture.mean[0, i] for i in range(m))
        off = [mixture.mean[0, i] - mean for i in range(m)]
        mixed.append((mean, sum(share[i] * (mixture.covariance[0, i] + np.outer(off[i], off[i])) for i in range(m))))
    level = sum(c[j] * mixed[j][0][3:5] for j in range(m))
    rates = modes.turn_rate(np.array([np.hypot(*level)]))[0]
    means, covariances, likelihood = [], [], []
    for j, (mean, covariance) in enumerate(mixed):
        f, q = _textbook_motion(t, rates[j], modes.modes[j].motion)
        ahead, p = f @ mean, f @ covariance @ f.T + q
        y, s = place - FIX[0] @ ahead, FIX[0] @ p @ FIX[0].T + r * np.eye(3)
        k = p @ FIX[0].T @ np.linalg.inv(s)
        means.append(ahead + k @ y)
        covariances.append(p - k @ s @ k.T)
        likelihood.append(math.exp(-0.5 * y @ np.linalg.solve(s, y)) / math.sqrt(np.linalg.det(2.0 * math.pi * s)))
    weight = np.array(c) * np.array(likelihood)
    return np.array(means), np.array(covariances), weight / weight.sum()


def test_the_imm_is_the_textbooks() -> None:
    """Twenty updates of an aircraft that flies straight and turns, at irregular times, agree with loops to 1e-9."""
    modes, random = Modes(THREE, "imm"), np.random.default_rng(7)
    mixture = begin(_states(1), modes)
    place, velocity = mixture.mean[0, 0, :3].copy(), mixture.mean[0, 0, 3:6].copy()
    for step in range(20):
        t = float(random.uniform(0.1, 3.0))
        turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) * math.radians(3.0) * (step > 8)
        velocity = velocity + turned @ velocity * t
        place = place + velocity * t
        measured = place + random.normal(size=3) * 20.0
        means, covariances, weight = _textbook_imm(mixture, t, measured, 400.0, modes)
        mixture = _step(mixture, np.array([t]), measured[None], np.full((1, 3), 400.0), modes, None)
        np.testing.assert_allclose(mixture.mean[0], means, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(mixture.covariance[0], covariances, rtol=1e-9, atol=1e-7)
        # no textbook keeps a least weight; above it both agree
        np.testing.assert_allclose(mixture.weight[0], weight, rtol=1e-7, atol=2.0 * LEAST_WEIGHT)
        assert mixture.weight[0].min() < 0.5


@pytest.mark.parametrize("rule", RULES)
def test_one_track_has_the_bits_that_it_has_among_many(rule: Rule) -> None:
    """A batch gives each track the very bits that it has alone, with holes, outliers and different steps among them."""
    n, modes, random = 23, Modes(THREE, rule), np.random.default_rng(5)
    together = begin(_states(n), modes)
    alone = [begin(Estimate(together.mean[i : i + 1, 0], together.covariance[i : i + 1, 0]), modes) for i in range(n)]
    for _ in range(6):
        elapsed_s = random.uniform(0.0, 6.0, n)
        place = combine(predict(together, elapsed_s, modes)).mean[:, :3] + random.normal(size=(n, 3)) * 30.0
        place[random.uniform(size=place.shape) < 0.2] = math.nan
        place[4:7] += 1000.0
        variance = random.uniform(100.0, 900.0, (n, 3))
        together = _step(together, elapsed_s, place, variance, modes)
        state = combine(together)
        for i in range(n):
            one = slice(i, i + 1)
            alone[i] = _step(alone[i], elapsed_s[one], place[one], variance[one], modes)
            assert alone[i].weight[0].tobytes() == together.weight[i].tobytes()
            assert alone[i].mean[0].tobytes() == together.mean[i].tobytes()
            assert alone[i].covariance[0].tobytes() == together.covariance[i].tobytes()
            assert alone[i].score[0].tobytes() == together.score[i].tobytes()
            assert combine(alone[i]).covariance[0].tobytes() == state.covariance[i].tobytes()


@settings(max_examples=100)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 30.0), st.floats(-1e5, 1e5) | st.just(math.nan), st.floats(1e-2, 1e4)),
        min_size=1,
        max_size=15,
    ),
    st.sampled_from(RULES),
    st.sampled_from([None, 3.0]),
)
def test_weights_sum_to_1_and_covariances_stay_positive(
    steps: list[tuple[float, float, float]], rule: Rule, robust: float | None
) -> None:
    """After any steps and measurements no mode is impossible, the weights are a distribution, no variance is negative."""
    modes = Modes(THREE, rule)
    mixture = begin(_states(1), modes)
    for elapsed_s, off, sigma in steps:
        place = mixture.mean[:, 0, :3] + [[off, 0.5 * off, 0.0]]
        mixture = _step(mixture, np.array([elapsed_s]), place, np.full((1, 3), sigma * sigma), modes, robust)
        assert mixture.weight.sum() == pytest.approx(1.0, abs=1e-12)
        assert mixture.weight.min() >= 0.99 * LEAST_WEIGHT
        state = combine(mixture)
        for covariance in (*mixture.covariance[0], state.covariance[0]):
            assert np.array_equal(covariance, covariance.T)
            size = np.sqrt(covariance.diagonal())
            assert (size > 0.0).all()
            # relative to each component's own sigma: roundings of 1e-16 through sums of nine
            assert np.linalg.eigvalsh(covariance / np.outer(size, size)).min() > -1e-9


@pytest.mark.parametrize("rule", ["imm", "rmimm"])
def test_an_outlier_does_not_switch_modes(rule: Rule) -> None:
    """One position 2 km to the left of a straight flight leaves straight the likeliest; without the bound it would not."""
    modes = Modes(THREE, rule)
    mixture = begin(
        start(np.zeros((1, 3)), 100.0 * np.eye(3)[None], np.array([[100.0, 0.0, 0.0]]), np.ones(1), 0.0), modes
    )
    for step in range(1, 40):
        place = np.array([[100.0 * step, 0.0, 0.0]])
        mixture = _step(mixture, np.ones(1), place, np.full((1, 3), 225.0), modes)
    aside = np.array([[4000.0, 2000.0, 0.0]])
    bounded = _step(mixture, np.ones(1), aside, np.full((1, 3), 225.0), modes)
    unbounded = _step(mixture, np.ones(1), aside, np.full((1, 3), 225.0), modes, None)
    assert mixture.weight[0, 0] > 0.9
    assert bounded.weight[0].argmax() == 0
    assert unbounded.weight[0].argmax() == 1


def test_the_mean_counts_by_time_however_often_it_is_measured() -> None:
    """Ten measurements at one instant let the residuals' mean count once, as a single one does; the likelihood counts each."""
    modes, random = Modes(THREE), np.random.default_rng(4)
    plain = Modes(THREE, "imm")
    whole = predict(begin(_states(1), modes), np.ones(1), modes)
    by_likelihood = whole
    for _ in range(10):
        place = whole.mean[:, 0, :3] + random.normal(size=(1, 3)) * 20.0
        again = np.zeros(1)
        whole = _step(whole, again, place, np.full((1, 3), 400.0), modes)
        by_likelihood = _step(by_likelihood, again, place, np.full((1, 3), 400.0), plain)
        assert whole.elapsed_s == 0.0
    ratio = whole.weight[0] / by_likelihood.weight[0]
    # one factor between 1 and (1 + chi-square of the first one)^(-1/2), not its tenth power
    assert ratio.max() / ratio.min() < 2.0


def test_a_mirrored_flight_swaps_left_and_right() -> None:
    """North mirrored to south, a turn to the left is one to the right: weights change places, means are mirrored."""
    modes, random = Modes(THREE), np.random.default_rng(11)
    mirror = np.array([1.0, -1.0, 1.0] * 3)
    state = _states(1)
    one = begin(state, modes)
    other = begin(Estimate(state.mean * mirror, state.covariance * np.outer(mirror, mirror)), modes)
    for _ in range(20):
        place = (
            combine(predict(one, np.ones(1), modes)).mean[:, :3]
            + random.normal(size=(1, 3)) * 50.0
            + [[0.0, 20.0, 0.0]]
        )
        one = _step(one, np.ones(1), place, np.full((1, 3), 400.0), modes)
        other = _step(other, np.ones(1), place * mirror[:3], np.full((1, 3), 400.0), modes)
    np.testing.assert_allclose(other.weight[0, [0, 2, 1]], one.weight[0], rtol=1e-9)
    np.testing.assert_allclose(other.mean[0, [0, 2, 1]] * mirror, one.mean[0], rtol=1e-9, atol=1e-7)


def test_the_whole_tells_its_innovation_covariance_and_likelihood() -> None:
    """The density is the modes' weighted sum; innovation and covariance are matched to it; a single mode tells its own."""
    modes = Modes(THREE)
    ahead = predict(begin(_states(5), modes), np.full(5, 4.0), modes)
    innovation = np.random.default_rng(2).normal(size=(15, 3)) * 30.0
    _, told = update(ahead, innovation, FIX, np.full((15, 3), 400.0), modes)
    y = innovation.reshape(5, 3, 3)
    density = np.exp(told.each.log_likelihood.reshape(5, 3))
    assert np.exp(told.log_likelihood) == pytest.approx((ahead.weight * density).sum(axis=1), rel=1e-9)
    mean = sum(ahead.weight[:, j, None] * y[:, j] for j in range(3))
    assert told.innovation == pytest.approx(mean, rel=1e-12)
    second = sum(
        ahead.weight[:, j, None, None]
        * (told.each.covariance.reshape(5, 3, 3, 3)[:, j] + y[:, j, :, None] * y[:, j, None, :])
        for j in range(3)
    )
    assert told.covariance == pytest.approx(second - mean[:, :, None] * mean[:, None, :], rel=1e-9, abs=1e-9)
    wanted = [float(mean[i] @ np.linalg.solve(told.covariance[i], mean[i])) for i in range(5)]
    assert told.normalised == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("rule", RULES)
def test_nothing_measured_tells_nothing(rule: Rule) -> None:
    """A measurement of which nothing was measured leaves states alone, and what tells modes apart fades alike in all."""
    modes = Modes(THREE, rule)
    ahead = predict(begin(_states(2), modes), np.ones(2), modes)
    after, _ = update(ahead, np.full((6, 3), math.nan), FIX, np.full((6, 3), 400.0), modes, 3.0)
    assert after.mean.tobytes() == ahead.mean.tobytes()
    assert after.weight == pytest.approx(ahead.weight, rel=1e-12)
