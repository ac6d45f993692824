"""The errors that evidence tells (`registration_evidence`): each aircraft's own error eliminated, its size found on the way.

How large own errors are is found from how aircraft differ (expectation and maximisation). What geometry does not tell is
flagged: a parameter with a part in a direction that is known 30 times worse than the best. Source: 004 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.registration_evidence import EACH, Evidence, Ints, Pairs

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COMMON_SIGMA_M = 30.0  # prior of the position sources' common error, an axis
NO_PRIOR_M = 1e5
# Priors of radars so wide that they only keep the equations solvable; and of their clocks, which are off by some frames of a
# scan, not by seconds: of few flights, all inbound, lateness would else be what is really the position sources' own errors.
RADAR_SIGMA = np.array([2000.0, 0.1, 0.1, 0.15])
_OWN_LEAST_M = 1.0
_OWN_ROUNDS = 12
_OWN_SETTLED = 3e-3
_OWN_BOUND = 3.0  # an own error larger than this (sigmas) pulls no more than one at the bound (Huber)
_OWN_FREEDOM = 3.0  # the prior of own errors' size weighs as much as one aircraft
_WEAK = 1.0 / 30.0**2  # of the largest eigenvalue: geometry does not tell what lies along such a direction
_SHARE = 0.2  # a parameter with more than this of a weak direction is not observable


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Errors of r radars (r, 4) and the common one (3,), by which they say too much; their covariance (p, p).

    `own_sigma_m`: the size of own errors, an axis. `place_m`: (k, 3) of each aircraft the whole error of its position source,
    with its covariance (k, 3, 3), and that with radars' errors and the common one, `across` (k, p, 3). `observable`: (r, 4)
    whether geometry tells it. `prior_chi_square`: of the common error as the pairs alone tell it against its prior, 3 degrees.
    """

    radars: tuple[int, ...]
    error: Floats
    common_m: Floats
    covariance: Floats
    own_sigma_m: float
    observable: Bools
    condition: float
    prior_chi_square: float
    aircraft: dict[str, int]
    place_m: Floats
    place_variance: Floats
    across: Floats

    @property
    def sigma(self) -> Floats:
        """Of the radars' errors, (r, 4)."""
        sigma = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.asarray(sigma[:-3].reshape(-1, EACH))

    @property
    def common_sigma_m(self) -> Floats:
        """Of the common error, (3,)."""
        return np.sqrt(np.maximum(np.diagonal(self.covariance)[-3:], 0.0))

    def left(self, pairs: Pairs) -> tuple[Floats, Floats]:
        """How far pairs are (n, 3) from what is expected, each aircraft's own error included; and the variance of that.

        Of a radar that was not heard before nothing is expected: its variance is infinite.
        """
        radar_of = {radar: place for place, radar in enumerate(self.radars)}
        radar = np.array([radar_of.get(one, -1) for one in pairs.radar], np.intp)
        who = np.array([self.aircraft.get(one, -1) for one in pairs.aircraft], np.intp)
        rows, known = pairs.rows(), radar >= 0
        error = np.concatenate([self.error[radar], np.concatenate([self.place_m, self.common_m[None]])[who]], axis=1)
        variance = np.nan_to_num(pairs.sigma, nan=1.0) ** 2
        variance += (rows @ self._spread(radar, who) * rows).sum(axis=-1)
        return pairs.off - (rows * error[:, None, :]).sum(axis=-1), np.where(known[:, None], variance, math.inf)

    def _spread(self, radar: NDArray[np.intp], who: NDArray[np.intp]) -> Floats:
        """How well radars' errors and the places of aircraft (-1: one not seen before) are known together, (n, 7, 7)."""
        unknown = self.covariance[-3:, -3:] + np.eye(3) * self.own_sigma_m**2
        of_radar = EACH * radar[:, None] + np.arange(EACH)
        across = np.concatenate([self.across, self.covariance[None, :, -3:]])[who[:, None], of_radar]
        spread = np.empty((len(radar), EACH + 3, EACH + 3))
        spread[:, :EACH, :EACH] = self.covariance[of_radar[:, :, None], of_radar[:, None, :]]
        spread[:, :EACH, EACH:], spread[:, EACH:, :EACH] = across, across.swapaxes(-1, -2)
        spread[:, EACH:, EACH:] = np.concatenate([self.place_variance, unknown[None]])[who]
        return spread


def solved(
    evidence: Evidence, own_sigma_m: float, common_sigma_m: float = COMMON_SIGMA_M, before: Solution | None = None
) -> Solution | None:
    """The errors that the evidence tells; None without evidence.

    `own_sigma_m`: what own errors are expected to be, an axis. `before`: what was found with a little less of it, to begin from.
    """
    if not evidence.radars:
        return None
    equations = _Equations.of(evidence)
    prior = np.concatenate([np.tile(RADAR_SIGMA**-2.0, len(evidence.radars)), np.full(3, common_sigma_m**-2.0)])
    own = own_sigma_m if before is None else before.own_sigma_m
    wide = np.ones(len(equations.aircraft))  # of aircraft that are further off than the others: their own errors' size
    for _ in range(_OWN_ROUNDS):
        apart = equations.apart(own * wide)
        information, vector = equations.without_own(own * wide, apart)
        error, covariance = _inverted(information + np.diag(prior), vector)
        place, variance, across = equations.places(error, covariance, own * wide, apart)
        off = place - error[-3:]
        unsure = _trace(variance) + _trace(covariance[-3:, -3:]) - 2.0 * _trace(across[:, -3:, :])
        square = ((off * off).sum(axis=1) + unsure) / wide**2
        mean = (_OWN_FREEDOM * own_sigma_m**2 + float(square.sum())) / (_OWN_FREEDOM + 3.0 * len(place))
        renewed = max(math.sqrt(mean), _OWN_LEAST_M)
        wide = np.sqrt(np.maximum(np.sqrt((off * off).sum(axis=1)) / (_OWN_BOUND * renewed), 1.0))
        done, own = abs(renewed - own) < _OWN_SETTLED * own, renewed
        if done:
            break
    observable, condition = _told_by_geometry(information)
    return Solution(
        evidence.radars,
        error[:-3].reshape(-1, EACH),
        error[-3:],
        covariance,
        own,
        observable[:-3].reshape(-1, EACH),
        condition,
        _against_prior(information, vector, prior, common_sigma_m),
        {name: row for row, name in enumerate(equations.aircraft)},
        place,
        variance,
        across,
    )


def folded(evidence: Evidence, before: int, own_sigma_m: float) -> Evidence:
    """The evidence with aircraft that had no pair since an instant folded into one sum, their own errors eliminated."""
    latest: dict[str, int] = {}
    for (aircraft, _), last in zip(evidence.links, evidence.last.tolist(), strict=True):
        latest[aircraft] = max(last, latest.get(aircraft, last))
    gone = [place for place, (aircraft, _) in enumerate(evidence.links) if latest[aircraft] < before]
    if not gone:
        return evidence
    stays = sorted(set(range(len(evidence.links))) - set(gone))
    left, rest = _some(evidence, gone), _some(evidence, stays)
    equations = _Equations.of(left)
    own_m = np.full(len(equations.aircraft), own_sigma_m)
    total, vector = equations.without_own(own_m, equations.apart(own_m))
    return replace(rest, folded=(total, vector))


def against_past(evidence: Evidence, own_sigma_m: float, common_sigma_m: float = COMMON_SIGMA_M) -> dict[int, float]:
    """Chi-square, 4 degrees, of each radar's errors as present aircraft tell them against what was folded or remembered.

    Only of radars of which both tell something.
    """
    equations = _Equations.of(evidence)
    past, nothing = evidence.folded, (np.zeros_like(evidence.folded[0]), np.zeros_like(evidence.folded[1]))
    own_m = np.full(len(equations.aircraft), own_sigma_m)
    present = replace(equations, folded=nothing).without_own(own_m, equations.apart(own_m))
    prior = np.concatenate([np.tile(RADAR_SIGMA**-2.0, len(evidence.radars)), np.full(3, common_sigma_m**-2.0)])
    (now, unsure), (then, before) = (_inverted(told + np.diag(prior), by) for told, by in (present, past))
    found = {}
    for radar in evidence.radars:
        place = evidence.place_of(radar)
        if min(np.diagonal(one)[place].max() for one, _ in (present, past)) > 0.0:
            off, spread = now[place] - then[place], unsure[place, place] + before[place, place]
            found[radar] = float(off @ np.linalg.solve(spread, off))
    return found


def _some(evidence: Evidence, places: list[int]) -> Evidence:
    return replace(
        evidence,
        links=tuple(evidence.links[place] for place in places),
        information=evidence.information[places],
        vector=evidence.vector[places],
        last=evidence.last[places],
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """Of k aircraft: of all radars' errors (k, q, q), (k, q); of its place (k, 3, 3), (k, 3); of both (k, q, 3)."""

    aircraft: tuple[str, ...]
    radars: Floats
    by_radars: Floats
    cross: Floats
    place: Floats
    by_place: Floats
    folded: tuple[Floats, Floats]

    @classmethod
    def of(cls, evidence: Evidence) -> _Equations:
        """Links put together by aircraft."""
        names = tuple(dict.fromkeys(aircraft for aircraft, _ in evidence.links))
        row_of = {name: row for row, name in enumerate(names)}
        rows: Ints = np.array([row_of[aircraft] for aircraft, _ in evidence.links], np.int64)
        size = EACH * len(evidence.radars)
        firsts = np.array([evidence.radars.index(radar) * EACH for _, radar in evidence.links], np.int64)
        columns = firsts[:, None] + np.arange(EACH)
        radars, by_radars = np.zeros((len(names), size, size)), np.zeros((len(names), size))
        cross = np.zeros((len(names), size, 3))
        place, by_place = np.zeros((len(names), 3, 3)), np.zeros((len(names), 3))
        # Each link is another (aircraft, radar), so that its radar's blocks are its own; places have several.
        radars[rows[:, None, None], columns[:, :, None], columns[:, None, :]] = evidence.information[:, :EACH, :EACH]
        by_radars[rows[:, None], columns] = evidence.vector[:, :EACH]
        cross[rows[:, None], columns] = evidence.information[:, :EACH, EACH:]
        np.add.at(place, rows, evidence.information[:, EACH:, EACH:])
        np.add.at(by_place, rows, evidence.vector[:, EACH:])
        return cls(names, radars, by_radars, cross, place, by_place, evidence.folded)

    def apart(self, own_m: Floats) -> Floats:
        """The covariance of each place for given other errors, (k, 3, 3), own errors being so large (k,)."""
        return np.asarray(np.linalg.inv(self.place + np.eye(3) * (own_m**-2.0)[:, None, None]))

    def without_own(self, own_m: Floats, apart: Floats) -> tuple[Floats, Floats]:
        """Information and vector of radars' errors and the common one, own errors of this size (k,) eliminated."""
        gain, weight = self.cross @ apart, (own_m**-2.0)[:, None, None]
        total, vector = self.folded[0].copy(), self.folded[1].copy()
        total[:-3, :-3] += (self.radars - gain @ self.cross.swapaxes(-1, -2)).sum(axis=0)
        total[:-3, -3:] += (weight * gain).sum(axis=0)
        total[-3:, :-3] = total[:-3, -3:].T
        shared = (weight * (apart @ self.place)).sum(axis=0)
        total[-3:, -3:] += 0.5 * (shared + shared.T)
        vector[:-3] += (self.by_radars - (gain @ self.by_place[..., None])[..., 0]).sum(axis=0)
        vector[-3:] += (weight * (apart @ self.by_place[..., None]))[..., 0].sum(axis=0)
        return total, vector

    def places(self, error: Floats, covariance: Floats, own_m: Floats, apart: Floats) -> tuple[Floats, Floats, Floats]:
        """The whole error of each aircraft's source (k, 3), its covariance (k, 3, 3), and that with all others (k, p, 3)."""
        weight = (own_m**-2.0)[:, None]
        by_radars = (self.cross.swapaxes(-1, -2) @ error[:-3, None])[..., 0]
        place = (apart @ (self.by_place - by_radars + error[-3:] * weight)[..., None])[..., 0]
        back = np.concatenate([-(self.cross @ apart).swapaxes(-1, -2), apart * weight[..., None]], axis=-1)
        across = (back @ covariance).swapaxes(-1, -2)
        return place, apart + back @ across, across


def _trace(matrices: Floats) -> Floats:
    """The sums of the diagonals of (..., 3, 3)."""
    return np.asarray(np.trace(matrices, axis1=-2, axis2=-1))


def _inverted(information: Floats, vector: Floats) -> tuple[Floats, Floats]:
    """Solution and covariance, by the column-scaled equations."""
    scale = 1.0 / np.sqrt(np.diagonal(information))
    covariance = np.linalg.inv(information * scale[:, None] * scale) * scale[:, None] * scale
    covariance = 0.5 * (covariance + covariance.T)
    return covariance @ vector, covariance


def _told_by_geometry(information: Floats) -> tuple[Bools, float]:
    """Whether each parameter is told without priors, and the condition of the column-scaled equations."""
    diagonal = np.diagonal(information)
    told = diagonal > 0.0
    scale = np.where(told, 1.0 / np.sqrt(np.where(told, diagonal, 1.0)), 0.0)
    values, axes = np.linalg.eigh(information * scale[:, None] * scale)
    most = max(float(values[-1]), 1e-300)
    weak = values < most * _WEAK
    blurred = ((np.abs(axes) > _SHARE) & weak[None, :]).any(axis=1)
    return told & ~blurred, math.sqrt(most / max(float(values[0]), 1e-16 * most))


def _against_prior(information: Floats, vector: Floats, prior: Floats, common_sigma_m: float) -> float:
    """Chi-square, 3 degrees, of the common error as the pairs alone tell it."""
    alone = prior.copy()
    alone[-3:] = NO_PRIOR_M**-2.0
    error, covariance = _inverted(information + np.diag(alone), vector)
    spread = covariance[-3:, -3:] + np.eye(3) * common_sigma_m**2
    return float(error[-3:] @ np.linalg.solve(spread, error[-3:]))
