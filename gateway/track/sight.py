"""How a radar measures: range, azimuth and elevation of positions in its own frame, over arrays with targets last."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gateway.frames import polar_from_xyz, polar_jacobian
from gateway.geodesy import wrap_rad

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GUESSED_ELEVATION_RAD, GUESSED_SIGMA_RAD = (
    math.radians(3.0),
    math.radians(3.0),
)  # where none was measured: aircraft are low

LEAST_RANGE_M = 10.0  # nothing nearer begins a track: angles mean nothing there
LEAST_SIGMA_M = 1e-3
_DIAGONAL = np.arange(3)


class RadarSight:
    """Positions (3, n) along the radar's x, y, z; values (3, n): range m, azimuth and elevation rad. See `Sight`."""

    turn: float | None = 2.0 * math.pi

    def measured(self, position: Floats) -> tuple[Floats, Floats]:
        """What the radar would measure, and the derivatives (3, 3, n)."""
        xyz = position.T
        return polar_from_xyz(xyz).T, polar_jacobian(xyz).transpose(1, 2, 0)

    def off(self, value: Floats, expected: Floats) -> Floats:
        """Differences; azimuths the short way round."""
        off = value - expected
        off[1] = wrap_rad(off[1])
        return off

    def placed(self, value: Floats, variance: Floats) -> tuple[Bools, Floats, Floats]:
        """Where range and azimuth are measured; without an elevation at a guessed one, of which little is claimed."""
        whole: Bools = (value[0] >= LEAST_RANGE_M) & ~np.isnan(value[1])
        polar, spread = value[:, whole], variance[:, whole]
        level = np.isnan(polar[2])
        polar[2, level], spread[2, level] = GUESSED_ELEVATION_RAD, GUESSED_SIGMA_RAD**2
        distance, azimuth, elevation = polar
        level, sine, cosine = np.cos(elevation), np.sin(azimuth), np.cos(azimuth)
        outward = np.stack([level * cosine, level * sine, np.sin(elevation)])
        aside = distance * level * np.stack([-sine, cosine, np.zeros_like(sine)])
        upward = distance * np.stack([-np.sin(elevation) * cosine, -np.sin(elevation) * sine, level])
        axes = (outward, aside, upward)
        covariance = sum(
            (part * axis[:, None] * axis for part, axis in zip(spread, axes, strict=True)), np.zeros((3, 3, 1))
        )
        covariance[_DIAGONAL, _DIAGONAL] += LEAST_SIGMA_M**2
        return whole, distance * outward, covariance
