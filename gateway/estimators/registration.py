"""Registration: the systematic errors of radars and of the position source, from pairs of one aircraft at one time.

Each measures with constant errors, true = measured + error. A pair tells that both mean the same place; linearised, that is
three equations in the errors. All pairs together are a least-squares problem, solved again at the corrected place.

Parameters, in this order: of each radar its range m, azimuth rad, elevation rad and, where it is asked for, its time s; then the
position source's longitude rad, latitude rad, height m. Azimuth is clockwise from north here (004's), never 003's.
Source: 004 2, eq 1 to 12.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.registration_frames import System, difference, per_metre

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Bools = NDArray[np.bool_]
Weighting = Literal["none", "whitened"]

PRIOR_SIGMA_M = 30.0  # of the position source's error, an axis
HUBER = 2.8  # a pair further off than this (sigmas of three components, 95 %) counts less
_ROBUST_ROUNDS = 12
_FREE_ROUNDS = 3
_LEAST_VALUE = 1e-13  # of the largest singular value: what is below is rounding
_SETTLED = 1e-3  # sigmas: a round that moves nothing by more is the last
_WEAK = 1.0 / 30.0  # of the largest singular value: geometry does not tell what lies along such a direction
_SHARE = 0.2  # a parameter with more than this of a weak direction is not observable


@dataclass(frozen=True, slots=True)
class Pairs:
    """n pairs of r radars with a position source, at the same times; leading axes (...) are cases, each for itself.

    `radars`: (r, 3) latitude rad, longitude rad, height m. `which`: (n,) the radar of each pair. `polar`: (..., n, 3) range m,
    azimuth rad clockwise from north, elevation rad, with `polar_sigma` (n, 3). `geodetic`: (..., n, 3) longitude rad,
    latitude rad, height m, with `source_sigma_m` (n, 3) east, north, up. `velocity_mps`: (n, 3) earth-centred; needed only
    for the radars' times. `aircraft`: (n,) which one a pair is of; needed only for their own errors. `level`: (r, 2) latitude
    and longitude rad of the place whose horizon each radar is level with; None: its own.
    """

    radars: Floats
    which: Ints
    polar: Floats
    polar_sigma: Floats
    geodetic: Floats
    source_sigma_m: Floats
    velocity_mps: Floats | None = None
    aircraft: Ints | None = None
    level: Floats | None = None


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


@dataclass(frozen=True, slots=True)
class Method:
    """How the equations are weighted and solved. The default is what measures best; `LITERAL` is as printed.

    `own_sigma_m`: beside the source's error, which all aircraft share, each has one of its own of this size, an axis; it does
    not become smaller the longer one flight is watched.
    """

    system: System = "ecef"
    weighting: Weighting = "whitened"
    rounds: int = 2
    prior_sigma_m: float | None = PRIOR_SIGMA_M
    robust: bool = True
    with_time: bool = False
    own_sigma_m: float | None = None


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
    radars = len(pairs.radars)
    each = 4 if method.with_time else 3
    found = np.zeros((*cases, radars * each + 3))
    weight = np.ones((*cases, count))
    solved = _solve(pairs, found, weight, method)
    for turn in range(1, max(method.rounds, _ROBUST_ROUNDS if method.robust else 0) + 1):
        found = found + solved.step
        if turn >= method.rounds and (
            not method.robust or bool((np.abs(solved.step) <= _SETTLED * solved.sigma).all())
        ):
            break
        if method.robust:
            weight = _weights(pairs, found, method)
        solved = _solve(pairs, found, weight, method)
    return _told(pairs, found, weight, method)


@dataclass(frozen=True, slots=True)
class _Solution:
    step: Floats  # (..., p)
    covariance: Floats
    values: Floats  # (..., k) singular values of the column-scaled equations
    axes: Floats  # (..., k, p) their directions, in scaled parameters

    @property
    def sigma(self) -> Floats:
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def _solve(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> _Solution:
    """The next step from the errors found so far."""
    table, known = _table(pairs, found, weight, method)
    solution = _least_squares(table, known)
    if method.weighting == "none":  # the equations do not say how good they are; their residuals do
        left = known - (table @ solution.step[..., None])[..., 0]
        spread = (left * left).sum(axis=-1) / max(known.shape[-1] - table.shape[-1], 1)
        return replace(solution, covariance=solution.covariance * spread[..., None, None])
    return solution


def _table(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> tuple[Floats, Floats]:
    """All equations (..., m, p) and what they should give (..., m), the prior and aircraft's own errors worked in."""
    rows, off = _equations(pairs, found, method)
    root = np.sqrt(weight)[..., None]
    rows, off = rows * root[..., None], off * root
    size, cases = rows.shape[-1], rows.shape[:-3]
    table, known = rows.reshape(*cases, -1, size), off.reshape(*cases, -1)
    if method.own_sigma_m is not None:
        table, known = _without_own(table, known, rows[..., -3:], pairs, method.own_sigma_m)
    if method.prior_sigma_m is not None:
        prior = np.zeros((*cases, 3, size))
        prior[..., :, -3:] = np.eye(3) / (method.prior_sigma_m * per_metre(pairs.geodetic))[..., None, :]
        table = np.concatenate([table, prior], axis=-2)
        known = np.concatenate([known, -(prior @ found[..., None])[..., 0]], axis=-1)
    return table, known


def _without_own(
    table: Floats, known: Floats, by_source: Floats, pairs: Pairs, sigma_m: float
) -> tuple[Floats, Floats]:
    """Equations without aircraft's own errors: three unknowns each, in sigmas about nothing, taken out by a turn (QR)."""
    assert pairs.aircraft is not None
    count = 3 * (int(pairs.aircraft.max()) + 1)
    own = np.zeros((*by_source.shape[:-1], count))
    scaled = by_source * (sigma_m * per_metre(pairs.geodetic))[..., None, None, :]
    for one in range(count // 3):
        mine = pairs.aircraft == one
        own[..., mine, :, 3 * one : 3 * one + 3] = scaled[..., mine, :, :]
    cases, size = table.shape[:-2], table.shape[-1]
    above = np.concatenate([own.reshape(*cases, -1, count), table, known[..., None]], axis=-1)
    below = np.broadcast_to(np.eye(count, count + size + 1), (*cases, count, count + size + 1))
    triangle = np.asarray(np.linalg.qr(np.concatenate([above, below], axis=-2), mode="r"))
    left = triangle[..., count:, count:]
    return left[..., :-1], left[..., -1]


def _least_squares(table: Floats, known: Floats) -> _Solution:
    """By singular values of the column-scaled equations: normal equations would square a condition of 1e7 and more."""
    scale = np.sqrt((table * table).sum(axis=-2))
    scale = np.where(scale > 0.0, scale, 1.0)
    left, values, axes = np.linalg.svd(table / scale[..., None, :], full_matrices=False)
    inverse = 1.0 / np.maximum(values, _LEAST_VALUE * values[..., :1])
    turned = (left.swapaxes(-1, -2) @ known[..., None])[..., 0] * inverse
    step = (axes.swapaxes(-1, -2) @ turned[..., None])[..., 0] / scale
    half = axes.swapaxes(-1, -2) * inverse[..., None, :]
    covariance = (half @ half.swapaxes(-1, -2)) / (scale[..., :, None] * scale[..., None, :])
    return _Solution(step, covariance, values, axes)


def _equations(pairs: Pairs, found: Floats, method: Method) -> tuple[Floats, Floats]:
    """Rows (..., n, 3, p) and what they should give (..., n, 3), at the errors found so far."""
    radars, each = len(pairs.radars), 4 if method.with_time else 3
    of_radar = found[..., :-3].reshape(*found.shape[:-1], radars, each)
    polar = pairs.polar + of_radar[..., pairs.which, :3]
    geodetic = pairs.geodetic + found[..., None, -3:]
    level = pairs.radars[:, :2] if pairs.level is None else pairs.level
    made = difference(method.system, pairs.radars[pairs.which], polar, geodetic, level[pairs.which])
    off = made.off
    rows = np.zeros((*off.shape, radars * each + 3))
    rows[..., -3:] = -made.by_source
    drift = None
    if method.with_time and pairs.velocity_mps is not None:
        # what the radar says at its own time, the aircraft did that much earlier or later
        drift = (made.by_ecef @ pairs.velocity_mps[..., None])[..., 0]
        off = off + drift * of_radar[..., pairs.which, 3][..., None]
    for radar in range(radars):
        mine = pairs.which == radar
        first = radar * each
        rows[..., mine, :, first : first + 3] = made.by_radar[..., mine, :, :]
        if drift is not None:
            rows[..., mine, :, first + 3] = -drift[..., mine, :]
    if method.weighting == "none":
        return rows, off
    source_sigma = pairs.source_sigma_m * per_metre(geodetic, each=True)
    spread = _spread(made.by_radar, pairs.polar_sigma) + _spread(made.by_source, source_sigma)
    whiten = np.linalg.inv(np.linalg.cholesky(spread))
    return whiten @ rows, (whiten @ off[..., None])[..., 0]


def _spread(jacobian: Floats, sigma: Floats) -> Floats:
    scaled = jacobian * sigma[..., None, :]
    return np.asarray(scaled @ scaled.swapaxes(-1, -2))


def _weights(pairs: Pairs, found: Floats, method: Method) -> Floats:
    """Huber's: a pair counts by how far off it is, so that a wrong one pulls no more than one at the bound."""
    own = replace(pairs, source_sigma_m=np.hypot(pairs.source_sigma_m, method.own_sigma_m or 0.0))
    _, off = _equations(own, found, replace(method, weighting="whitened"))
    distance = np.sqrt((off * off).sum(axis=-1))
    return np.where(distance > HUBER, HUBER / np.maximum(distance, HUBER), 1.0)


def _told(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> Errors:
    free, solved = (
        _solve(pairs, found, weight, replace(method, prior_sigma_m=None)),
        _solve(pairs, found, weight, method),
    )
    radars, each = len(pairs.radars), 4 if method.with_time else 3
    of_radar = found[..., :-3].reshape(*found.shape[:-1], radars, each)
    values = free.values
    weak = values < values[..., :1] * _WEAK
    blurred = (np.abs(free.axes) > _SHARE) & weak[..., None]
    return Errors(
        radar=of_radar[..., :3],
        time_s=of_radar[..., 3] if method.with_time else np.full(of_radar.shape[:-1], np.nan),
        source=found[..., -3:],
        covariance=solved.covariance,
        condition=values[..., 0] / np.maximum(values[..., -1], _LEAST_VALUE * values[..., 0]),
        observable=np.asarray(~blurred.any(axis=-2)),
        chi_square=_misfit(pairs, found, weight, method),
        freedom=3 * pairs.polar.shape[-2] - found.shape[-1],
        prior_chi_square=_against_prior(pairs, found, weight, method),
        weight=weight,
    )


def _misfit(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> Floats:
    """The weighted sum of squares of the whitened residuals, the prior's not among them."""
    _, known = _table(pairs, found, weight, replace(method, weighting="whitened", prior_sigma_m=None))
    return np.asarray((known * known).sum(axis=-1))


def _against_prior(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> Floats:
    """How much worse the pairs fit because of the prior, and the prior because of them: chi-square of 3 degrees, if it is right.

    Sums of squares, not a distance in parameters: where geometry tells little, those are hundreds of metres off and bent.
    """
    if method.prior_sigma_m is None:
        return np.full(found.shape[:-1], np.nan)
    sigmas = found[..., -3:] / (per_metre(pairs.geodetic) * method.prior_sigma_m)
    bound = _misfit(pairs, found, weight, method) + (sigmas * sigmas).sum(axis=-1)
    alone, least = replace(method, prior_sigma_m=None), bound
    for _ in range(_FREE_ROUNDS):
        found = found + _solve(pairs, found, weight, alone).step
        least = np.minimum(least, _misfit(pairs, found, weight, method))
    return np.asarray(bound - least)
