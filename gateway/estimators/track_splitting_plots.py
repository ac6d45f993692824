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

TAU = 2.0 * np.pi


class Sight(Protocol):
    """How a sensor measures positions along A axes in k components."""

    @property
    def turn(self) -> float | None:
        """After how much the second component is the same again, if it is an angle all around."""

    def measured(self, position: Floats) -> tuple[Floats, Floats | None]:
        """What it would measure of positions (A, n): values (k, n), and derivatives (k, A, n), None if it measures the axes."""

    def off(self, value: Floats, expected: Floats) -> Floats:
        """Differences (k, n) of what was measured and what was expected; angles the short way round."""

    def placed(self, value: Floats, variance: Floats) -> tuple[Bools | None, Floats, Floats]:
        """Which plots (m,) tell a place, None = all; and of these the positions (A, b) and covariances (A, A, b)."""


class Plane:
    """A sensor that measures the axes themselves. As the paper's: x and y."""

    turn: float | None = None

    def measured(self, position: Floats) -> tuple[Floats, None]:
        """The positions themselves."""
        return position, None

    def off(self, value: Floats, expected: Floats) -> Floats:
        """Their differences."""
        return value - expected

    def placed(self, value: Floats, variance: Floats) -> tuple[Bools | None, Floats, Floats]:
        """Where all axes are measured."""
        whole: Bools | None = None
        if (missing := np.isnan(value)).any():
            whole = np.logical_not(missing.any(axis=0))
            value, variance = value[:, whole], variance[:, whole]
        axes, count = value.shape
        covariance = np.zeros((axes, axes, count))
        covariance.reshape(axes * axes, count)[:: axes + 1] = variance
        return whole, value, covariance


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


def along(slope: Floats | None, component: int, parts: Floats) -> Floats:
    """What parts (A, ...) along the axes are in a measured component; slope (k, A, n), None = the axes themselves."""
    total: Floats
    if slope is None:
        total = parts[component]
        return total
    row = slope[component]
    total = row[0] * parts[0]
    for axis in range(1, len(row)):
        total += row[axis] * parts[axis]
    return total


def spread(slope: Floats | None, covariance: Floats) -> Floats:
    """Variances (k, n) of the measured components, of covariances (A, A, n) along the axes."""
    if slope is None:
        return covariance.diagonal().T
    return np.stack([along(slope, component, along(slope, component, covariance)) for component in range(len(slope))])


def corrected(
    mean: Floats,
    covariance: Floats,
    off: Floats,
    variance: Floats,
    slope: Floats | None,
    missing: Bools | None = None,
    lead_s: Floats | None = None,
) -> tuple[Floats, Floats, Floats, Floats]:
    """States after a plot each, with the squared distance v' S^-1 v (n,) and the plot's probability density (n,).

    off (k, n): measured less expected; variance (k, n); slope as `along`; `missing` (k, n): not measured, None = nothing is;
    `lead_s` (n,): how much later than the states the plots were measured. A density is of the measured components alone.
    """
    half, before = len(mean) // 2, mean[: len(mean) // 2]
    distance: Floats | float = 0.0
    volume: Floats | float = TAU ** len(off)
    for component, residual in enumerate(off):
        cross = along(slope, component, covariance[:half])
        if component:
            residual = residual - along(slope, component, mean[:half] - before)
        if lead_s is not None:
            cross = cross + lead_s * along(slope, component, covariance[half:])
            residual = residual - lead_s * along(slope, component, mean[half:])
        scatter = variance[component] + along(slope, component, cross[:half])
        if lead_s is not None:
            scatter += lead_s * along(slope, component, cross[half:])
        gain = cross / scatter
        if missing is not None and (nothing := missing[component]).any():
            gain[:, nothing] = 0.0
            residual, scatter = np.where(nothing, 0.0, residual), np.where(nothing, 1.0 / TAU, scatter)
        distance = distance + residual * residual / scatter
        volume = volume * scatter
        mean = mean + gain * residual
        covariance = covariance - gain[:, None] * cross
    return mean, covariance, np.asarray(distance), np.exp(-0.5 * distance) / np.sqrt(volume)
