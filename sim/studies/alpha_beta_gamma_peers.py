"""The alpha-beta-gamma filter beside a Kalman filter and an LMS predictor: how soon they settle, and what an update costs."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import kalman
from gateway.estimators.alpha_beta_gamma import Tuning, predict, start, update
from sim.studies import Table
from sim.studies.alpha_beta_gamma_tables import wandering

Floats = NDArray[np.float64]

DENSITY, SIGMA_M, INTERVAL_S = 0.1, 30.0, 1.0
SPEED_MPS = 100.0  # that the filters do not know at the start
TAPS, STEP = 8, 0.05  # of the LMS predictor: of 4, 8, 16 taps and steps from 0.02 to 1 those of least error
SETTLED = 1.25  # times the least error at the end
TRACKS, UPDATES, ROUNDS = (1, 100, 1000, 3000), 10, 25


def convergence(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """One-step prediction errors of a target as the filters think it, whose velocity they do not know at the start."""
    truth, measured = wandering(DENSITY, SIGMA_M, INTERVAL_S, runs, seed)
    moved = SPEED_MPS * INTERVAL_S * np.arange(len(measured))[:, None]
    positions, measured = truth[:, :, 0] + moved, measured + moved
    errors = {
        name: np.sqrt(np.square(predictions - positions).mean(axis=1))[1:]
        for name, predictions in (
            ("alpha-beta-gamma, printed", predicted(measured, Tuning(density=DENSITY, follows_covariance=False))),
            ("alpha-beta-gamma, default", predicted(measured, Tuning(density=DENSITY))),
            ("Kalman, 3 states an axis", predicted_by_kalman(measured)),
            ("LMS, 8 taps", predicted_by_lms(measured)),
        )
    }
    ends = {name: float(np.sqrt(np.square(error[-60:]).mean())) for name, error in errors.items()}
    enough = SETTLED * min(ends.values())
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for name, error in errors.items():
        unsettled = np.flatnonzero(error > enough)
        updates = float(unsettled[-1] + 1) if ends[name] < enough else np.nan
        rows.append((name, ends[name], updates))
        figures |= {f"prediction {name}": ends[name], f"settled {name}": updates}
    columns = ("one-step prediction", "RMS m at the end", f"updates to {SETTLED:g} times the least")
    return Table(f"002-1: convergence from an unknown velocity, {runs} runs", columns, tuple(rows)), figures


def predicted(measured: Floats, tuning: Tuning) -> Floats:
    """Predictions (t, runs) of the positions measured (t, runs), each from the ones before; the first is the first itself."""
    runs = measured.shape[1]
    sigma, gap = np.full((runs, 1), SIGMA_M), np.full(runs, INTERVAL_S)
    state = start(measured[0][:, None], sigma, tuning)
    found = [measured[0]]
    for now in measured[1:]:
        state = predict(state, gap)
        found.append(state.position[:, 0])
        state, _ = update(state, now[:, None], sigma, tuning)
    return np.array(found)


def predicted_by_kalman(measured: Floats) -> Floats:
    """The same by the textbook's Kalman filter of constant acceleration."""
    t = INTERVAL_S
    carry = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    process = DENSITY * t * np.outer([0.5 * t * t, t, 1.0], [0.5 * t * t, t, 1.0])
    mean = np.zeros((measured.shape[1], 3))
    mean[:, 0] = measured[0]
    covariance = np.diag([SIGMA_M**2, 100.0**2, 5.0**2])
    found = [measured[0]]
    for now in measured[1:]:
        mean = (carry @ mean[:, :, None])[:, :, 0]
        covariance = carry @ covariance @ carry.T + process
        found.append(mean[:, 0].copy())
        gain = covariance[:, 0] / (covariance[0, 0] + SIGMA_M**2)
        mean += gain * (now - mean[:, 0])[:, None]
        covariance = covariance - np.outer(gain, covariance[0])
    return np.array(found)


def predicted_by_lms(measured: Floats) -> Floats:
    """The same by normalised LMS: the next displacement as a learnt sum of the last ones."""
    runs = measured.shape[1]
    weights, last = np.full((runs, TAPS), 1.0 / TAPS), np.zeros((runs, TAPS))
    found = [measured[0]]
    for before, now in pairwise(measured):
        displacement = (weights * last).sum(axis=1)
        found.append(before + displacement)
        off = (now - before) - displacement
        weights += STEP * off[:, None] * last / (np.square(last).sum(axis=1) + SIGMA_M**2)[:, None]
        last = np.concatenate([(now - before)[:, None], last[:, :-1]], axis=1)
    return np.array(found)


def cost(seed: int) -> tuple[Table, dict[str, float]]:
    """Microseconds an axis and update (prediction, update), three axes a track: medians of one interleaved run, CPU time."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for tracks in TRACKS:
        contenders = _contenders(tracks, seed)
        taken: dict[str, list[float]] = {name: [] for name in contenders}
        for _ in range(ROUNDS):
            for name, work in contenders.items():
                begun = time.thread_time()
                work()
                taken[name].append(time.thread_time() - begun)
        ours = np.array(taken["our Kalman, 9 states"])
        for name, times in taken.items():
            each_us = 1e6 * float(np.median(times)) / (3 * tracks * UPDATES)
            cheaper = float(np.median(ours / np.array(times)))  # round by round: a busy machine slows neighbours alike
            rows.append((f"{tracks} at once, {name}", each_us, cheaper))
            figures |= {f"cost {tracks} {name}": each_us, f"cheaper {tracks} {name}": cheaper}
    columns = ("cost", "us an axis", "times cheaper than our Kalman")
    return Table("002-1: cost of an update", columns, tuple(rows)), figures


def _contenders(tracks: int, seed: int) -> dict[str, Callable[[], None]]:
    """The same measurements of the same tracks, worked in by each filter."""
    rng = np.random.default_rng(seed)
    first, sigma = 1e4 * rng.standard_normal((tracks, 3)), np.full((tracks, 3), 15.0)
    measured = [first + 15.0 * rng.standard_normal((tracks, 3)) for _ in range(UPDATES)]
    gap = np.full(tracks, 0.4)
    covariance = np.broadcast_to(225.0 * np.eye(3), (tracks, 3, 3))
    motion, seen = kalman.Motion((1.6, 1.6, 0.4), 0.0), np.eye(3, kalman.SIZE)[None]

    def light(tuning: Tuning) -> Callable[[], None]:
        begun = start(first, sigma, tuning)

        def work() -> None:
            state = begun
            for position in measured:
                state, _ = update(predict(state, gap), position, sigma, tuning)

        return work

    begun = kalman.start(first, covariance, np.zeros((tracks, 3)), np.full(tracks, 100.0), 0.0)

    def ours() -> None:
        state = begun
        for position in measured:
            state = kalman.predict(state, gap, motion)
            state, _ = kalman.update(state, position - state.mean[:, :3], seen, sigma * sigma)

    def textbook() -> None:
        _textbook(first, measured, gap[0])

    return {
        "alpha-beta-gamma, printed": light(Tuning(follows_covariance=False)),
        "alpha-beta-gamma, default": light(Tuning()),
        "our Kalman, 9 states": ours,
        "Kalman, 3 states an axis": textbook,
    }


def _textbook(first: Floats, measured: list[Floats], t: float) -> None:
    """The matrix Kalman filter of constant acceleration, every axis by itself, in stacked products."""
    carry = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    process = DENSITY * t * np.outer([0.5 * t * t, t, 1.0], [0.5 * t * t, t, 1.0])
    mean = np.zeros((*first.shape, 3))
    mean[..., 0] = first
    covariance = np.broadcast_to(np.diag([225.0, 1e4, 25.0]), (*first.shape, 3, 3))
    for position in measured:
        mean = (carry @ mean[..., None])[..., 0]
        covariance = carry @ covariance @ carry.T + process
        gain = covariance[..., 0] / (covariance[..., 0, 0] + 225.0)[..., None]
        mean = mean + gain * (position - mean[..., 0])[..., None]
        covariance = covariance - gain[..., :, None] * covariance[..., 0, None, :]
