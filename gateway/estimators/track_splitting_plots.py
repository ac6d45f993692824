"""The states of many hypotheses, moved and corrected: hypotheses are the last axis, half of the states are rates.

A state is a position along A axes, then its rates; means (2A, n), covariances (2A, 2A, n). Measured components are worked in one
after the other, which needs no inverse and lets any of them be missing; all are linear about the predicted position.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LOG_TAU = float(np.log(2.0 * np.pi))


_AXES = {axes: np.eye(axes)[:, :, None] for axes in (2, 3)}


class Sight(Protocol):
    """How a sensor measures positions along A axes in k components."""

    @property
    def turn(self) -> float | None:
        """After how much the second component is the same again, if it is an angle all around."""

    def measured(self, position: Floats) -> tuple[Floats, Floats]:
        """What it would measure of positions (A, n): values (k, n) and their derivatives (k, A, n), or (k, A, 1) if constant."""

    def off(self, value: Floats, expected: Floats) -> Floats:
        """Differences (k, n) of what was measured and what was expected; angles the short way round."""

    def placed(self, value: Floats, variance: Floats) -> tuple[Bools, Floats, Floats]:
        """Which plots (m,) tell a place; and of these the positions (A, b) and covariances (A, A, b)."""


class Plane:
    """A sensor that measures the axes themselves. As the paper's: x and y."""

    turn: float | None = None

    def measured(self, position: Floats) -> tuple[Floats, Floats]:
        """The positions themselves."""
        return position, _AXES[len(position)]

    def off(self, value: Floats, expected: Floats) -> Floats:
        """Their differences."""
        return value - expected

    def placed(self, value: Floats, variance: Floats) -> tuple[Bools, Floats, Floats]:
        """Where all axes are measured."""
        whole: Bools = np.logical_not(np.isnan(value).any(axis=0))
        axis = np.arange(len(value))
        covariance = np.zeros((len(value), len(value), int(whole.sum())))
        covariance[axis, axis] = variance[:, whole]
        return whole, value[:, whole], covariance


def moved(mean: Floats, covariance: Floats, elapsed_s: float, density: tuple[float, ...]) -> tuple[Floats, Floats]:
    """States after a time at constant velocity, shaken by white acceleration of spectral densities (A,), m^2/s^3."""
    half, t = len(mean) // 2, elapsed_s
    mean, covariance = mean.copy(), covariance.copy()
    mean[:half] += t * mean[half:]
    covariance[:half] += t * covariance[half:]
    covariance[:, :half] += t * covariance[:, half:]
    covariance += _noise(t, density)
    return mean, covariance


@lru_cache(maxsize=256)  # scans come at one interval
def _noise(elapsed_s: float, density: tuple[float, ...]) -> Floats:
    t, shaken = abs(elapsed_s), np.diag(density)
    noise = np.block([[t**3 / 3.0 * shaken, t**2 / 2.0 * shaken], [t**2 / 2.0 * shaken, t * shaken]])[:, :, None]
    noise.flags.writeable = False
    return noise


def corrected(
    mean: Floats,
    covariance: Floats,
    off: Floats,
    variance: Floats,
    slope: Floats,
    lead_s: Floats | None = None,
) -> tuple[Floats, Floats, Floats, Floats]:
    """States after a plot each, with the squared distance v' S^-1 v (n,) and the logarithm of the plot's density (n,).

    off (k, n): measured less expected, NaN = not measured; variance (k, n); slope (k, A, n or 1); `lead_s` (n,): how much later
    than the states the plots were measured. A density is of the measured components alone, in their units.
    """
    half = len(mean) // 2
    before, mean, covariance = mean[:half], mean.copy(), covariance.copy()
    distance, log_density = np.zeros(off.shape[1]), np.zeros(off.shape[1])
    missing = np.isnan(off)
    partial = bool(missing.any())
    rates = mean[half:].copy() if lead_s is not None else None
    for component, row in enumerate(slope):
        cross = row[0] * covariance[:, 0]
        scatter = variance[component].copy()
        residual = off[component]
        for axis in range(1, half):
            cross += row[axis] * covariance[:, axis]
        if lead_s is not None:
            for axis in range(half):
                cross += (lead_s * row[axis]) * covariance[:, half + axis]
        for axis in range(half):
            scatter += row[axis] * cross[axis]
            if component:
                residual = residual - row[axis] * (mean[axis] - before[axis])
            if lead_s is not None and rates is not None:
                scatter += (lead_s * row[axis]) * cross[half + axis]
                residual = residual - (lead_s * row[axis]) * mean[half + axis]
        gain = cross / scatter
        square = residual * residual / scatter
        density = np.log(scatter) + LOG_TAU + square
        if partial:
            nothing = missing[component]
            residual = np.where(nothing, 0.0, residual)
            gain[:, nothing] = 0.0
            square, density = np.where(nothing, 0.0, square), np.where(nothing, 0.0, density)
        mean += gain * residual
        covariance -= gain[:, None] * cross
        distance += square
        log_density -= 0.5 * density
    return mean, covariance, distance, log_density
