"""The four ways to weigh a position source against a radar, and what each measurement says of a state.

`bias` (default)  updates at each observation's own time, with three states for the position source's own error
`covariance`      the same without them: each source weighed by the noise it is said to have
`innovation`      the position source's noise is what its last innovations show
`literal`         the paper's: weights from the squares of two single residuals (eq 11 to 14)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import ERROR, POSITION, SIZE, VELOCITY, Estimate, Innovation, Motion, start, update
from gateway.frames import RadarFrame, polar_from_xyz, polar_jacobian, xyz_from_polar
from gateway.settings import Options, PositionSource, Weighting

Floats = NDArray[np.float64]

ROBUST_SIGMA = 3.0  # beyond this (for each degree of freedom) a measurement's pull is bounded
START_SPEED_SIGMA_MPS = 100.0  # before anything is known of a velocity
WINDOW = 8  # innovations remembered by `innovation`
LEAST_RESIDUAL = 1e-3  # sigmas; the literal weights are singular at a residual of 0


AXES = np.arange(3)

# What a GPS report measures of the state: position (and, where the source may be wrong, its error), and velocity.
_FIX = np.eye(6, SIZE)[None]
_FIX_WITH_ERROR = _FIX + np.eye(6, SIZE, 6)


@dataclass(frozen=True, slots=True)
class Model:
    """How tracks move and how sources are weighed: the settings of a run in the filter's terms."""

    weighting: Weighting
    motion: Motion
    radars: Mapping[int, RadarFrame]

    @classmethod
    def of(cls, options: Options, position: PositionSource, radars: Mapping[int, RadarFrame]) -> Model:
        """The model that the options and the site's position source ask for."""
        level = options.acceleration_sigma_mps2**2 * options.acceleration_time_s
        upright = options.vertical_acceleration_sigma_mps2**2 * options.acceleration_time_s
        error = position.systematic_m / math.sqrt(3.0) if options.weighting == "bias" else 0.0
        return cls(options.weighting, Motion((level, level, upright), error), radars)

    @property
    def memory(self) -> int:
        """How many innovations each track remembers."""
        return WINDOW if self.weighting == "innovation" else 0


def start_from_fixes(
    position: Floats, sigma: Floats, velocity: Floats, velocity_sigma: Floats, model: Model
) -> Estimate:
    """First states from GPS reports: positions, sigmas, velocities (n, 3; NaN = not measured), their sigma (n,).

    Position and source error are the two parts of one measured sum: their errors are opposite.
    """
    unknown: NDArray[np.bool_] = np.asarray(np.isnan(velocity).any(axis=1))
    speed_sigma = np.where(unknown, START_SPEED_SIGMA_MPS, velocity_sigma)
    covariance = np.zeros((len(position), 3, 3))
    axis, error = np.arange(3), model.motion.error_sigma_m
    covariance[:, axis, axis] = sigma * sigma + error * error
    state = start(position, covariance, np.where(unknown[:, None], 0.0, velocity), speed_sigma, error)
    state.covariance[:, axis, axis + 6] -= error * error
    state.covariance[:, axis + 6, axis] -= error * error
    return state


def start_from_plots(polar: Floats, sigma: Floats, radar: int, model: Model) -> Estimate:
    """First states from complete plots of one radar: range m, azimuth rad, elevation rad and sigmas, (n, 3)."""
    frame = model.radars[radar]
    xyz = xyz_from_polar(polar)
    outwards = np.linalg.inv(polar_jacobian(xyz))
    local = (outwards * (sigma * sigma)[:, None, :]) @ outwards.transpose(0, 2, 1)
    covariance = frame.enu_from_radar @ local @ frame.radar_from_enu
    n = len(polar)
    speed_sigma = np.full(n, START_SPEED_SIGMA_MPS)
    return start(frame.to_enu(xyz), covariance, np.zeros((n, 3)), speed_sigma, model.motion.error_sigma_m)


def update_with_fixes(
    state: Estimate,
    position: Floats,
    sigma: Floats,
    velocity: Floats,
    velocity_sigma: Floats,
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """States after GPS reports; arrays as in `start_from_fixes`; memory (n, w, 3) of past position innovations."""
    n = len(position)
    has_error = bool(model.motion.error_sigma_m)
    sensitivity = _FIX_WITH_ERROR if has_error else _FIX
    expected = state.mean[:, POSITION]
    if has_error:
        expected = expected + state.mean[:, ERROR]
    innovation = np.concatenate([position - expected, velocity - state.mean[:, VELOCITY]], axis=1)
    speed_variance = np.broadcast_to((velocity_sigma * velocity_sigma)[:, None], (n, 3))
    variance = np.concatenate([sigma * sigma, speed_variance], axis=1)
    if model.memory:
        known = np.concatenate([memory, innovation[:, None, :3]], axis=1)
        square = np.where(np.isnan(known), 0.0, known * known)
        mean_square = square.sum(axis=1) / np.maximum((~np.isnan(known)).sum(axis=1), 1)
        variance[:, :3] = np.maximum(variance[:, :3], mean_square - state.covariance[:, AXES, AXES])
        memory = known[:, 1:]
    after, told = update(state, innovation, sensitivity, variance, ROBUST_SIGMA)
    return after, told, memory


def update_with_plots(state: Estimate, polar: Floats, sigma: Floats, frame: RadarFrame) -> tuple[Estimate, Innovation]:
    """States after plots of one radar: polar and sigma (n, 3), NaN components are left out. Source: 003 2.4 eq 17 to 20."""
    xyz = frame.from_enu(state.mean[:, POSITION])
    innovation = polar_difference(polar, polar_from_xyz(xyz))
    sensitivity = np.zeros((len(polar), 3, SIZE))
    sensitivity[:, :, POSITION] = polar_jacobian(xyz) @ frame.radar_from_enu
    return update(state, innovation, sensitivity, sigma * sigma, ROBUST_SIGMA)


def update_literally(
    state: Estimate, position: Floats, position_sigma: Floats, polar: Floats, sigma: Floats, frame: RadarFrame
) -> tuple[Estimate, Innovation]:
    """States after GPS reports (n, 3) with the radar's plot at the same time, as printed.

    Each component's weight is the inverse square of that source's residual; the noise is weighed likewise; where the radar
    gives nothing the position source stands alone.
    Source: 003 2.4 eq 11 to 14, 17 to 20. Deviation: a residual below 1e-3 sigma counts as that.
    """
    xyz = frame.from_enu(state.mean[:, POSITION])
    expected = polar_from_xyz(xyz)
    jacobian = polar_jacobian(xyz) @ frame.radar_from_enu
    gps = polar_from_xyz(frame.from_enu(position))
    gps_variance = (jacobian * jacobian * (position_sigma * position_sigma)[:, None, :]).sum(axis=2)
    radar_variance = sigma * sigma
    by_radar, by_gps = polar_difference(polar, expected), polar_difference(gps, expected)
    weight_radar = 1.0 / np.maximum(by_radar * by_radar, LEAST_RESIDUAL**2 * radar_variance)
    weight_gps = 1.0 / np.maximum(by_gps * by_gps, LEAST_RESIDUAL**2 * gps_variance)
    total = weight_radar + weight_gps
    both = ~np.isnan(by_radar)
    fused = np.where(both, (weight_radar * by_radar + weight_gps * by_gps) / total, by_gps)
    variance = np.where(both, (weight_radar * radar_variance + weight_gps * gps_variance) / total, gps_variance)
    sensitivity = np.zeros((len(polar), 3, SIZE))
    sensitivity[:, :, POSITION] = jacobian
    return update(state, fused, sensitivity, variance, ROBUST_SIGMA)


def polar_difference(one: Floats, other: Floats) -> Floats:
    """Range, azimuth, elevation of one less those of another, (..., 3), azimuth in (-pi, pi]."""
    difference = one - other
    azimuth = difference[..., 1]
    difference[..., 1] = azimuth - 2.0 * math.pi * np.round(azimuth / (2.0 * math.pi))
    return difference
