"""The field of threats that a route is priced in, over arrays.

    J = length + lambda x integral of sum 1/d^4 along the route

A radar receives of its target as 1/d^4. With lambda = d^4 a metre at the distance d from one threat counts as two; J is m,
lambda m^4. Distances are level, as in the paper, unless the route passes above (or below) a threat by a known height.
Source: 002-3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

LAMBDA_M4 = 2_000.0**4  # 16 km4: at 2 km a metre counts as two
NEAREST_M = 1.0  # nobody is nearer to a threat than this: J stays finite
STEP_M = 25.0  # between a curve's points where it is priced: at 250 m from a threat 0.3 % off


@dataclass(frozen=True, slots=True)
class Threats:
    """Where threats are: places (n, 2) m, and by how much the route's level is above each, (n,) m."""

    place_m: Floats
    below_m: Floats

    @classmethod
    def level(cls, place_m: ArrayLike) -> Threats:
        """Threats (n, 2) whose distances are level."""
        place = np.asarray(place_m, dtype=np.float64).reshape(-1, 2)
        return cls(place, np.zeros(len(place)))

    def raised(self, by_m: Floats) -> Threats:
        """The same seen from a level that is so much (n,) above each."""
        return replace(self, below_m=by_m)

    def square(self, place_m: Floats) -> Floats:
        """Squares of the distances (..., n) from places (..., 2)."""
        aside = place_m[..., None, :] - self.place_m
        return np.asarray(np.maximum((aside * aside).sum(axis=-1) + self.below_m**2, NEAREST_M**2))

    def density(self, place_m: Floats) -> Floats:
        """Sum of 1/d^4 over the threats, 1/m^4, at places (..., 2)."""
        return np.asarray((self.square(place_m) ** -2).sum(axis=-1))

    def density_and_gradient(self, place_m: Floats) -> tuple[Floats, Floats]:
        """The density (...) and its derivative by the place (..., 2)."""
        aside = place_m[..., None, :] - self.place_m
        inverse = 1.0 / np.maximum((aside * aside).sum(axis=-1) + self.below_m**2, NEAREST_M**2)
        steep = -4.0 * inverse**3
        return (inverse**2).sum(axis=-1), (steep[..., None] * aside).sum(axis=-2)


@dataclass(frozen=True, slots=True)
class Measures:
    """What a route is worth: length m, exposure (integral of sum 1/d^4) 1/m^3, J m, least distance to a threat m, least
    radius of its turns m (inf where it is straight)."""

    length_m: float
    exposure_m3: float
    cost_m: float
    clearance_m: float
    turn_radius_m: float


def resampled(curve_m: Floats, step_m: float = STEP_M) -> Floats:
    """Points (m, 2) at equal distances of about `step_m` along a polyline (n, 2), its ends kept to the bit."""
    station = stations(curve_m)
    count = max(int(np.ceil(station[-1] / step_m)), 1) + 1
    at = np.linspace(0.0, station[-1], count)
    found = np.stack([np.interp(at, station, curve_m[:, axis]) for axis in (0, 1)], axis=-1)
    found[0], found[-1] = curve_m[0], curve_m[-1]
    return found


def stations(curve_m: Floats) -> Floats:
    """The distance along a polyline (n, 2) of each of its points, (n,) m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve_m, axis=0).T))])


def measure(curve_m: Floats, threats: Threats, lambda_m4: float = LAMBDA_M4) -> Measures:
    """Price a curve that is given by points (n, 2), by the trapezoidal rule between points at most `STEP_M` apart."""
    dense = resampled(curve_m)
    square = threats.square(dense)
    density = (square**-2).sum(axis=-1)
    step = np.hypot(*np.diff(dense, axis=0).T)
    length, exposure = float(step.sum()), float((0.5 * (density[1:] + density[:-1]) * step).sum())
    clearance = float(np.sqrt(square.min())) if square.size else np.inf
    return Measures(length, exposure, length + lambda_m4 * exposure, clearance, least_radius(dense))


def least_radius(curve_m: Floats) -> float:
    """The least radius of the circles through each three neighbours of points (n, 2), m."""
    if len(curve_m) < 3:
        return float("inf")
    before, after = np.diff(curve_m, axis=0)[:-1], np.diff(curve_m, axis=0)[1:]
    across = curve_m[2:] - curve_m[:-2]
    area = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
    sides = np.hypot(*before.T) * np.hypot(*after.T) * np.hypot(*across.T)
    with np.errstate(divide="ignore"):
        return float((sides / (2.0 * area)).min())
