"""A path through the air tied to what is known of places along it: least squares over the wind that carried it.

The wind is linear between knots and wanders from one to the next as a random walk. What is known comes as rows: how far
along a level direction the aircraft was at an instant, and how well that is known. A position is two rows, a radar's range
one, its azimuth another. Source: 002-2, known fixes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Floats = NDArray[np.float64]

KNOTS_S = 30.0
WIND_SIGMA_MPS = 15.0  # of a wind that nothing is known of, an axis
WANDERS_MPS_PER_SQRT_S = 0.2
_MOST_KNOTS = 400  # the normal equations are dense


@dataclass(frozen=True, slots=True)
class Knots:
    """Where the wind of a path may bend: `count` + 1 knots, `step_s` apart, the first at `first_s`."""

    first_s: float
    step_s: float
    count: int

    @classmethod
    def over(cls, time_s: Floats, apart_s: float = KNOTS_S) -> Knots:
        """Those of a path with samples at these times (n,)."""
        length = float(time_s[-1] - time_s[0])
        count = min(max(math.ceil(length / apart_s), 1), _MOST_KNOTS)
        return cls(float(time_s[0]), length / count, count)

    def hats(self, time_s: Floats) -> Floats:
        """(n, count + 1): each knot's share in what is linear between them."""
        since = (time_s[:, None] - self.first_s) / self.step_s - np.arange(self.count + 1)
        return np.asarray(np.maximum(0.0, 1.0 - np.abs(since)))

    def carried(self, time_s: Floats) -> Floats:
        """(n, count + 1) s: the integral of `hats` from the first knot on."""
        since = (time_s[:, None] - self.first_s) / self.step_s - np.arange(self.count + 1)
        since = np.clip(since, -1.0, 1.0)
        whole = np.where(since < 0.0, 0.5 * (1.0 + since) ** 2, 0.5 + since - 0.5 * since**2)
        whole[:, 0] -= 0.5  # the half of the first that lies before it
        return np.asarray(whole * self.step_s)


@dataclass(frozen=True, slots=True)
class Known:
    """m rows of what is known: at time_s (m,), `rates` (m, 2) · place = value (m,), with 1 sigma (m,).

    `rates` says how the value changes for each metre to the east and to the north of lift-off: a direction where it is metres.
    """

    time_s: Floats
    rates: Floats
    value: Floats
    sigma: Floats

    @classmethod
    def places(cls, time_s: Floats, place_m: Floats, sigma_m: Floats) -> Known:
        """Places (m, 2), metres east and north of lift-off, 1 sigma (m,) an axis."""
        rates = np.tile(np.eye(2), (len(time_s), 1))
        return cls(np.repeat(time_s, 2), rates, place_m.reshape(-1), np.repeat(sigma_m, 2))

    @classmethod
    def none(cls) -> Known:
        """Nothing."""
        return cls(np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0))

    def and_also(self, other: Known) -> Known:
        """Both."""
        return Known(
            np.concatenate([self.time_s, other.time_s]),
            np.concatenate([self.rates, other.rates]),
            np.concatenate([self.value, other.value]),
            np.concatenate([self.sigma, other.sigma]),
        )


@dataclass(frozen=True, slots=True)
class WindEvidence:
    """What something else tells of the wind at k knots: information (2k, 2k) and information times value (2k,), east first."""

    information: Floats
    vector: Floats


@dataclass(frozen=True, slots=True)
class Tied:
    """A path that passes known places, (n, 2) m, and the wind that carried it, (n, 2) m/s.

    `found` (2k,) is that wind at the knots, `covariance` (2k, 2k) how well it is known; east first.
    """

    path_m: Floats
    wind_mps: Floats
    sigma_m: Floats  # (n,) 1 sigma an axis
    knots: Knots
    found: Floats
    covariance: Floats

    def spread(self, time_s: Floats) -> Floats:
        """Covariance (m, 2, 2) of the place at times (m,), m2: linear between eight instants of each knot's time."""
        knots = self.knots
        fine = knots.first_s + knots.step_s / 8.0 * np.arange(8 * knots.count + 1, dtype=np.float64)
        spread = _spread(knots.carried(fine), self.covariance).reshape(-1, 4)
        return np.stack([np.interp(time_s, fine, one) for one in spread.T], axis=-1).reshape(-1, 2, 2)


def tied(
    time_s: Floats,
    path_m: Floats,
    known: Known,
    evidence: WindEvidence | None = None,
    *,
    knots_s: float = KNOTS_S,
    wind_sigma_mps: float = WIND_SIGMA_MPS,
    wanders_mps_per_sqrt_s: float = WANDERS_MPS_PER_SQRT_S,
) -> Tied:
    """The path (n, 2) through the air, carried by the wind that takes it closest to what is known.

    The first sample stays where it is. `evidence` is for `Knots.over(time_s, knots_s)`. With a single exact place at the end and
    a wind that does not wander this is `flight_path.closed`.
    """
    knots = Knots.over(time_s, knots_s)
    of_axis = _prior(knots, wind_sigma_mps, wanders_mps_per_sqrt_s)
    information = np.kron(np.eye(2), of_axis)
    vector = np.zeros(len(information))
    if evidence is not None:
        information, vector = information + evidence.information, vector + evidence.vector
    through_air = at_times(known.time_s, time_s, path_m)
    left = known.value - (known.rates * through_air).sum(axis=1)
    carried = knots.carried(known.time_s)
    rows = np.concatenate([known.rates[:, :1] * carried, known.rates[:, 1:] * carried], axis=1) / known.sigma[:, None]
    factor = cho_factor(information + rows.T @ rows)
    found = cho_solve(factor, vector + rows.T @ (left / known.sigma))
    covariance = np.asarray(cho_solve(factor, np.eye(len(found))))
    wind = found.reshape(2, -1)
    weights = knots.carried(time_s)
    spread = _spread(weights, covariance)
    return Tied(
        path_m + weights @ wind.T,
        knots.hats(time_s) @ wind.T,
        np.sqrt(np.maximum(0.5 * np.trace(spread, axis1=1, axis2=2), 0.0)),
        knots,
        found,
        covariance,
    )


def at_times(time_s: Floats, known_s: Floats, values: Floats) -> Floats:
    """Columns (n, k) that are known at times (n,), at other times (m,): (m, k), linear between."""
    return np.stack([np.interp(time_s, known_s, column) for column in values.T], axis=-1)


def _prior(knots: Knots, wind_sigma_mps: float, wanders: float) -> Floats:
    """Information (k, k) of one axis before anything is known: a random walk from a wind that may be any."""
    steps = np.diff(np.eye(knots.count + 1), axis=0)
    information: Floats = steps.T @ steps / (wanders**2 * knots.step_s)
    information[0, 0] += 1.0 / wind_sigma_mps**2
    return information


def _spread(weights: Floats, covariance: Floats) -> Floats:
    """(n, 2, 2) of weights (n, k) of each axis."""
    k = weights.shape[1]
    blocks = covariance.reshape(2, k, 2, k)
    half = np.einsum("ni,aibj->nabj", weights, blocks, optimize=True)
    return np.asarray(np.einsum("nabj,nj->nab", half, weights, optimize=True))
