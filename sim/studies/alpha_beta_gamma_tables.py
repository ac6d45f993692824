"""How honest the alpha-beta-gamma filter is about its errors, and what its defaults cost against the best tuning."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.alpha_beta_gamma import Tuning, covariance, predict, start, update
from sim.studies import Table

Floats = NDArray[np.float64]

DENSITIES = (0.01, Tuning().density, 0.3, 1.0, 3.0)
# name, speed m/s, legs of (seconds, degrees a second), sigma m, interval s
TURNS: tuple[tuple[str, float, tuple[tuple[float, float], ...], float, float], ...] = (
    ("drone, 15 m/s, 15 and 30 degrees/s", 15.0, ((20, 0), (10, 30), (20, 0), (12, -15), (20, 0)), 2.0, 0.2),
    ("drone, 15 m/s, once a second", 15.0, ((40, 0), (20, 15), (40, 0), (20, -15), (40, 0)), 1.5, 1.0),
    ("000's case, 118 m/s", 118.0, ((100, 0), (100, -3), (100, 0), (50, 3), (150, 0)), 50.0, 1.0),
    ("jet, 130 m/s, radar", 130.0, ((60, 0), (60, 3), (60, 0), (30, -3), (60, 0)), 30.0, 0.4),
    ("jet, 130 m/s, reports", 130.0, ((100, 0), (60, 3), (100, 0), (60, -3), (100, 0)), 15.0, 5.0),
    ("jet, 130 m/s, hardly turning", 130.0, ((150, 0), (60, 0.7), (150, 0)), 30.0, 0.4),
)


def honesty(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """NEES and NIS of targets that move as the filter thinks, second by second against their 95 % interval."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for density, sigma_m, interval_s in ((1.0, 30.0, 1.0), (0.01, 30.0, 1.0), (10.0, 15.0, 0.4), (1.0, 5.0, 5.0)):
        truth, measured = wandering(density, sigma_m, interval_s, runs, seed)
        case = f"{density:g} m2/s5, {sigma_m:g} m, each {interval_s:g} s"
        for name, tuning in (
            ("nothing adapts", Tuning(density=density, learning=0.0, least_p=1.0, greatest_p=1.0)),
            ("default", Tuning(density=density)),
            ("printed", Tuning(density=density, follows_covariance=False)),
        ):
            nees, nis, error = consistency(truth, measured, sigma_m, interval_s, tuning)
            settled = slice(40, None)
            inside = 100.0 * np.mean(np.abs(nees[settled] - 3.0) < 1.96 * np.sqrt(6.0 / runs))
            rows.append(
                (f"{case}, {name}", error / sigma_m, nees[settled].mean() / 3.0, float(inside), nis[settled].mean())
            )
            figures[f"nees {case}, {name}"] = float(nees[settled].mean() / 3.0)
            figures[f"inside {case}, {name}"] = float(inside)
    columns = ("matched targets", "error / sigma", "NEES / 3", "seconds inside %", "NIS")
    return Table(f"002-1: honesty over {runs} runs", columns, tuple(rows)), figures


def wandering(density: float, sigma_m: float, interval_s: float, runs: int, seed: int) -> tuple[Floats, Floats]:
    """Targets whose acceleration takes a random step before each interval: truth (t, runs, 3), measured positions (t, runs)."""
    rng = np.random.default_rng(seed)
    t, count = interval_s, 240
    now = np.zeros((runs, 3))
    truth = np.zeros((count, runs, 3))
    for k in range(1, count):
        s, v, a = now.T
        a = a + np.sqrt(density * t) * rng.standard_normal(runs)
        now = np.stack([s + t * v + 0.5 * t * t * a, v + t * a, a], axis=1)
        truth[k] = now
    return truth, truth[:, :, 0] + sigma_m * rng.standard_normal((count, runs))


def consistency(
    truth: Floats, measured: Floats, sigma_m: float, interval_s: float, tuning: Tuning
) -> tuple[Floats, Floats, float]:
    """Mean NEES (t,) of three degrees, mean NIS (t,) of one, and the RMS position error (m) once settled."""
    runs = measured.shape[1]
    sigma = np.full((runs, 1), sigma_m)
    state = start(measured[0][:, None], sigma, tuning, np.zeros((runs, 1)), 1.0)
    nees, nis, error = [], [], []
    for k in range(1, len(measured)):
        state = predict(state, np.full(runs, interval_s))
        state, told = update(state, measured[k][:, None], sigma, tuning)
        off = np.concatenate([state.position, state.velocity, state.acceleration], axis=1) - truth[k]
        inverse = np.linalg.inv(covariance(state)[:, 0])
        nees.append(float((off[:, None, :] @ inverse @ off[:, :, None]).mean()))
        nis.append(float(told.normalised.mean()))
        error.append(float(np.square(off[:, 0]).mean()))
    return np.array(nees), np.array(nis), float(np.sqrt(np.mean(error[40:])))


def defaults(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """RMS position error of the defaults against the best starting density, for drones and jets."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for name, speed_mps, legs, sigma_m, interval_s in TURNS:
        path = turning(speed_mps, legs, interval_s)
        tuned = {one: _level_error(path, sigma_m, interval_s, Tuning(density=one), runs, seed) for one in DENSITIES}
        best = min(tuned, key=lambda one: tuned[one])
        ours = tuned[Tuning().density]
        rows.append((name, sigma_m, interval_s, ours, tuned[best], best, ours / tuned[best]))
        figures[f"defaults {name}"] = ours / tuned[best]
    columns = ("turns", "sigma m", "each s", "default m", "best tuned m", "its density", "ratio")
    return Table(f"002-1: one set of defaults, {runs} runs, 2-D RMS error", columns, tuple(rows)), figures


def turning(speed_mps: float, legs: tuple[tuple[float, float], ...], interval_s: float) -> Floats:
    """Level positions (t, 2) of a flight at constant speed over legs of (seconds, degrees a second)."""
    fine = 20
    rate = np.concatenate([np.full(round(seconds / interval_s) * fine, degrees) for seconds, degrees in legs])
    step_s = interval_s / fine
    course = 0.25 * np.pi + np.concatenate([[0.0], np.cumsum(np.deg2rad(rate) * step_s)])
    halfway = 0.5 * (course[1:] + course[:-1])
    steps = speed_mps * step_s * np.stack([np.cos(halfway), np.sin(halfway)], axis=1)
    return np.asarray(np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])[::fine])


def _level_error(path: Floats, sigma_m: float, interval_s: float, tuning: Tuning, runs: int, seed: int) -> float:
    """RMS position error (m) from the tenth update on."""
    noise = np.random.default_rng(seed).standard_normal((len(path), runs, 2))
    measured, sigma = path[:, None] + sigma_m * noise, np.full((runs, 2), sigma_m)
    state = start(measured[0], sigma, tuning)
    squares = []
    for k in range(1, len(path)):
        state = predict(state, np.full(runs, interval_s))
        state, _ = update(state, measured[k], sigma, tuning)
        squares.append(float(np.square(state.position - path[k]).sum(axis=1).mean()))
    return float(np.sqrt(np.mean(squares[10:])))
