"""The linearised equations of registration, whitened, and their solution by the column-scaled triangle that QR makes of them.

Every pair gives three rows. Own errors of aircraft are taken out by a QR of each aircraft's rows, and what is left of all of
them is brought to a triangle before its singular values are taken: of ten thousand pairs that takes milliseconds.
Source: 004 2, eq 1 to 12.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.registration_frames import Difference, System, difference, per_metre

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Weighting = Literal["none", "whitened"]

PRIOR_SIGMA_M = 30.0  # of the position source's error, an axis
HUBER = 2.8  # a pair further off than this (sigmas of three components, 95 %) counts less
LEAST_VALUE = 1e-13  # of the largest singular value: what is below is rounding


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


@dataclass(frozen=True, slots=True)
class Equations:
    """Rows (..., n, 3, p) and what they should give (..., n, 3), whitened by `whiten` (..., n, 3, 3; None: they are not).

    `judge`: (..., n, 3, 3), what makes of `off` that in which own errors are noise too; None: they are none.
    """

    rows: Floats
    off: Floats
    whiten: Floats | None = None
    judge: Floats | None = None

    def moved(self, by: Floats) -> Equations:
        """The equations where the errors are others (..., p), as far as they are straight."""
        return replace(self, off=self.off - (self.rows @ by[..., None, :, None])[..., 0])

    def huber(self) -> Floats:
        """Weights (..., n): a pair counts by how far off it is, so that a wrong one pulls no more than one at the bound."""
        off = self.off if self.judge is None else (self.judge @ self.off[..., None])[..., 0]
        distance = np.sqrt((off * off).sum(axis=-1))
        return np.where(distance > HUBER, HUBER / np.maximum(distance, HUBER), 1.0)


@dataclass(frozen=True, slots=True)
class Solution:
    """A step (..., p), its covariance, singular values (..., p) of the column-scaled equations and their axes (..., p, p).

    `square`: (...) what the equations' squares sum to before the step, the prior left out; `gained`: how much less after it.
    """

    step: Floats
    covariance: Floats
    values: Floats
    axes: Floats
    square: Floats
    gained: Floats

    @property
    def sigma(self) -> Floats:
        """Of each parameter, (..., p)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))


def equations_at(pairs: Pairs, found: Floats, method: Method, like: Equations | None = None) -> Equations:
    """The equations at the errors found so far, (..., p). `like`: others near enough to be whitened as they are."""
    radars, each = len(pairs.radars), 4 if method.with_time else 3
    of_radar = found[..., :-3].reshape(*found.shape[:-1], radars, each)
    which = slice(None) if radars == 1 else pairs.which  # one radar: its frame is made once
    level = pairs.radars[:, :2] if pairs.level is None else pairs.level
    geodetic = pairs.geodetic + found[..., None, -3:]
    polar = pairs.polar + of_radar[..., which, :3]
    made = difference(method.system, pairs.radars[which], polar, geodetic, level[which])
    off = made.off
    rows = np.zeros((*off.shape, radars * each + 3))
    rows[..., -3:] = -made.by_source
    drift = None
    if method.with_time and pairs.velocity_mps is not None:
        # what the radar says at its own time, the aircraft did that much earlier or later
        drift = (made.by_ecef @ pairs.velocity_mps[..., None])[..., 0]
        off = off + drift * of_radar[..., which, 3][..., None]
    for radar in range(radars):
        mine: slice | NDArray[np.bool_] = slice(None) if radars == 1 else pairs.which == radar
        first = radar * each
        rows[..., mine, :, first : first + 3] = made.by_radar[..., mine, :, :]
        if drift is not None:
            rows[..., mine, :, first + 3] = -drift[..., mine, :]
    if method.weighting == "none":
        return Equations(rows, off)
    whiten, judge = _whiteners(pairs, made, geodetic, method) if like is None else (like.whiten, like.judge)
    assert whiten is not None
    return Equations(whiten @ rows, (whiten @ off[..., None])[..., 0], whiten, judge)


def _whiteners(pairs: Pairs, made: Difference, geodetic: Floats, method: Method) -> tuple[Floats, Floats | None]:
    """What whitens differences, and what makes of whitened ones those in which own errors are noise too."""
    per, by_radar = per_metre(geodetic, each=True), _spread(made.by_radar, pairs.polar_sigma)
    noise = by_radar + _spread(made.by_source, pairs.source_sigma_m * per)
    whiten = _whitening(noise)
    if not method.robust or method.own_sigma_m is None:
        return whiten, None
    own = whiten @ _spread(made.by_source, method.own_sigma_m * per) @ whiten.swapaxes(-1, -2)
    return whiten, _whitening(np.eye(3) + own)


def solved(equations: Equations, found: Floats, weight: Floats, pairs: Pairs, method: Method) -> Solution:
    """The next step from the errors found so far, pairs counting by their weights (..., n)."""
    root = np.sqrt(weight)[..., None]
    size, cases = equations.rows.shape[-1], equations.rows.shape[:-3]
    both = np.concatenate([equations.rows * root[..., None], (equations.off * root)[..., None]], axis=-1)
    if method.own_sigma_m is None:
        left = both.reshape(*cases, -1, size + 1)
    else:
        left = _without_own(both, pairs, method.own_sigma_m)
    if left.shape[-2] > size + 1:
        left = np.asarray(np.linalg.qr(left, mode="r"))
    square = (left[..., -1] ** 2).sum(axis=-1)
    if method.prior_sigma_m is not None:
        prior = np.zeros((*cases, 3, size + 1))
        prior[..., :, -4:-1] = np.eye(3) / (method.prior_sigma_m * per_metre(pairs.geodetic))[..., None, :]
        prior[..., -1] = -(prior[..., :-1] @ found[..., None])[..., 0]
        left = np.concatenate([left, prior], axis=-2)
    solution = _least_squares(left[..., :-1], left[..., -1], square)
    if method.weighting == "none":  # the equations do not say how good they are; their residuals do
        spread = (square - solution.gained) / max(3 * weight.shape[-1] - size, 1)
        return replace(solution, covariance=solution.covariance * spread[..., None, None])
    return solution


def misfit_at(pairs: Pairs, found: Floats, weight: Floats, method: Method) -> Floats:
    """The weighted sum of squares of the whitened residuals (...), the prior's not among them."""
    return solved(equations_at(pairs, found, method), found, weight, pairs, replace(method, prior_sigma_m=None)).square


def _without_own(both: Floats, pairs: Pairs, sigma_m: float) -> Floats:
    """Rows with what they should give (..., n, 3, p + 1), without aircraft's own errors, as (..., k, p + 1).

    An aircraft's own errors are three unknowns, in sigmas about nothing: a QR of its rows takes them out.
    """
    assert pairs.aircraft is not None
    cases, size = both.shape[:-3], both.shape[-1]
    scaled = both[..., -4:-1] * (sigma_m * per_metre(pairs.geodetic))[..., None, None, :]
    about = np.broadcast_to(np.eye(3, size + 3), (*cases, 3, size + 3))
    left = []
    for one in range(int(pairs.aircraft.max()) + 1):
        mine = pairs.aircraft == one
        above = np.concatenate([scaled[..., mine, :, :], both[..., mine, :, :]], axis=-1)
        table = np.concatenate([above.reshape(*cases, -1, size + 3), about], axis=-2)
        left.append(np.asarray(np.linalg.qr(table, mode="r"))[..., 3:, 3:])
    return np.concatenate(left, axis=-2)


def _least_squares(table: Floats, known: Floats, square: Floats) -> Solution:
    """By singular values of the column-scaled equations: normal equations would square a condition of 1e7 and more."""
    scale = np.sqrt((table * table).sum(axis=-2))
    scale = np.where(scale > 0.0, scale, 1.0)
    left, values, axes = np.linalg.svd(table / scale[..., None, :], full_matrices=False)
    inverse = 1.0 / np.maximum(values, LEAST_VALUE * values[..., :1])
    along = (left.swapaxes(-1, -2) @ known[..., None])[..., 0]
    step = (axes.swapaxes(-1, -2) @ (along * inverse)[..., None])[..., 0] / scale
    half = axes.swapaxes(-1, -2) * inverse[..., None, :]
    covariance = (half @ half.swapaxes(-1, -2)) / (scale[..., :, None] * scale[..., None, :])
    return Solution(step, covariance, values, axes, square, (along * along).sum(axis=-1))


def _spread(jacobian: Floats, sigma: Floats) -> Floats:
    scaled = jacobian * sigma[..., None, :]
    return np.asarray(scaled @ scaled.swapaxes(-1, -2))


def _whitening(spread: Floats) -> Floats:
    """The inverses of the lower triangles of covariances (..., 3, 3), written out: a library call for each costs more."""
    a = np.sqrt(spread[..., 0, 0])
    b, c = spread[..., 1, 0] / a, spread[..., 2, 0] / a
    d = np.sqrt(spread[..., 1, 1] - b * b)
    e = (spread[..., 2, 1] - c * b) / d
    f = np.sqrt(spread[..., 2, 2] - c * c - e * e)
    whiten = np.zeros(spread.shape)
    whiten[..., 0, 0], whiten[..., 1, 1], whiten[..., 2, 2] = 1.0 / a, 1.0 / d, 1.0 / f
    whiten[..., 1, 0] = lower = -b / (a * d)
    whiten[..., 2, 1] = -e / (d * f)
    whiten[..., 2, 0] = -(c / a + e * lower) / f
    return whiten
