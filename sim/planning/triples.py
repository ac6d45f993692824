"""Local optima of triples of threats: the point in their triangle that an objective likes best, for all triples at once.

    literal     least sum of the distances (what is printed, "as small as possible": it draws near to radars)
    threat      least sum of 1/d^4
    clearance   largest least distance

`anneal` searches as the paper does: simulated annealing, Boltzmann's constant 1, 60 inner loops, cooling by 0.99.
`exact` finds the same on grids that shrink about the best point, as a yardstick. Source: 002-3 1.1, 2.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Objective = Literal["literal", "threat", "clearance"]
OBJECTIVES: tuple[Objective, ...] = ("threat", "clearance", "literal")

BOLTZMANN, INNER_LOOPS, COOLING = 1.0, 60, 0.99
CHAINS = 4  # annealings of each triple; two optima that are nearly equal are told apart by trying both
_HOTTEST = 0.1  # in units of the energy in the triangle's centre
_LONGEST, _SHORTEST = 0.5, 2e-3  # steps, as shares of a side, when it is hottest and coldest: 20 m of 10 km
_NEAREST = 1e-18  # square of the distance to a threat, as a share of the triangle's
_STARTS, _GRID, _ZOOMS, _SHRINKS = 4, 11, 20, 0.5


def triples(threats_m: Floats) -> Floats:
    """Every three (k, 3, 2) of the threats (n, 2): of eight, 56."""
    return threats_m[list(combinations(range(len(threats_m)), 3))]


def energy(objective: Objective, square: Floats) -> Floats:
    """What is to be least (...), of the squares of the distances to three threats (3, ...)."""
    if objective == "literal":
        return np.asarray(np.sqrt(square).sum(axis=0))
    if objective == "threat":
        return np.asarray((np.maximum(square, _NEAREST) ** -2).sum(axis=0))
    return -np.asarray(np.sqrt(square.min(axis=0)))


def anneal(triangles_m: Floats, objective: Objective, chance: np.random.Generator) -> Floats:
    """The best points (k, 2) that annealings found in triangles (k, 3, 2).

    A move is one step in any direction, cut off where it would leave the triangle; steps shrink with the temperature, and it
    ends when they are short. Energies are relative to the triangle's centre, so that a Boltzmann
    constant of 1 means the same to all. The best point that any of `CHAINS` annealings came by is the answer.
    """
    shape = _Triangles.of(np.repeat(triangles_m, CHAINS, axis=0))
    share = np.full((2, len(shape.x[0])), 1.0 / 3.0)
    now = energy(objective, shape.squares(share))
    unit = BOLTZMANN * np.abs(now)
    best, least = share, now
    temperature = _HOTTEST
    while temperature > _HOTTEST * _SHORTEST / _LONGEST:
        moves = _LONGEST * temperature / _HOTTEST * chance.standard_normal((INNER_LOOPS, 2, len(now)))
        rises = temperature * unit * chance.standard_exponential((INNER_LOOPS, len(now)))
        for move, rise in zip(moves, rises, strict=True):
            tried = np.maximum(share + move, 0.0)
            tried /= np.maximum(tried[0] + tried[1], 1.0)
            there = energy(objective, shape.squares(tried))
            taken = there <= now + rise  # as likely as exp(-rise / (k T))
            share, now = np.where(taken, tried, share), np.where(taken, there, now)
            better = there < least
            best, least = np.where(better, tried, best), np.where(better, there, least)
        temperature *= COOLING
    chosen = least.reshape(-1, CHAINS).argmin(axis=1) + CHAINS * np.arange(len(triangles_m))
    return np.asarray(shape.places(best)[chosen])


def exact(triangles_m: Floats, objective: Objective) -> Floats:
    """The optimum (k, 2) of each triangle (k, 3, 2), within a centimetre, without chance."""
    return _clearest(triangles_m) if objective == "clearance" else _smallest(triangles_m, objective)


def _smallest(triangles_m: Floats, objective: Objective) -> Floats:
    """By grids about the best point, each half as large, from everywhere in the triangle."""
    shape = _Triangles.of(np.repeat(triangles_m, _STARTS**2, axis=0))
    begin, line = (np.arange(_STARTS) + 0.5) / _STARTS, np.linspace(-0.5, 0.5, _GRID)
    starts, offsets = (np.stack(np.meshgrid(one, one, indexing="ij")).reshape(2, -1) for one in (begin, line))
    best, width = np.tile(starts, len(triangles_m))[:, None], 1.5 / _STARTS
    for _ in range(_ZOOMS):
        tried = np.clip(best + width * offsets[..., None], 0.0, 1.0)
        surplus = np.maximum(tried.sum(axis=0) - 1.0, 0.0)  # laid onto the third side, on which an optimum may lie
        tried = np.clip(tried - 0.5 * surplus, 0.0, 1.0)
        chosen = energy(objective, shape.squares(tried)).argmin(axis=0)
        best = np.take_along_axis(tried, np.broadcast_to(chosen, (2, 1, len(chosen))), axis=1)
        width *= _SHRINKS
    least = energy(objective, shape.squares(best[:, 0])).reshape(-1, _STARTS**2).argmin(axis=1)
    return np.asarray(shape.places(best[:, 0])[least + _STARTS**2 * np.arange(len(triangles_m))])


def _clearest(triangles_m: Floats) -> Floats:
    """The centre of the largest circle about a point of the triangle that holds no corner.

    It is the circumcentre, or where a perpendicular bisector of two corners meets a side.
    """
    triangles = triangles_m[:, None]
    first, second, third = (triangles_m[:, corner] for corner in range(3))
    found = [_meeting(first, second, first, third)]
    for one, other, opposite in ((first, second, third), (second, third, first), (third, first, second)):
        found.append(0.5 * (one + other))
        found += [_on_side(one, other, end, opposite) for end in (one, other)]
    places = np.stack(found, axis=1)
    sides = np.roll(triangles, -1, axis=2) - triangles
    aside = places[:, :, None] - triangles
    left = sides[..., 0] * aside[..., 1] - sides[..., 1] * aside[..., 0]
    turn = np.sign(left.sum(axis=-1, keepdims=True))
    rounding = 1e-9 * (sides**2).sum(axis=-1)
    inside = np.isfinite(places).all(axis=-1) & (left * turn >= -rounding).all(axis=-1)
    clear = np.where(inside, (aside**2).sum(axis=-1).min(axis=-1), -np.inf)
    return np.asarray(places[np.arange(len(places)), clear.argmax(axis=1)])


def _meeting(one: Floats, other: Floats, third: Floats, fourth: Floats) -> Floats:
    """Where the bisector of two points meets that of two others (k, 2)."""
    across = np.stack([other - one, fourth - third], axis=1)
    wanted = 0.5 * np.stack([(other**2 - one**2).sum(axis=-1), (fourth**2 - third**2).sum(axis=-1)], axis=1)
    return np.asarray(np.linalg.solve(across, wanted[..., None])[..., 0])


def _on_side(one: Floats, other: Floats, end: Floats, opposite: Floats) -> Floats:
    """Where the bisector of two corners meets the side from one end of theirs to the opposite corner (k, 2)."""
    across, along = other - one, opposite - end
    with np.errstate(divide="ignore", invalid="ignore"):
        share = ((0.5 * (one + other) - end) * across).sum(axis=-1) / (along * across).sum(axis=-1)
        return np.asarray(end + share[:, None] * along)


@dataclass(frozen=True, slots=True)
class _Triangles:
    """Triangles as their first corner and the sides from there, in units of the mean side `scale_m` (k,).

    `x`, `y`: the corners (3, k), the first one at 0; `origin_m` (k, 2).
    """

    origin_m: Floats
    scale_m: Floats
    x: Floats
    y: Floats

    @classmethod
    def of(cls, triangles_m: Floats) -> _Triangles:
        sides = triangles_m - np.roll(triangles_m, 1, axis=1)
        scale = np.hypot(sides[..., 0], sides[..., 1]).mean(axis=1)
        corners = (triangles_m - triangles_m[:, :1]) / scale[:, None, None]
        x, y = np.ascontiguousarray(corners.transpose(2, 1, 0))
        return cls(triangles_m[:, 0], scale, x, y)

    def squares(self, share: Floats) -> Floats:
        """Squares of the distances (3, ..., k) to the corners from shares (2, ..., k) of the sides."""
        x = share[0] * self.x[1] + share[1] * self.x[2]
        y = share[0] * self.y[1] + share[1] * self.y[2]
        between = (3, *(1,) * (share.ndim - 2), -1)
        across, along = x - self.x.reshape(between), y - self.y.reshape(between)
        return np.asarray(across * across + along * along)

    def places(self, share: Floats) -> Floats:
        """Points (k, 2) in m."""
        x, y = (share[0] * one[1] + share[1] * one[2] for one in (self.x, self.y))
        return np.asarray(self.origin_m + self.scale_m[:, None] * np.stack([x, y], axis=-1))
