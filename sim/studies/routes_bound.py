"""How cheap a route can be: found without the planners, by polylines bent from many random ways.

Each of `STARTS` ways through random points is a polyline whose corners L-BFGS moves, first a few, those of the cheapest ways
then more and more. No spline, no grid and no annealing has a part in it; turn radius and courses are left free, so that it can
only be cheaper. A grid four times as fine as the planner's says whether ways past other sides of threats were missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from sim.planning.field import measure, resampled
from sim.planning.grid import ways
from sim.planning.task import Task

Floats = NDArray[np.float64]

STARTS, KEPT = 40, 5
CORNERS = (20, 40, 80, 160)
FINE_CELLS = 250
_EVEN = 1e-4
_UNIT_M = 1_000.0


def best_known(task: Task, seed: int) -> tuple[float, Floats]:
    """The least J (m) that any of the ways came to, and that way (n, 2) m."""
    chance = np.random.default_rng(seed)
    low, high = task.box_m
    found: list[tuple[float, Floats]] = []
    for number in range(STARTS):
        between = chance.uniform(low, high, (number % 4, 2))
        between = between[np.argsort((between - task.start_m) @ (task.goal_m - task.start_m))]
        way = np.concatenate([task.start_m[None], between, task.goal_m[None]])
        found.append(_bent(task, way, CORNERS[0]))
    found.sort(key=lambda one: one[0])
    kept = [_refined(task, way) for _, way in _different(found)]
    return min(kept, key=lambda one: one[0])


def fine_grid(task: Task) -> float:
    """J of the cheapest way on a grid of `FINE_CELLS` (m): at most 1.4 % above the least, if ways of all kinds are seen."""
    return measure(ways(task, FINE_CELLS, kinds=1)[0], task.threats, task.lambda_m4).cost_m


def _different(found: list[tuple[float, Floats]]) -> list[tuple[float, Floats]]:
    """The cheapest few of those that did not end at the same J."""
    kept: list[tuple[float, Floats]] = []
    for one in found:
        if len(kept) < KEPT and all(one[0] > 1.002 * other[0] for other in kept):
            kept.append(one)
    return kept


def _refined(task: Task, way_m: Floats) -> tuple[float, Floats]:
    for corners in CORNERS[1:]:
        _, way_m = _bent(task, way_m, corners)
    return measure(way_m, task.threats, task.lambda_m4).cost_m, way_m


def _bent(task: Task, way_m: Floats, corners: int) -> tuple[float, Floats]:
    """The way with so many corners, moved until J is least."""
    length = float(np.hypot(*np.diff(way_m, axis=0).T).sum())
    begin = resampled(way_m, length / (corners + 1))[1:-1] / _UNIT_M
    low, high = task.box_m / _UNIT_M
    bounds = [(low[axis], high[axis]) for _ in begin for axis in (0, 1)]
    found = minimize(
        _cost, np.clip(begin, low, high).ravel(), args=(task,), jac=True, method="L-BFGS-B", bounds=bounds,
        options={"maxiter": 400, "maxcor": 20, "ftol": 1e-10, "gtol": 1e-7},
    )  # fmt: skip
    return float(found.fun) * _UNIT_M, _with_ends(found.x, task) * _UNIT_M


def _with_ends(free: Floats, task: Task) -> Floats:
    return np.concatenate([task.start_m[None] / _UNIT_M, free.reshape(-1, 2), task.goal_m[None] / _UNIT_M])


def _cost(free: Floats, task: Task) -> tuple[float, Floats]:
    """J of a polyline in km by Simpson's rule on each of its straights, and the derivative by its corners."""
    corner = _with_ends(free, task)
    middle = 0.5 * (corner[1:] + corner[:-1])
    density, steep = task.threats.density_and_gradient(np.concatenate([corner, middle]) * _UNIT_M)
    price, by_place = 1.0 + task.lambda_m4 * density, task.lambda_m4 * _UNIT_M * steep
    at, half = price[: len(corner)], price[len(corner) :]
    step = np.diff(corner, axis=0)
    length = np.maximum(np.hypot(*step.T), 1e-9)
    rate = (at[:-1] + 4.0 * half + at[1:]) / 6.0
    mean = length.mean()
    total = float((rate * length).sum() + _EVEN * ((length - mean) ** 2).sum() / mean)
    by_length = rate + 2.0 * _EVEN * (length - mean) / mean
    along = (by_length / length)[:, None] * step
    inside = (length / 6.0)[:, None] * 4.0 * 0.5 * by_place[len(corner) :]
    by_corner = np.zeros_like(corner)
    by_corner[1:] += along + inside
    by_corner[:-1] += inside - along
    weight = np.zeros(len(corner))
    weight[1:] += length / 6.0
    weight[:-1] += length / 6.0
    by_corner += weight[:, None] * by_place[: len(corner)]
    return total, by_corner[1:-1].ravel()
