"""Paper 002-1's experiments: the adaptive alpha-beta-gamma filter without noise, on a sine, through a manoeuvre.

One axis, one update a second; all draws of one experiment are one batch of tracks.
Source: 002-1, 3.1 and 3.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.alpha_beta_gamma import Tuning, covariance, predict, start, update
from sim.studies import Progress, Steps, Study, Table, gather, silent

Floats = NDArray[np.float64]

INTERVAL_S = 1.0
QUADRATIC_S, QUADRATIC_MPS2 = 100.0, 2.0  # figures 3 and 4: how long the motion is accelerated, and how much
SINE_M, SINE_S, SINE_SIGMA_M = 5000.0, 200.0, 50.0  # figure 5
CALM_S, HARD_S, HARD_MPS2, HARD_SIGMA_M = 80.0, 20.0, 20.0, 30.0  # straight, a manoeuvre, straight
ENOUGH, TOO_SMALL = 0.5, 1e-3  # gamma of figures 3 and 4; the manoeuvre's q is the small one


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion along one axis: times (t,), position m, velocity m/s, acceleration m/s2 (t, 3), and when it changes."""

    time_s: Floats
    truth: Floats
    changes_s: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Run:
    """What a filter made of a motion, from the second sample on: truth (t, 3), estimate (t, runs, 3), the rest (t, runs)."""

    time_s: Floats
    changes_s: tuple[float, ...]
    truth: Floats
    measured_m: Floats
    estimate: Floats
    gamma: Floats
    p: Floats
    nees: Floats
    nis: Floats

    @property
    def error_m(self) -> Floats:
        """Position errors (t, runs)."""
        return np.asarray(self.estimate[:, :, 0] - self.truth[:, None, 0])


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """The paper's figures as tables, honesty, defaults against the best tuned, and cost and convergence beside others.

    `rrd`: where figures 3, 4 and 5 and the manoeuvre are drawn, or None.
    """
    from sim.studies import alpha_beta_gamma_figures, alpha_beta_gamma_peers, alpha_beta_gamma_tables

    steps: Steps = (
        ("figures 3 to 5", lambda: followed(runs, seed)),
        ("honesty", lambda: alpha_beta_gamma_tables.honesty(runs, seed)),
        ("defaults", lambda: alpha_beta_gamma_tables.defaults(runs, seed)),
        ("convergence", lambda: alpha_beta_gamma_peers.convergence(runs, seed)),
        ("cost", lambda: alpha_beta_gamma_peers.cost(seed)),
    )
    tables, figures = gather(steps, progress)
    if rrd is not None:
        progress("drawing", len(steps) / (len(steps) + 1))
        alpha_beta_gamma_figures.draw(rrd, seed)
    return Study("alpha-beta-gamma", runs, seed, tables, figures, str(rrd) if rrd else None)


def accelerated(time_s: Floats, acceleration_mps2: Floats, velocity_mps: float = 0.0) -> Motion:
    """The motion whose acceleration is constant between samples; `acceleration_mps2` (t,) is that from each sample on."""
    gaps = np.diff(time_s)
    velocity = velocity_mps + np.concatenate([[0.0], np.cumsum(acceleration_mps2[:-1] * gaps)])
    position = np.concatenate([[0.0], np.cumsum(velocity[:-1] * gaps + 0.5 * acceleration_mps2[:-1] * gaps**2)])
    changes = time_s[1:][np.diff(acceleration_mps2) != 0.0]
    return Motion(time_s, np.stack([position, velocity, acceleration_mps2], axis=1), tuple(map(float, changes)))


def filtered(motion: Motion, measured_m: Floats, sigma_m: float, tuning: Tuning, velocity_mps: float | None) -> Run:
    """The filter over measured positions (t, runs), started on the first one, at a velocity where one is known."""
    known = None if velocity_mps is None else np.full((measured_m.shape[1], 1), velocity_mps)
    sigma = np.full((measured_m.shape[1], 1), sigma_m)
    state = start(measured_m[0][:, None], sigma, tuning, known, 1.0)
    rows = []
    for truth, measured, gap_s in zip(motion.truth[1:], measured_m[1:], np.diff(motion.time_s), strict=True):
        state = predict(state, np.full(len(measured), gap_s))
        state, told = update(state, measured[:, None], sigma, tuning)
        estimate = np.concatenate([state.position, state.velocity, state.acceleration], axis=1)
        off = (estimate - truth)[:, :, None]
        nees = (off.transpose(0, 2, 1) @ np.linalg.inv(covariance(state)[:, 0]) @ off)[:, 0, 0]
        rows.append((estimate, told.gamma[:, 0], state.p[:, 0], nees, told.normalised))
    estimates, gamma, p, all_nees, nis = (np.array(column) for column in zip(*rows, strict=True))
    after = slice(1, None)
    return Run(
        motion.time_s[after],
        motion.changes_s,
        motion.truth[after],
        measured_m[after],
        estimates,
        gamma,
        p,
        all_nees,
        nis,
    )


def noise_free(gamma: float) -> Run:
    """Figures 3 and 4: from rest accelerated, then uniform, measured without noise, with a fixed gain parameter."""
    time_s = np.arange(0.0, 2.0 * QUADRATIC_S + 1.0, INTERVAL_S)
    motion = accelerated(time_s, np.where(time_s < QUADRATIC_S, QUADRATIC_MPS2, 0.0))
    fixed = Tuning(q=gamma, least_p=1.0, greatest_p=1.0, follows_covariance=False)
    return filtered(motion, motion.truth[:, :1], 1.0, fixed, 0.0)


def sine(tuning: Tuning, runs: int, seed: int) -> Run:
    """Figure 5: two periods of a sine, measured with noise; the filter knows nothing of the velocity at the start."""
    time_s = np.arange(0.0, 2.0 * SINE_S + 1.0, INTERVAL_S)
    turn = 2.0 * np.pi / SINE_S
    wave, slope = SINE_M * np.sin(turn * time_s), SINE_M * turn * np.cos(turn * time_s)
    motion = Motion(time_s, np.stack([wave, slope, -(turn**2) * wave], axis=1))
    return filtered(motion, _noisy(motion, SINE_SIGMA_M, runs, seed), SINE_SIGMA_M, tuning, None)


def manoeuvre(tuning: Tuning, runs: int, seed: int) -> Run:
    """Straight at 100 m/s, a hard acceleration, straight again; the filter knows the velocity at the start."""
    time_s = np.arange(0.0, 2.0 * CALM_S + HARD_S + 1.0, INTERVAL_S)
    hard = (time_s >= CALM_S) & (time_s < CALM_S + HARD_S)
    motion = accelerated(time_s, np.where(hard, HARD_MPS2, 0.0), 100.0)
    return filtered(motion, _noisy(motion, HARD_SIGMA_M, runs, seed), HARD_SIGMA_M, tuning, 100.0)


def followed(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """RMS errors by figure and phase: without noise, on the sine, and in the manoeuvre with a fixed and an adapted gain."""
    rows: list[tuple[str | float, ...]] = []
    for name, gamma in (("figure 3, gamma 0.5", ENOUGH), ("figure 4, gamma 0.001", TOO_SMALL)):
        free = noise_free(gamma)
        rows.append((f"{name}, no noise", *(rms(free.error_m[one]) for one in _phases(free)), _greatest(free)))
    for name, tuning in (("printed", Tuning(follows_covariance=False)), ("default", Tuning())):
        wave = sine(tuning, runs, seed)
        rows.append(
            (f"figure 5, sine, sigma 50 m, {name}", np.nan, rms(wave.error_m[wave.time_s > 60.0]), np.nan, np.nan)
        )
    found = {"sine": float(rows[-1][2])}
    fixed = Tuning(q=TOO_SMALL, least_p=1.0, greatest_p=1.0, follows_covariance=False)
    for name, tuning in (
        ("q 0.001 fixed", fixed),
        ("q 0.001 adaptive, printed", Tuning(q=TOO_SMALL, follows_covariance=False)),
        ("q 0.001 adaptive", Tuning(q=TOO_SMALL)),
        ("default", Tuning()),
    ):
        hard = manoeuvre(tuning, runs, seed)
        phases = [rms(hard.error_m[one]) for one in _phases(hard)]
        rows.append((f"manoeuvre, sigma 30 m, {name}", *phases, _greatest(hard)))
        found |= {f"calm {name}": phases[0], f"manoeuvre {name}": phases[1]}
    columns = ("position error, RMS m", "before", "changed", "after", "greatest of the mean")
    notes = (
        "before: 40 s before the first change; changed: 20 s from it on (sine: all but a minute); after: from 60 s on",
    )
    return Table(f"002-1: figures 3 to 5 over {runs} runs", columns, tuple(rows), notes), found


def rms(values: Floats) -> float:
    """Root of the mean square of everything."""
    return float(np.sqrt(np.square(values).mean()))


def _phases(run: Run) -> tuple[NDArray[np.bool_], ...]:
    """Which times are in the 40 s before the first change, in the 20 s after it, and settled after all changes."""
    first, last = run.changes_s[0], run.changes_s[-1]
    time_s = run.time_s
    return (
        (time_s >= first - 40.0) & (time_s < first),
        (time_s >= first) & (time_s < first + 20.0),
        time_s >= last + 60.0,
    )


def _greatest(run: Run) -> float:
    """The greatest deviation (m) of the mean over runs, after the first change."""
    return float(np.abs(run.error_m.mean(axis=1))[run.time_s >= run.changes_s[0]].max())


def _noisy(motion: Motion, sigma_m: float, runs: int, seed: int) -> Floats:
    """The positions with noise, (t, runs)."""
    noise = np.random.default_rng(seed).standard_normal((len(motion.time_s), runs))
    return np.asarray(motion.truth[:, :1] + sigma_m * noise)
