"""Registration: the systematic errors of radars and of the position source, from pairs of one aircraft at one time.

Each measures with constant errors, true = measured + error. A pair tells that both mean the same place; linearised, that is
three equations in the errors. All pairs together are a least-squares problem, solved again at the corrected place.

Parameters, in this order: of each radar its range m, azimuth rad, elevation rad and, where it is asked for, its time s; then the
position source's longitude rad, latitude rad, height m. Azimuth is clockwise from north here (004's), never 003's.
Source: 004 2, eq 1 to 12.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.registration_equations import (
    LEAST_VALUE,
    PRIOR_SIGMA_M,
    Equations,
    Method,
    Pairs,
    Solution,
    equations_at,
    misfit_at,
    solved,
)
from gateway.estimators.registration_frames import per_metre

__all__ = ["LITERAL", "PRIOR_SIGMA_M", "Errors", "Method", "Pairs", "register"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_ROBUST_ROUNDS, _LINEAR_ROUNDS = 12, 4
_FREE_ROUNDS = 3
_NO_GAIN = 0.01  # of chi-square: nothing is to be gained by going on
_SETTLED = 1e-3  # sigmas: a round that moves nothing by more is the last
_NEAR = 3.0  # sigmas
_WEAK = 1.0 / 30.0  # of the largest singular value: geometry does not tell what lies along such a direction
_SHARE = 0.2  # a parameter with more than this of a weak direction is not observable


@dataclass(frozen=True, slots=True)
class Errors:
    """What was found: p parameters (see above), or as many as were asked for, of each case (...).

    `condition`: of the column-scaled equations without the prior. `observable`: (..., p) whether the geometry tells a
    parameter. `chi_square`: of the residuals, with `freedom` degrees; `prior_chi_square`: of the position source's error as the
    pairs alone tell it against the prior, 3 degrees; NaN without a prior. `weight`: (..., n) what each pair counted.
    """

    radar: Floats  # (..., r, 3)
    time_s: Floats  # (..., r); NaN where it was not asked for
    source: Floats  # (..., 3) longitude rad, latitude rad, height m
    covariance: Floats  # (..., p, p)
    condition: Floats
    observable: Bools
    chi_square: Floats
    freedom: int
    prior_chi_square: Floats
    weight: Floats

    @property
    def sigma(self) -> Floats:
        """Of each parameter, (..., p)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


LITERAL = Method("ecef", "none", 1, None, robust=False)


def register(pairs: Pairs, method: Method = Method()) -> Errors:
    """The errors that bring the pairs together best.

    Where it is robust, rounds go on until no error moves by a thousandth of its sigma. Raises ValueError for fewer than two
    pairs, and where times are asked for without velocities.
    """
    count = pairs.polar.shape[-2]
    if count < 2:
        raise ValueError("registration needs at least two pairs")
    if method.with_time and pairs.velocity_mps is None:
        raise ValueError("a radar's time offset can only be found with velocities")
    if method.own_sigma_m is not None and pairs.aircraft is None:
        raise ValueError("own errors of aircraft can only be told apart where the pairs say whose they are")
    cases = pairs.polar.shape[:-2]
    found = np.zeros((*cases, len(pairs.radars) * (4 if method.with_time else 3) + 3))
    weight = np.ones((*cases, count))
    equations = None
    for turn in range(method.rounds):
        equations = equations_at(pairs, found, method)
        weight = equations.huber() if method.robust and turn else weight
        found = found + solved(equations, found, weight, pairs, method).step
    equations = equations_at(pairs, found, method, equations if method.robust and method.rounds > 1 else None)
    for _ in range(_LINEAR_ROUNDS if method.robust else 0):
        moved, weight, is_near = _robustly(equations, found, pairs, method)
        found = found + moved
        if is_near:  # within what noise makes the equations are straight
            equations = equations.moved(moved)
            break
        equations = equations_at(pairs, found, method, equations)
    return _told(equations, pairs, found, weight, method)


def _robustly(equations: Equations, found: Floats, pairs: Pairs, method: Method) -> tuple[Floats, Floats, bool]:
    """How far the errors move while pairs are weighed by how far off they are, in these equations; the weights; and whether
    that is so little that the equations hold there too.
    """
    moved = np.zeros_like(found)
    for _ in range(_ROBUST_ROUNDS):
        there = equations.moved(moved)
        weight = there.huber()
        solution = solved(there, found + moved, weight, pairs, method)
        moved = moved + solution.step
        if bool((np.abs(solution.step) <= _SETTLED * solution.sigma).all()):
            break
    return moved, weight, bool((np.abs(moved) <= _NEAR * solution.sigma).all())


def _told(equations: Equations, pairs: Pairs, found: Floats, weight: Floats, method: Method) -> Errors:
    free, bound = (
        solved(equations, found, weight, pairs, replace(method, prior_sigma_m=None)),
        solved(equations, found, weight, pairs, method),
    )
    radars, each = len(pairs.radars), 4 if method.with_time else 3
    of_radar = found[..., :-3].reshape(*found.shape[:-1], radars, each)
    values = free.values
    weak = values < values[..., :1] * _WEAK
    blurred = (np.abs(free.axes) > _SHARE) & weak[..., None]
    # Unweighted equations are in radians and metres; their misfit says nothing.
    whitened = replace(method, weighting="whitened")
    misfit = free.square if method.weighting == "whitened" else misfit_at(pairs, found, weight, whitened)
    return Errors(
        radar=of_radar[..., :3],
        time_s=of_radar[..., 3] if method.with_time else np.full(of_radar.shape[:-1], np.nan),
        source=found[..., -3:],
        covariance=bound.covariance,
        condition=values[..., 0] / np.maximum(values[..., -1], LEAST_VALUE * values[..., 0]),
        observable=np.asarray(~blurred.any(axis=-2)),
        chi_square=misfit,
        freedom=3 * pairs.polar.shape[-2] - found.shape[-1],
        prior_chi_square=_against_prior(equations, free, misfit, pairs, found, weight, method),
        weight=weight,
    )


def _against_prior(
    equations: Equations, free: Solution, misfit: Floats, pairs: Pairs, found: Floats, weight: Floats, method: Method
) -> Floats:
    """How much worse the pairs fit because of the prior, and the prior because of them: chi-square of 3 degrees, if it is right.

    Sums of squares, not a distance in parameters: where geometry tells little, those are hundreds of metres off and bent.
    """
    if method.prior_sigma_m is None or method.weighting == "none":
        return np.full(found.shape[:-1], np.nan)
    sigmas = found[..., -3:] / (per_metre(pairs.geodetic) * method.prior_sigma_m)
    bound = misfit + (sigmas * sigmas).sum(axis=-1)
    alone, least = replace(method, prior_sigma_m=None), bound
    for _ in range(_FREE_ROUNDS):
        if bool((free.gained < _NO_GAIN).all()):
            break
        found = found + free.step
        free = solved(equations_at(pairs, found, alone, equations), found, weight, pairs, alone)
        least = np.minimum(least, free.square)
    return np.asarray(bound - least)
