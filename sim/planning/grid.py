"""Shortest paths on a grid, priced by J: the best, and the best of those that pass threats on other sides.

Nodes have 32 neighbours, so that a path is at most 1.4 % longer than a straight line. Two ways are of different kinds when no
bending makes one of them the other without crossing a threat or an area: their angles about it differ by full turns.
Source: 002-3, the modern planner.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from sim.planning.areas import outside
from sim.planning.task import PlanError, Task

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

CELLS = 110  # along the longer side
KINDS = 5  # ways of different kinds that are looked into
WORTH = 1.3  # those that cost at most so many times as much as the best
_KNIGHTS = ((1, 0), (1, 1), (2, 1), (1, 2), (3, 1), (1, 3), (3, 2), (2, 3))
_MOVES = np.array([move for x, y in _KNIGHTS for move in ((x, y), (y, -x))])  # in half of all directions
_SAMPLES, _WEIGHTS = (
    np.array([0.0, 0.25, 0.5, 0.75, 1.0]),
    np.array([7.0, 32.0, 12.0, 32.0, 7.0]) / 90.0,
)  # Boole's rule


def ways(task: Task, cells: int = CELLS, kinds: int = KINDS) -> list[Floats]:
    """Paths (n, 2) m from start to goal, the cheapest of each kind, the cheapest first.

    Raises PlanError when there is none, or an end is where nobody may be.
    """
    for name, place in (("start", task.start_m), ("goal", task.goal_m)):
        if outside(task.areas, place) <= 0.0:
            raise PlanError(f"The {name} is within an area to keep out of.")
    node_m, graph = _graph(task, cells)
    start, goal = len(node_m) - 2, len(node_m) - 1
    cost, before = dijkstra(graph, directed=False, indices=[start, goal], return_predecessors=True)
    if not np.isfinite(cost[0, goal]):
        raise PlanError("No way leads from the start to the goal outside the areas to keep out of.")
    through = cost.sum(axis=0)
    about = np.concatenate([task.threats.place_m, *(area.middle()[None] for area in task.areas)])
    kind = _kinds(node_m, before, about) if len(about) else np.zeros((len(node_m), 0), dtype=np.int64)
    order = np.argsort(through, kind="stable")
    order = order[through[order] <= WORTH * through[goal]]
    _, first = np.unique(kind[order], axis=0, return_index=True)
    return [_path(node_m, before, int(order[place])) for place in np.sort(first)[:kinds]]


def _graph(task: Task, cells: int) -> tuple[Floats, csr_array]:
    """The nodes (n, 2) m, start and goal last, and what the moves between them cost."""
    low, high = task.box_m
    step = float((high - low).max()) / cells
    counts = np.maximum(np.floor((high - low) / step).astype(np.int64), 1) + 1
    x, y = (low[axis] + step * np.arange(counts[axis]) for axis in (0, 1))
    column, row = (one.ravel() for one in np.meshgrid(np.arange(counts[0]), np.arange(counts[1]), indexing="ij"))
    node_m = np.concatenate([np.stack([x[column], y[row]], axis=-1), task.start_m[None], task.goal_m[None]])
    begins, ends = [], []
    for across, along in _MOVES:
        within = (column + across < counts[0]) & (row + along >= 0) & (row + along < counts[1])
        begin = np.flatnonzero(within)
        begins.append(begin)
        ends.append(begin + across * counts[1] + along)
    for last in (len(node_m) - 2, len(node_m) - 1):
        near = np.flatnonzero(np.hypot(*(node_m - node_m[last]).T) < 3.0 * step)
        near = near[near != last]
        begins.append(np.full(len(near), last))
        ends.append(near)
    begin, end = np.concatenate(begins), np.concatenate(ends)
    cost = _costs(task, node_m[begin], node_m[end])
    open_ = np.isfinite(cost)
    shape = (len(node_m), len(node_m))
    return node_m, csr_array((cost[open_], (begin[open_], end[open_])), shape=shape)


def _costs(task: Task, begin_m: Floats, end_m: Floats) -> Floats:
    """What straight moves (k, 2) cost, (k,) m; inf through areas."""
    length = np.hypot(*(end_m - begin_m).T)
    cost = np.zeros(len(length))
    for share, weight in zip(_SAMPLES, _WEIGHTS, strict=True):
        place = begin_m + share * (end_m - begin_m)
        cost += weight * task.price(place)
        cost[outside(task.areas, place) <= 0.0] = np.inf
    return np.asarray(np.maximum(cost * length, 1e-9))


def _kinds(node_m: Floats, before: Whole, about_m: Floats) -> Whole:
    """Full turns (n, k) about each place of the cheapest way through each node, against one of them."""
    turned = _turned(node_m, before[0], about_m) - _turned(node_m, before[1], about_m)
    return np.asarray(np.rint((turned - turned[-1]) / (2.0 * np.pi)), dtype=np.int64)


def _turned(node_m: Floats, before: Whole, about_m: Floats) -> Floats:
    """By how much the way from a tree's root to each of its nodes turns about places (k, 2), rad (n, k).

    Summed along the tree by pointers that jump twice as far each time.
    """
    parent = np.where(before < 0, np.arange(len(before)), before)
    seen = node_m[:, None] - about_m
    last = seen[parent]
    turned = np.arctan2(last[..., 0] * seen[..., 1] - last[..., 1] * seen[..., 0], (last * seen).sum(axis=-1))
    while not np.array_equal(further := parent[parent], parent):
        turned = turned + turned[parent]
        parent = further
    return np.asarray(turned)


def _path(node_m: Floats, before: Whole, through: int) -> Floats:
    """The cheapest way (n, 2) from start to goal through a node."""
    halves = []
    for tree in before:
        node, nodes = through, [through]
        while (node := int(tree[node])) >= 0:
            nodes.append(node)
        halves.append(nodes)
    return np.asarray(node_m[halves[0][::-1] + halves[1][1:]])
