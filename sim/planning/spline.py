"""A way bent until J is least: a cubic B-spline whose control points L-BFGS moves, with the derivatives written out.

Its first and last control points are the ends, so that it starts and ends exactly there; with a course, the second lies on
the ray along it. Too narrow turns, and areas, cost more and more until none are left. Source: 002-3, the modern planner.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import minimize

from sim.planning.areas import outside
from sim.planning.field import resampled, stations
from sim.planning.task import Task

Floats = NDArray[np.float64]

DEGREE = 3
SPAN_M = 900.0  # of way for each control point; threats are 3 km apart
LEAST_SPANS, MOST_SPANS = 12, 72
_POINTS, _POINTS_BY_AREAS = 6, 16  # of the quadrature in each span; corners of areas must not slip between them
_UNIT_M = 1_000.0  # what places are scaled with for the search
_EVEN = 1e-3  # the weight of even spacing, which J leaves open
_SEARCHES = ((1.0, 1.02), (10.0, 1.03), (100.0, 1.06), (1_000.0, 1.1), (10_000.0, 1.2))
"""One after another until nothing is wrong: the weight of too narrow turns and areas, and how much wider turns are asked for
than they must be: between the quadrature's points they may be narrower. Areas' borders grow too, by
`_ASIDE_M` in the last."""
_WALL = 1e3  # what a km costs a km inside an area, by the weight: so much that no way leaps through
_ASIDE_M, _LEAST_ASIDE_M = 100.0, 10.0
_DENSE = 36  # points a span at which the result is checked: 25 m
_FINE_M = 5.0  # between points at which it is looked whether areas are kept out of
_ITERATIONS = 150


@dataclass(frozen=True, slots=True)
class Bent:
    """What the search ended at: points (n, 2) m; the least turn radius; how far it keeps from areas more than asked."""

    curve_m: Floats
    turn_radius_m: float
    outside_m: float


@dataclass(frozen=True, slots=True)
class Basis:
    """Values and two derivatives (m, n) of n basis functions at m parameters, and the quadrature's weights (m,)."""

    value: Floats
    first: Floats
    second: Floats
    weight: Floats


@cache
def clamped_basis(controls: int) -> Basis:
    """A clamped spline over [0, 1] at even parameters, ends included; without quadrature."""
    return _basis(controls, np.linspace(0.0, 1.0, (controls - DEGREE) * _DENSE + 1), np.zeros(0))


@cache
def _quadrature(controls: int, points: int) -> Basis:
    """The same at the points of Lobatto's quadrature in each span, which has the ends, where turns may be narrowest."""
    spans = controls - DEGREE
    last = Legendre.basis(points - 1)
    node = np.concatenate([[-1.0], np.sort(last.deriv().roots().real), [1.0]])
    share = 2.0 / (points * (points - 1) * last(node) ** 2)
    at = ((np.arange(spans)[:, None] + 0.5 * (node + 1.0)) / spans).ravel()
    return _basis(controls, at, np.tile(0.5 * share / spans, spans))


def _basis(controls: int, at: Floats, weight: Floats) -> Basis:
    inner = np.linspace(0.0, 1.0, controls - DEGREE + 1)
    spline = BSpline(np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)]), np.eye(controls), DEGREE)
    return Basis(spline(at), spline.derivative(1)(at), spline.derivative(2)(at), weight)


def bend(task: Task, way_m: Floats) -> Bent:
    """The way (n, 2) as a smooth curve of the same kind whose J is least."""
    way_m = _turned_into(task, way_m)
    length = stations(way_m)[-1]
    controls = int(np.clip(round(length / SPAN_M), LEAST_SPANS, MOST_SPANS)) + DEGREE
    search = _Search.of(task, controls)
    free = search.begin(way_m)
    wide_turns = max(SPAN_M / max(task.turn_radius_m, 1.0), 1.0)  # a way without kinks to begin with
    for number, (weight, wider) in enumerate(((1.0, wide_turns), *_SEARCHES)):
        found = minimize(
            search.cost, free, args=(weight, wider), jac=True, method="L-BFGS-B", bounds=search.bounds(),
            options={"maxiter": _ITERATIONS, "maxcor": 20, "ftol": 1e-9, "gtol": 1e-6},
        )  # fmt: skip
        free = found.x
        bent = search.bent(free)
        if number and bent.turn_radius_m >= task.turn_radius_m and bent.outside_m >= 0.0:
            break
    return bent


def _turned_into(task: Task, way_m: Floats) -> Floats:
    """The way with the half of a circle before it, or behind, where its end's course points the other way."""
    if task.start_course is not None:
        way_m = _turned_from(way_m, task.start_course, task.turn_radius_m)
    if task.goal_course is not None:
        way_m = _turned_from(way_m[::-1], -task.goal_course, task.turn_radius_m)[::-1]
    return way_m


def _turned_from(way_m: Floats, course: Floats, radius_m: float) -> Floats:
    ahead = way_m[-1] - way_m[0]
    if course @ ahead >= 0.0:
        return way_m
    aside = np.array([-course[1], course[0]])
    side = aside if aside @ ahead >= 0.0 else -aside
    station = stations(way_m)
    left = max(int(np.searchsorted(station, radius_m)), 1)  # what is within the turn is not flown
    turn = [
        way_m[0],
        way_m[0] + radius_m * course,
        way_m[0] + radius_m * (course + 2.0 * side),
        way_m[0] + 2.0 * radius_m * side,
    ]
    return np.concatenate([turn, way_m[min(left, len(way_m) - 1) :]])


def _cross(one: Floats, other: Floats) -> Floats:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


@dataclass(frozen=True, slots=True)
class _Search:
    """The control points (n, 2), in km, as an affine function of what is free: `fixed + moves @ free`."""

    task: Task
    fixed: Floats
    moves: Floats
    on_rays: int  # how many of what is free, the last of them, are distances along courses

    @classmethod
    def of(cls, task: Task, controls: int) -> _Search:
        fixed = np.zeros((controls, 2))
        fixed[0], fixed[-1] = task.start_m / _UNIT_M, task.goal_m / _UNIT_M
        first, last = 1 + (task.start_course is not None), controls - 1 - (task.goal_course is not None)
        columns = []
        for control in range(first, last):
            for axis in (0, 1):
                column = np.zeros((controls, 2))
                column[control, axis] = 1.0
                columns.append(column)
        for control, course, sign in ((1, task.start_course, 1.0), (controls - 2, task.goal_course, -1.0)):
            if course is not None:
                fixed[control] = fixed[0] if control == 1 else fixed[-1]
                column = np.zeros((controls, 2))
                column[control] = sign * course
                columns.append(column)
        on_rays = (task.start_course is not None) + (task.goal_course is not None)
        return cls(task, fixed, np.stack(columns, axis=-1), on_rays)

    def begin(self, way_m: Floats) -> Floats:
        """What is free for control points that follow a way at even distances."""
        station = stations(way_m)
        at = np.linspace(0.0, station[-1], len(self.fixed))
        controls = np.stack([np.interp(at, station, way_m[:, axis]) for axis in (0, 1)], axis=-1) / _UNIT_M
        free = np.einsum("nak,na->k", self.moves, controls - self.fixed)
        return np.asarray(np.clip(free, *np.array(self.bounds(), dtype=np.float64).T))

    def bounds(self) -> list[tuple[float, float]]:
        """The box of each control point, in which its curve stays, and rays that point forward."""
        low, high = self.task.box_m / _UNIT_M
        planar = (len(self.fixed) - 2 - self.on_rays) * [(low[0], high[0]), (low[1], high[1])]
        straight = float(np.linalg.norm(self.fixed[-1] - self.fixed[0]))
        even = max(straight, SPAN_M / _UNIT_M) / (len(self.fixed) - DEGREE) / DEGREE  # of a straight way of even speed
        return [*planar, *(self.on_rays * [(0.5 * even, 6.0 * even)])]

    def controls(self, free: Floats) -> Floats:
        """The control points (n, 2), km."""
        return np.asarray(self.fixed + self.moves @ free)

    def bent(self, free: Floats) -> Bent:
        """The curve, checked at many points."""
        controls = self.controls(free)
        basis = clamped_basis(len(controls))
        place = basis.value @ controls * _UNIT_M
        place[0], place[-1] = self.task.start_m, self.task.goal_m
        first, second = basis.first @ controls, basis.second @ controls
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-9)
        bent = np.abs(_cross(first, second)) / speed**3
        turned = np.abs(np.arctan2(_cross(first[:-1], first[1:]), (first[:-1] * first[1:]).sum(axis=-1)))
        step = np.maximum(np.hypot(*np.diff(place, axis=0).T) / _UNIT_M, 1e-9)
        sharpest = max(float(bent.max()), float((turned / step).max()), 1e-9)  # a cusp has no curvature, but turns
        away = float(outside(self.task.areas, resampled(place, _FINE_M)).min()) - 0.5 * _FINE_M - self.task.aside_m
        return Bent(place, _UNIT_M / sharpest, away)

    def cost(self, free: Floats, weight: float, wider: float = 1.0) -> tuple[float, Floats]:
        """J in km, with what too narrow turns and areas cost, and its derivative by what is free."""
        controls = self.controls(free)
        basis = _quadrature(len(controls), _POINTS_BY_AREAS if self.task.areas else _POINTS)
        place, first, second = basis.value @ controls, basis.first @ controls, basis.second @ controls
        speed = np.maximum(np.hypot(first[:, 0], first[:, 1]), 1e-6)
        rate, by_place = self._rate(place, weight, wider)
        narrow, by_first, by_second = self._narrow(first, second, speed, wider)
        rate = rate + weight * narrow
        length = float(np.linalg.norm(self.fixed[-1] - self.fixed[0]))
        share = basis.weight
        total = float((share * (rate * speed + _EVEN / length * speed**2)).sum())
        along = (share * (rate / speed + 2.0 * _EVEN / length))[:, None] * first
        by_controls = basis.value.T @ ((share * speed)[:, None] * by_place)
        by_controls += basis.first.T @ (along + (weight * share * speed)[:, None] * by_first)
        by_controls += basis.second.T @ ((weight * share * speed)[:, None] * by_second)
        return total, np.einsum("nak,na->k", self.moves, by_controls)

    def _rate(self, place: Floats, weight: float, wider: float) -> tuple[Floats, Floats]:
        """The price of a km at places (m, 2) km, (m,), and its derivative by the place (m, 2)."""
        task = self.task
        density, steep = task.threats.density_and_gradient(place * _UNIT_M)
        rate, by_place = 1.0 + task.lambda_m4 * density, task.lambda_m4 * _UNIT_M * steep
        aside = task.aside_m + max(
            _ASIDE_M * (min(wider, _SEARCHES[-1][1]) - 1.0) / (_SEARCHES[-1][1] - 1.0), _LEAST_ASIDE_M
        )
        for area in task.areas:
            away, outward = area.distance(place * _UNIT_M)
            inside = np.maximum(aside - away, 0.0) / _UNIT_M
            rate = rate + _WALL * weight * inside**2
            by_place = by_place - 2.0 * _WALL * weight * inside[:, None] * outward
        return rate, by_place

    def _narrow(self, first: Floats, second: Floats, speed: Floats, wider: float) -> tuple[Floats, Floats, Floats]:
        """What turns narrower than allowed cost a km (m,), and its derivatives by the curve's two (m, 2)."""
        radius = self.task.turn_radius_m * wider / _UNIT_M
        cross = _cross(first, second)
        bent = radius * cross / speed**3
        over = np.maximum(np.abs(bent) - 1.0, 0.0)
        slope = 2.0 * over * np.sign(bent) * radius / speed**3
        across = np.stack([second[:, 1], -second[:, 0]], axis=-1) - (3.0 * cross / speed**2)[:, None] * first
        return (
            over**2,
            slope[:, None] * across,
            slope[:, None] * np.stack([-first[:, 1], first[:, 0]], axis=-1),
        )
