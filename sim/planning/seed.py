"""The paper's planner: local optima of triples of threats, those in a corridor joined by fitted curves, the best of the curves.

    objective   of a triple: threat (default), clearance, literal   `sim.planning.triples`
    fit         chains (default): the cheapest chain of optima through each of them, smoothed; literal: one function of the
                way along the corridor through all of them, y = f(x), of each degree that the print's software tries
    choice      J (default); literal: the shortest

Source: 002-3 1.1, 1.2, 2.2. Deviation: the print does not say which functions are fitted. One function through all optima
runs between those on either side of a threat, over it; so chains are the default.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sim.planning.areas import outside
from sim.planning.field import measure, resampled, stations
from sim.planning.spline import DEGREE, clamped_basis
from sim.planning.task import PlanError, Route, Task
from sim.planning.triples import Objective, anneal, triples

Floats = NDArray[np.float64]
Fit = Literal["chains", "literal"]
Choice = Literal["J", "literal"]

CORRIDOR = 85.0 / 545.0  # half its width by the straight way: |y - 0.942 x - 1.059| <= 5 from (1, 2) to (18, 18)
DEGREES = (2, 3, 4, 5, 6)
SPANS = (3, 4, 6, 9, 13)  # pieces of the splines that are fitted to a chain
_MOVE_SAMPLES = 24
_CURVE_POINTS = 400


@dataclass(frozen=True, slots=True)
class Seed:
    """How the paper's planner is to be read."""

    objective: Objective = "threat"
    fit: Fit = "chains"
    choice: Choice = "J"


LITERAL = Seed("literal", "literal", "literal")


def plan(task: Task, seed: int = 0, how: Seed = Seed()) -> Route:
    """The route of the paper's method, with the curves that it was chosen from. Raises PlanError.

    It knows threats and areas that a curve must not cross, but no turn radius and no courses.
    """
    if len(task.threats.place_m) < 3:
        raise PlanError("The paper's method needs at least three threats; plan with --method modern.")
    optima = local_optima(task, seed, how.objective)
    curves = _chains(task, optima) if how.fit == "chains" else _functions(task, optima)
    kept = []
    for curve in curves:
        if outside(task.areas, curve).min() >= task.aside_m:
            kept.append(Route(f"seed, {how.objective}", curve, measure(curve, task.threats, task.lambda_m4)))
    if not kept:
        raise PlanError("No curve of the paper's method keeps out of the areas; plan with --method modern.")
    kept.sort(key=lambda one: one.measures.cost_m if how.choice == "J" else one.measures.length_m)
    return replace(kept[0], candidates=tuple(kept[1:]))


def local_optima(task: Task, seed: int, objective: Objective) -> Floats:
    """The annealed optima (k, 2) that lie in the corridor, in order along it."""
    found = anneal(triples(task.threats.place_m), objective, np.random.default_rng(seed))
    along, aside, length = _corridor(task, found)
    inside = (np.abs(aside) <= CORRIDOR * length) & (along > 0.0) & (along < length)
    return found[inside][np.argsort(along[inside], kind="stable")]


def _corridor(task: Task, place_m: Floats) -> tuple[Floats, Floats, float]:
    """How far places (..., 2) are along the straight way and left of it, and its length, m."""
    straight = task.goal_m - task.start_m
    length = float(np.hypot(*straight))
    from_start = place_m - task.start_m
    along = (from_start * straight).sum(axis=-1) / length
    return along, (straight[0] * from_start[..., 1] - straight[1] * from_start[..., 0]) / length, length


def _functions(task: Task, optima_m: Floats) -> list[Floats]:
    """Polynomials y = f(x) along the straight way through both ends, fitted to all optima by least squares."""
    along, aside, length = _corridor(task, optima_m)
    share = along / length
    at = np.linspace(0.0, 1.0, _CURVE_POINTS)
    curves = []
    for degree in DEGREES:
        powers = np.arange(degree - 1)
        fitted = lstsq((share * (1.0 - share))[:, None] * share[:, None] ** powers, aside)[0]
        left = at * (1.0 - at) * (at[:, None] ** powers @ fitted)
        curves.append(_laid(task, at * length, left))
    return curves


def _laid(task: Task, along_m: Floats, left_m: Floats) -> Floats:
    """A curve along and left of the straight way as points (n, 2), its ends the task's to the bit."""
    straight = (task.goal_m - task.start_m) / np.hypot(*(task.goal_m - task.start_m))
    left = np.array([-straight[1], straight[0]])
    return _pinned(task, task.start_m + along_m[:, None] * straight + left_m[:, None] * left)


def _pinned(task: Task, curve_m: Floats) -> Floats:
    curve_m[0], curve_m[-1] = task.start_m, task.goal_m
    return resampled(curve_m)


def _chains(task: Task, optima_m: Floats) -> list[Floats]:
    """The cheapest chain through each optimum, as smooth curves."""
    node_m = np.concatenate([task.start_m[None], optima_m, task.goal_m[None]])
    begin, end = np.triu_indices(len(node_m), 1)  # in order along the way
    share = (np.arange(_MOVE_SAMPLES) + 0.5) / _MOVE_SAMPLES
    between = node_m[begin, None] + share[:, None] * (node_m[end] - node_m[begin])[:, None]
    cost = task.price(between).mean(axis=1) * np.hypot(*(node_m[end] - node_m[begin]).T)
    graph = csr_array((np.maximum(cost, 1e-6), (begin, end)), shape=(len(node_m), len(node_m)))
    _, ahead = dijkstra(graph, indices=0, return_predecessors=True)
    _, back = dijkstra(graph.T.tocsr(), indices=len(node_m) - 1, return_predecessors=True)
    chains = {_chain(ahead, back, node) for node in range(1, len(node_m) - 1)} or {(0, len(node_m) - 1)}
    return [curve for chain in sorted(chains) for curve in _smoothed(task, node_m[list(chain)])]


def _chain(ahead: NDArray[np.int32], back: NDArray[np.int32], through: int) -> tuple[int, ...]:
    chain = [through]
    while (node := int(ahead[chain[0]])) >= 0:
        chain.insert(0, node)
    while (node := int(back[chain[-1]])) >= 0:
        chain.append(node)
    return tuple(chain)


def _smoothed(task: Task, chain_m: Floats) -> list[Floats]:
    """Splines of fewer and more pieces, fitted by least squares to the straight moves of a chain (n, 2)."""
    station = stations(chain_m)
    curves = []
    for spans in SPANS:
        basis = clamped_basis(spans + DEGREE)
        at = np.linspace(0.0, station[-1], len(basis.value))
        straight = np.stack([np.interp(at, station, chain_m[:, axis]) for axis in (0, 1)], axis=-1)
        ends = np.stack([task.start_m, task.goal_m])
        inner = lstsq(basis.value[:, 1:-1], straight - basis.value[:, [0, -1]] @ ends)[0]
        curves.append(_pinned(task, basis.value @ np.concatenate([ends[:1], inner, ends[1:]])))
    return curves
