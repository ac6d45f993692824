"""Who runs the IMM of `bench.estimation`: ourselves, a loop as textbooks write it, and four libraries' filters.

Each side is a function of a problem that gives another one: what runs all tracks of the problem through all its reports and
returns the combined states after the last one, mean (n, d) and covariance (n, d, d). What it makes for each track before the
first report is not measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.batch import tracks
from gateway.estimators.holding import Held
from gateway.estimators.kalman import Estimate, Motion
from gateway.estimators.modes import Modes, begin, combine, predict, update
from gateway.fuse.flying import modes_of
from gateway.settings import Estimation, Options

Floats = NDArray[np.float64]
States = tuple[Floats, Floats]
Run = Callable[[], States]

ERROR_M = 20.0  # of the position source, on each axis
ALIKE_MPS2 = 0.5  # the acceleration that lasts, on each axis


@dataclass(frozen=True)
class Problem:
    """n tracks of d states in m linear models, of which the first k are measured each second."""

    carry: Floats  # (m, d, d)
    noise: Floats  # (m, d, d)
    chance: Floats  # (m, m) of model j after model i
    share: Floats  # (m,) at first
    variance: float  # of each measured component
    mean: Floats  # (n, d) at first
    covariance: Floats  # (d, d) at first
    measured: Floats  # (steps, n, k)

    @property
    def track_steps(self) -> int:
        """Reports in all."""
        return self.measured.shape[0] * self.measured.shape[1]

    @property
    def sensitivity(self) -> Floats:
        """(k, d): position and the source's error together."""
        return np.concatenate([np.eye(3), np.zeros((3, 3)), np.eye(3), np.zeros((3, self.mean.shape[1] - 9))], axis=1)


def gateway_modes() -> Modes:
    """The gateway's default modes with matrices that are the same for all tracks: one turn rate, noise alike along and across."""
    modes = modes_of(Options(estimator="imm"), Motion((1.0,) * 3, ERROR_M), Estimation())
    assert modes is not None
    alike = tuple(replace(mode, along=1.0) for mode in modes.modes)
    held = Held(ALIKE_MPS2, ALIKE_MPS2, Estimation().lasting_for_s)
    return replace(modes, modes=alike, bank_rad=0.0, acceleration=held)


def ours(problem: Problem) -> Run:
    """The gateway's own filter, all tracks in one batch."""
    modes, n = gateway_modes(), len(problem.mean)
    first = begin(Estimate(problem.mean[:, :9], np.repeat(problem.covariance[None, :9, :9], n, axis=0)), modes)
    seen = problem.sensitivity
    reports = np.repeat(problem.measured, modes.count, axis=1)
    variance, second = np.full(reports.shape[1:], problem.variance), np.ones(n)

    def run() -> States:
        mixture = first
        for report in reports:
            mixture = predict(mixture, second, modes)
            off = report - (seen @ mixture.each().mean[:, :, None])[:, :, 0]
            mixture, _ = update(mixture, off, seen[None], variance, modes)
            state = combine(mixture)
        return state.mean, state.covariance

    return run


def compiled(problem: Problem) -> Run:
    """The same filter compiled, as studies of many draws have it."""
    modes, n = gateway_modes(), len(problem.mean)
    spread = np.repeat(problem.covariance[None, :9, :9], n, axis=0)
    first = tracks.begin(Estimate(problem.mean[:, :9], spread), modes)
    seen = problem.sensitivity[:, :9]
    reports = np.repeat(problem.measured, modes.count, axis=1)
    variance, second = np.full(reports.shape[1:], problem.variance), np.ones(n)

    def run() -> States:
        batch = first
        for report in reports:
            batch = batch.predict(second)
            off = report - batch.means[:, :9] @ seen.T
            batch, _, _ = batch.update(off, seen[None], variance)
            state = batch.combine()
        return state.mean, state.covariance

    return run


def textbook(problem: Problem) -> Run:
    """One track after the other, one model after the other, with NumPy's matrices."""
    h, r = problem.sensitivity, problem.variance * np.eye(problem.measured.shape[2])
    models = range(len(problem.share))
    f, q, chance, identity = problem.carry, problem.noise, problem.chance, np.eye(problem.mean.shape[1])

    def step(x: list[Floats], p: list[Floats], mu: Floats, z: Floats) -> tuple[list[Floats], list[Floats], Floats]:
        ahead = mu @ chance
        after_x, after_p, likelihood = [], [], np.zeros(len(mu))
        for j in models:
            share = chance[:, j] * mu / ahead[j]
            mixed = sum(share[i] * x[i] for i in models)
            spread = sum(share[i] * (p[i] + np.outer(x[i] - mixed, x[i] - mixed)) for i in models)
            mean, covariance = f[j] @ mixed, f[j] @ spread @ f[j].T + q[j]
            y, s = z - h @ mean, h @ covariance @ h.T + r
            inverse = np.linalg.inv(s)
            gain = covariance @ h.T @ inverse
            left = identity - gain @ h
            after_x.append(mean + gain @ y)
            after_p.append(left @ covariance @ left.T + gain @ r @ gain.T)
            likelihood[j] = math.exp(-0.5 * (y @ inverse @ y)) / math.sqrt(np.linalg.det(2.0 * math.pi * s))
        weight = ahead * likelihood
        return after_x, after_p, weight / weight.sum()

    def one(track: int) -> States:
        x, p, mu = [problem.mean[track]] * len(models), [problem.covariance] * len(models), problem.share
        for z in problem.measured[:, track]:
            x, p, mu = step(x, p, mu, z)
            mean = sum(mu[i] * x[i] for i in models)
            covariance = sum(mu[i] * (p[i] + np.outer(x[i] - mean, x[i] - mean)) for i in models)
        return mean, covariance

    return lambda: _gathered([one(track) for track in range(len(problem.mean))])


def filterpy(problem: Problem) -> Run:
    """FilterPy's IMMEstimator."""
    from filterpy.kalman import IMMEstimator, KalmanFilter

    def made(track: int) -> Any:
        filters = []
        for carry, noise in zip(problem.carry, problem.noise, strict=True):
            one = KalmanFilter(*problem.sensitivity.shape[::-1])
            one.F, one.Q, one.H = carry, noise, problem.sensitivity
            one.R = problem.variance * np.eye(problem.measured.shape[2])
            one.x, one.P = problem.mean[track][:, None].copy(), problem.covariance.copy()
            filters.append(one)
        return IMMEstimator(filters, problem.share, problem.chance)

    def one(track: int, imm: Any) -> States:
        for z in problem.measured[:, track, :, None]:
            imm.predict()
            imm.update(z)
        return imm.x[:, 0], imm.P

    return _each(problem, made, one)


def nrl_tracker(problem: Problem) -> Run:
    """nrl-tracker's imm_predict and imm_update."""
    from pytcl.dynamic_estimation.imm import imm_predict, imm_update

    models = range(len(problem.share))
    h, r = [problem.sensitivity] * len(models), [problem.variance * np.eye(problem.measured.shape[2])] * len(models)
    f, q = list(problem.carry), list(problem.noise)

    def one(track: int, _: Any) -> States:
        x, p, mu = [problem.mean[track]] * len(models), [problem.covariance] * len(models), problem.share
        for z in problem.measured[:, track]:
            ahead = imm_predict(x, p, mu, problem.chance, f, q)
            after = imm_update(ahead.mode_states, ahead.mode_covs, ahead.mode_probs, z, h, r)
            x, p, mu = after.mode_states, after.mode_covs, after.mode_probs
        return after.x, after.P

    return _each(problem, lambda track: None, one)


def kalbee(problem: Problem) -> Run:
    """kalbee's InteractingMultipleModel."""
    from kalbee.modules.filters.imm_filter import InteractingMultipleModel
    from kalbee.modules.filters.kf_filter import KalmanFilter

    def made(track: int) -> Any:
        r = problem.variance * np.eye(problem.measured.shape[2])
        filters = [
            KalmanFilter(problem.mean[track][:, None].copy(), problem.covariance.copy(), f, q, problem.sensitivity, r)
            for f, q in zip(problem.carry, problem.noise, strict=True)
        ]
        return InteractingMultipleModel(filters, problem.chance, problem.share)

    def one(track: int, imm: Any) -> States:
        for z in problem.measured[:, track, :, None]:
            imm.predict()
            imm.update(z)
        return imm.state[:, 0], imm.covariance

    return _each(problem, made, one)


def stone_soup(problem: Problem) -> Run:
    """Stone Soup has no IMM: one of its own predictors and updaters for each model, mixed and weighed here."""
    from datetime import datetime, timedelta

    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import KalmanUpdater

    class Sum(LinearGaussian):
        """Position and the source's error together, which no mapping of single states tells."""

        def matrix(self, **_: Any) -> Floats:
            return problem.sensitivity

    k, d = problem.sensitivity.shape
    models, begin = range(len(problem.share)), datetime(2026, 1, 1)
    predictors = [
        KalmanPredictor(LinearGaussianTimeInvariantTransitionModel(transition_matrix=f, covariance_matrix=q))
        for f, q in zip(problem.carry, problem.noise, strict=True)
    ]
    updater = KalmanUpdater(Sum(d, tuple(range(k)), problem.variance * np.eye(k)))

    def matched(share: Floats, states: list[Any]) -> States:
        mean = sum(share[i] * np.asarray(states[i].state_vector, float)[:, 0] for i in models)
        off = [np.asarray(states[i].state_vector, float)[:, 0] - mean for i in models]
        spread = sum(share[i] * (np.asarray(states[i].covar, float) + np.outer(off[i], off[i])) for i in models)
        return mean, spread

    def one(track: int, _: Any) -> States:
        states = [GaussianState(problem.mean[track][:, None], problem.covariance, timestamp=begin) for _ in models]
        mu = problem.share
        for number, z in enumerate(problem.measured[:, track], 1):
            now, ahead = begin + timedelta(seconds=number), mu @ problem.chance
            report, after, likelihood = Detection(z[:, None], timestamp=now), [], np.zeros(len(mu))
            for j in models:
                mean, covariance = matched(problem.chance[:, j] * mu / ahead[j], states)
                mixed = GaussianState(mean[:, None], covariance, timestamp=begin + timedelta(seconds=number - 1))
                prior = predictors[j].predict(mixed, timestamp=now)
                foretold = updater.predict_measurement(prior)
                y = z - np.asarray(foretold.state_vector, float)[:, 0]
                s = np.asarray(foretold.covar, float)
                likelihood[j] = math.exp(-0.5 * y @ np.linalg.solve(s, y)) / math.sqrt(np.linalg.det(2 * math.pi * s))
                after.append(updater.update(SingleHypothesis(prior, report, foretold)))
            weight = ahead * likelihood
            states, mu = after, weight / weight.sum()
            combined = matched(mu, states)
        return combined

    return _each(problem, lambda track: None, one)


def _each(problem: Problem, made: Callable[[int], Any], one: Callable[[int, Any], States]) -> Run:
    """Track after track; the filters are made before that."""
    filters = [made(track) for track in range(len(problem.mean))]
    return lambda: _gathered([one(track, each) for track, each in enumerate(filters)])


def _gathered(states: list[States]) -> States:
    """Of the nine states that everybody tells."""
    states = [(mean[:9], covariance[:9, :9]) for mean, covariance in states]
    return np.array([mean for mean, _ in states]), np.array([covariance for _, covariance in states])


PEERS: dict[str, tuple[Callable[[Problem], Run], str, str]] = {
    "FilterPy": (filterpy, "filterpy", "filterpy"),
    "nrl-tracker": (nrl_tracker, "pytcl", "nrl-tracker"),
    "kalbee": (kalbee, "kalbee", "kalbee"),
    "Stone Soup (assembled)": (stone_soup, "stonesoup", "stonesoup"),
}
"""The libraries: their side, the module that tells whether they are there, and what to install."""
