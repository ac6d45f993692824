"""Every way to the same numbers: a slow textbook filter, another library's, one track or many, in order or shuffled."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from gateway.align import Fix
from gateway.estimators.kalman import Motion, start
from gateway.estimators.modes import Mixture, Mode, Modes, begin, combine, predict, update
from gateway.fuse.filtering import Job, run
from gateway.fuse.weighting import Model
from gateway.observation import Observation
from gateway.settings import EstimatorName, Options, PositionSource

Floats = NDArray[np.float64]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm", "alpha-beta-gamma")
ONE, TWO = "mavlink:1", "mavlink:2"
AGREE = 1e-9  # relative, of positions in metres and variances in square metres
ERROR_M, ERROR_TIME_S = 20.0, 900.0
CALM = Motion((0.1, 0.1, 0.05), ERROR_M, ERROR_TIME_S)
HARD = Motion((0.6, 0.6, 0.2), ERROR_M, ERROR_TIME_S)
RATE_RPS = math.radians(3.0)
# With a bank of 0 the turn rate is the same at any speed, as other libraries have it.
THREE = Modes((Mode(0.0, CALM, 2.0), Mode(1.0, HARD), Mode(-1.0, HARD)), "imm", turn_rate_rps=RATE_RPS, bank_rad=0.0)
TWO_MODES = replace(THREE, modes=THREE.modes[:2])
SIGMA_M = 25.0
SUM = np.concatenate([np.eye(3), np.zeros((3, 3)), np.eye(3)], axis=1)  # position and the source's own error
PLACE = np.eye(3, 9)


# the textbook ---------------------------------------------------------------------------------------------------------


def _moves(mode: Mode, t: float) -> tuple[Floats, Floats]:
    """Transition and noise of a mode over a time: the matrix exponential of the equation of motion, by Van Loan."""
    rate, a = mode.turn * RATE_RPS, np.zeros((9, 9))
    a[:3, 3:6] = np.eye(3)
    a[3, 4], a[4, 3] = -rate, rate
    a[6:, 6:] = -np.eye(3) / mode.motion.error_time_constant_s
    error = 2.0 * mode.motion.error_sigma_m**2 / mode.motion.error_time_constant_s
    density = np.diag([0.0] * 3 + list(mode.motion.acceleration_density) + [error] * 3)
    both = expm(np.block([[-a, density], [np.zeros((9, 9)), a.T]]) * t)
    carry = both[9:, 9:].T
    return carry, carry @ both[:9, 9:]


@dataclass
class Textbook:
    """Blom's and Bar-Shalom's filter of one track, model after model, as it stands in books."""

    modes: Modes
    mean: list[Floats]
    covariance: list[Floats]
    weight: list[float]

    def step(self, t: float, measured: Floats, h: Floats) -> None:
        """Mix, move, correct, weigh."""
        m = self.modes.count
        chance = [
            [(1.0 - math.exp(-t / self.modes.lasts_s)) * float(self.modes.shares[j]) for j in range(m)]
            for _ in range(m)
        ]
        for i in range(m):
            chance[i][i] += math.exp(-t / self.modes.lasts_s)
        ahead = [sum(chance[i][j] * self.weight[i] for i in range(m)) for j in range(m)]
        means, covariances, likelihood = [], [], []
        for j, mode in enumerate(self.modes.modes):
            mean, covariance = np.zeros(9), np.zeros((9, 9))
            for i in range(m):
                mean += chance[i][j] * self.weight[i] / ahead[j] * self.mean[i]
            for i in range(m):
                off = self.mean[i] - mean
                covariance += chance[i][j] * self.weight[i] / ahead[j] * (self.covariance[i] + np.outer(off, off))
            carry, noise = _moves(mode, t)
            mean, covariance = carry @ mean, carry @ covariance @ carry.T + noise
            y, s = measured - h @ mean, h @ covariance @ h.T + SIGMA_M**2 * np.eye(len(measured))
            gain = covariance @ h.T @ np.linalg.inv(s)
            left = np.eye(9) - gain @ h
            means.append(mean + gain @ y)
            covariances.append(left @ covariance @ left.T + SIGMA_M**2 * gain @ gain.T)
            likelihood.append(
                math.exp(-0.5 * float(y @ np.linalg.solve(s, y))) / math.sqrt(np.linalg.det(2.0 * math.pi * s))
            )
        total = sum(ahead[j] * likelihood[j] for j in range(m))
        self.mean, self.covariance = means, covariances
        self.weight = [ahead[j] * likelihood[j] / total for j in range(m)]

    def combined(self) -> tuple[Floats, Floats]:
        """Mean and covariance of all models together."""
        parts = list(zip(self.weight, self.mean, self.covariance, strict=True))
        mean = np.sum([w * x for w, x, _ in parts], axis=0)
        return mean, np.sum([w * (p + np.outer(x - mean, x - mean)) for w, x, p in parts], axis=0)


def _started(n: int, modes: Modes) -> Mixture:
    random = np.random.default_rng(2)
    speed, course = random.uniform(20.0, 130.0, n), random.uniform(0.0, 2.0 * math.pi, n)
    velocity = np.stack([speed * np.cos(course), speed * np.sin(course), random.normal(size=n)], axis=1)
    place = random.normal(size=(n, 3)) * 3000.0
    return begin(start(place, np.tile(400.0 * np.eye(3), (n, 1, 1)), velocity, np.full(n, 8.0), ERROR_M), modes)


def _flown(mixture: Mixture, times: Floats) -> Floats:
    """What is measured of aircraft that fly straight on and, after half of the time, to the left: (steps, n, 3)."""
    random, place, velocity = np.random.default_rng(3), mixture.mean[:, 0, :3].copy(), mixture.mean[:, 0, 3:6].copy()
    measured = []
    for step, t in enumerate(times):
        if 2 * step > len(times):
            a = RATE_RPS * t
            velocity[:, :2] = velocity[:, :2] @ np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]])
        place = place + velocity * t
        measured.append(place + random.normal(size=place.shape) * SIGMA_M)
    return np.array(measured)


def _stepped(mixture: Mixture, t: float, measured: Floats, h: Floats, modes: Modes) -> Mixture:
    ahead, m = predict(mixture, np.full(len(measured), t), modes), modes.count
    off = np.repeat(measured, m, axis=0) - (h @ ahead.each().mean[:, :, None])[:, :, 0]
    return update(ahead, off, h[None], np.full(off.shape, SIGMA_M**2), modes)[0]


def test_the_imm_is_the_textbooks() -> None:
    """Ten aircraft that fly straight and turn, reported at irregular times, in three modes with their source's error: to 1e-9."""
    times = np.random.default_rng(1).uniform(0.3, 2.5, 15)
    mixture = _started(10, THREE)
    books = [Textbook(THREE, [*mixture.mean[i]], [*mixture.covariance[i]], [*mixture.weight[i]]) for i in range(10)]
    for t, measured in zip(times.tolist(), _flown(mixture, times), strict=True):
        mixture = _stepped(mixture, t, measured, SUM, THREE)
        state = combine(mixture)
        for i, book in enumerate(books):
            book.step(t, measured[i], SUM)
            mean, covariance = book.combined()
            assert min(book.weight) > 1e-5  # no textbook keeps a least weight
            np.testing.assert_allclose(mixture.weight[i], book.weight, rtol=1e-8)
            np.testing.assert_allclose(mixture.mean[i], book.mean, rtol=AGREE, atol=AGREE)
            np.testing.assert_allclose(mixture.covariance[i], book.covariance, rtol=AGREE, atol=AGREE * 400.0)
            np.testing.assert_allclose(state.mean[i], mean, rtol=AGREE, atol=AGREE)
            np.testing.assert_allclose(state.covariance[i], covariance, rtol=AGREE, atol=AGREE * 400.0)


@pytest.mark.skipif(
    importlib.util.find_spec("filterpy") is None, reason="FilterPy is not installed: pip install .[bench]"
)
def test_the_imm_is_filterpys() -> None:
    """Straight and left, a report each second: states, covariances and probabilities are FilterPy's to 1e-9."""
    from filterpy.kalman import IMMEstimator, KalmanFilter

    mixture = _started(1, TWO_MODES)
    filters = []
    for mode in TWO_MODES.modes:
        one = KalmanFilter(9, 3)
        one.F, one.Q = _moves(mode, 1.0)
        one.H, one.R = PLACE, SIGMA_M**2 * np.eye(3)
        one.x, one.P = mixture.mean[0, 0][:, None].copy(), mixture.covariance[0, 0].copy()
        filters.append(one)
    theirs = IMMEstimator(filters, mixture.weight[0], TWO_MODES.transition(np.ones(1))[0])
    for measured in _flown(mixture, np.ones(30)):
        mixture = _stepped(mixture, 1.0, measured, PLACE, TWO_MODES)
        theirs.predict()
        theirs.update(measured[0][:, None])
        state = combine(mixture)
        np.testing.assert_allclose(mixture.weight[0], theirs.mu, rtol=1e-8)
        np.testing.assert_allclose(state.mean[0], theirs.x[:, 0], rtol=AGREE, atol=AGREE)
        np.testing.assert_allclose(state.covariance[0], theirs.P, rtol=AGREE, atol=AGREE * 400.0)


# one and many, in order and shuffled ----------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_many_tracks_have_the_bits_of_each_alone(world: Any, estimator: EstimatorName) -> None:
    """Seven aircraft worked as one batch, reports and plots mixed and with holes, are each what they are by themselves."""
    model = Model.of(Options(estimator=estimator), PositionSource(), world.radars)
    jobs = []
    for number in range(7):
        course = world.Course(left_m=-3000.0 + 900.0 * number, speed_mps=40.0 + 15.0 * number)
        random = np.random.default_rng(number)
        measures: list[Any] = []
        for k in range(25):
            t_s = 0.4 * k + 0.01 * number
            if k % 3 == 0:
                measures.append(world.fix(course, t_s, serial=k, off_m=tuple(random.normal(size=3) * 15.0)))
            else:
                missing = "".join(np.array(list("rae"))[random.uniform(size=3) < 0.2])
                off = random.normal(0.0, [15.0, 1e-3, 1e-3])
                measures.append(world.plot(course, t_s, serial=k, off=off, missing=missing))
        jobs.append(Job(number, None, measures, lambda fix: None))
    assert isinstance(jobs[0].measures[0], Fix)
    for job, together in zip(jobs, run(jobs, model), strict=True):
        (alone,) = run([job], model)
        for one, other in zip(alone, together, strict=True):
            assert one.mean.tobytes() == other.mean.tobytes()
            assert one.covariance.tobytes() == other.covariance.tobytes()


def _late(observations: list[Observation], seed: int) -> list[Observation]:
    """The same, each heard up to 5 s after it was valid."""
    random = np.random.default_rng(seed)
    return [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in observations]


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_shuffled_within_the_history_is_in_order(
    world: Any, differences: Callable[..., float], estimator: EstimatorName
) -> None:
    """Reports and plots of two aircraft that come up to 5 s late: the last row of each instant is that of in order, to 1e-9."""
    beside = world.Course(left_m=-2500.0, along_m=-22_000.0)
    said = world.flight(seconds=25.0) + world.flight(beside, 25.0, aircraft=TWO, number=4, gps_period_s=0.7, seed=2)
    options = Options(estimator=estimator)
    wanted, found = (
        {
            key: row
            for key, row in world.run(heard, options=options, until_s=33.0).last().items()
            if key[0] in (ONE, TWO)
        }
        for heard in ([replace(one, received_at=one.valid_at) for one in said], _late(said, 1))
    )
    both = {key for key in wanted.keys() & found.keys() if wanted[key]["updated_by"] != "coast"}
    assert len(both) > 100
    assert differences({key: wanted[key] for key in both}, found) < 1e-9
