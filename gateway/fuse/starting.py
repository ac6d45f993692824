"""The first state of a track, from what its first measurement says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.align import Local
from gateway.estimators.kalman import ERROR, POSITION, VELOCITY, Estimate, start
from gateway.frames import polar_jacobian, xyz_from_polar
from gateway.fuse.weighting import Model

Floats = NDArray[np.float64]

START_SPEED_SIGMA_MPS = 100.0  # before anything is known of a velocity


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


def start_in_part(position: Floats, sigma: Floats, local: Local, velocity_sigma: Floats, model: Model) -> Estimate:
    """The first state from a report that lacks components: position and sigma (1, 3), sigma of the velocity (1,).

    What is missing of the velocity is unknown; a height that is only guessed says nothing of the source's error.
    """
    axes, error = local.from_enu, model.motion.error_sigma_m
    unknown = np.isnan(local.velocity_mps)
    velocity = axes.T @ np.where(unknown, 0.0, local.velocity_mps)
    speed_sigma = np.where(unknown, START_SPEED_SIGMA_MPS, velocity_sigma)
    wrong = axes.T @ np.diag([error * error, error * error, error * error * local.has_height]) @ axes
    covariance = axes.T @ np.diag(sigma[0] * sigma[0]) @ axes + wrong
    state = start(position, covariance[None], velocity[None], velocity_sigma, error)
    state.covariance[:, VELOCITY, VELOCITY] = axes.T @ np.diag(speed_sigma * speed_sigma) @ axes
    state.covariance[:, POSITION, ERROR] = state.covariance[:, ERROR, POSITION] = -wrong
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
