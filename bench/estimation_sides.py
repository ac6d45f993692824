"""Who runs the IMM of `bench.estimation`: ourselves, a loop as textbooks write it, and four libraries' filters.

Each side is a function of a problem that gives another one: what runs all tracks of the problem through all its reports and
returns the combined states after the last one, mean (n, d) and covariance (n, d, d). What it makes for each track before the
first report is not measured.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
States = tuple[Floats, Floats]
Run = Callable[[], States]


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
        """(k, d)."""
        return np.eye(self.measured.shape[2], self.mean.shape[1])


def ours(problem: Problem) -> Run:
    """All tracks in one batch."""
    from gateway.estimators.interaction import Models, combined, corrected, mixed, moved

    n, d = problem.mean.shape
    m, k = len(problem.share), problem.measured.shape[2]
    change, noise = (
        (problem.carry - np.eye(d)).transpose(1, 2, 0)[..., None],
        problem.noise.transpose(1, 2, 0)[..., None],
    )
    touched = [np.flatnonzero((change[:, column] != 0.0).any(axis=(1, 2))) for column in range(d)]
    columns = [(column, int(rows[0]), int(rows[-1]) + 1) for column, rows in enumerate(touched) if len(rows)]
    chance, variance, seen = problem.chance[:, :, None], np.full((k, 1), problem.variance), slice(0, k)
    measured = np.ascontiguousarray(problem.measured.transpose(0, 2, 1))
    first = Models(
        np.repeat(problem.share[:, None], n, axis=1),
        np.repeat(problem.mean.T[:, None], m, axis=1),
        np.repeat(np.repeat(problem.covariance[:, :, None], m, axis=2)[..., None], n, axis=3),
    )

    def run() -> States:
        models = first
        for report in measured:
            models = corrected(moved(mixed(models, chance), change, noise, columns), report, variance, seen)
            mean, covariance = combined(models)
        return mean.T, covariance.transpose(2, 0, 1)

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

    k, d = problem.sensitivity.shape
    models, begin = range(len(problem.share)), datetime(2026, 1, 1)
    predictors = [
        KalmanPredictor(LinearGaussianTimeInvariantTransitionModel(transition_matrix=f, covariance_matrix=q))
        for f, q in zip(problem.carry, problem.noise, strict=True)
    ]
    updater = KalmanUpdater(LinearGaussian(d, tuple(range(k)), problem.variance * np.eye(k)))

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
    return np.array([mean for mean, _ in states]), np.array([covariance for _, covariance in states])


PEERS: dict[str, tuple[Callable[[Problem], Run], str, str]] = {
    "FilterPy": (filterpy, "filterpy", "filterpy"),
    "nrl-tracker": (nrl_tracker, "pytcl", "nrl-tracker"),
    "kalbee": (kalbee, "kalbee", "kalbee"),
    "Stone Soup (assembled)": (stone_soup, "stonesoup", "stonesoup"),
}
"""The libraries: their side, the module that tells whether they are there, and what to install."""
