"""Which way symbols point: attitudes as quaternions (x, y, z, w) from a symbol's axes (x nose, y left, z up) to the
runway frame's, and covariances as ellipsoids.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def quaternion_from_attitude(
    roll_rad: ArrayLike, pitch_rad: ArrayLike, yaw_rad: ArrayLike, landing_rad: float | Floats
) -> Floats:
    """Quaternions (..., 4) of roll (right wing down), pitch (nose up) and yaw (clockwise from true north).

    `landing_rad` is the compass direction of the runway frame's x. The runway's vertical is taken for the
    aircraft's.
    """
    half_roll = 0.5 * np.asarray(roll_rad, dtype=np.float64)
    half_pitch = -0.5 * np.asarray(pitch_rad, dtype=np.float64)  # about the left wing a positive turn lowers the nose
    half_yaw = 0.5 * (landing_rad - np.asarray(yaw_rad, dtype=np.float64))
    (sr, sp, sy), (cr, cp, cy) = ((f(half_roll), f(half_pitch), f(half_yaw)) for f in (np.sin, np.cos))
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    z, w = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    return np.stack(np.broadcast_arrays(x, y, z, w), axis=-1)


def quaternion_from_matrix(matrix: Floats) -> Floats:
    """Quaternions (..., 4) of rotation matrices (..., 3, 3)."""
    m = matrix
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    # four times the outer product of the quaternion with itself; its longest column is the best conditioned
    outer = np.empty((*m.shape[:-2], 4, 4))
    outer[..., 0, 0], outer[..., 1, 1] = 1.0 + xx - yy - zz, 1.0 - xx + yy - zz
    outer[..., 2, 2], outer[..., 3, 3] = 1.0 - xx - yy + zz, 1.0 + xx + yy + zz
    for (i, j), (a, b) in {(0, 1): (1, 0), (0, 2): (2, 0), (1, 2): (2, 1)}.items():
        outer[..., i, j] = outer[..., j, i] = m[..., a, b] + m[..., b, a]
    for i, (a, b) in enumerate(((2, 1), (0, 2), (1, 0))):
        outer[..., i, 3] = outer[..., 3, i] = m[..., a, b] - m[..., b, a]
    longest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    best = np.take_along_axis(outer, longest[..., None, None], axis=-1)[..., 0]
    return np.asarray(best / np.linalg.norm(best, axis=-1, keepdims=True))


def ellipsoid(runway_from_enu: Floats, covariance: Floats, sigmas: float) -> tuple[Floats, Floats]:
    """Half axes (n, 3) in metres and orientation (n, 4) of the position part of covariances (n, 36), in runway axes.

    The covariance is in the local east, north, up; its tilt against the runway's (0.45 degrees at 50 km) is
    left out.
    """
    local = covariance.reshape(-1, 6, 6)[:, :3, :3]
    turned = np.einsum("ij,njk,lk->nil", runway_from_enu, local, runway_from_enu)
    finite = np.isfinite(turned).all(axis=(1, 2))
    variances, axes = np.linalg.eigh(np.where(finite[:, None, None], turned, np.eye(3)))
    axes[np.linalg.det(axes) < 0.0, :, 0] *= -1.0  # a rotation, not a mirror
    half = sigmas * np.sqrt(np.maximum(variances, 0.0))
    return np.where(finite[:, None], half, np.nan), quaternion_from_matrix(axes)
