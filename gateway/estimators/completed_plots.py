"""Radar plots as positions for estimators that work axis by axis; the prediction stands in for components that are missing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RadarFrame, polar_from_xyz, polar_jacobian, xyz_from_polar

Floats = NDArray[np.float64]


def completed(
    polar: Floats, sigma: Floats, predicted: Floats, variance: Floats, frame: RadarFrame
) -> tuple[Floats, Floats, Floats]:
    """Positions, their sigmas, and the share of each axis that was measured, all (n, 3), of plots of one radar.

    `polar` (n, 3) is range m, azimuth and elevation rad, NaN where missing, `sigma` (n, 3) theirs; `predicted` (n, 3) ENU m is
    where the tracks should be at the plots' times and `variance` (n, 3) how surely. A plot without any component is NaN.
    What stands in for a missing component is the track's own: it neither moves the track nor counts as measured. What the
    measured ones say along an axis holds the prediction's errors on the other axes; they count as noise.
    Source: 002-1, use in the gateway.
    """
    expected_xyz = frame.from_enu(predicted)
    measured: NDArray[np.bool_] = ~np.isnan(polar)
    whole = np.where(measured, polar, polar_from_xyz(expected_xyz))
    xyz = xyz_from_polar(whole)
    outwards = frame.enu_from_radar @ np.linalg.inv(polar_jacobian(xyz))  # ENU metres for each unit of a component
    spread = np.where(measured, sigma, 0.0)
    noise = np.square(outwards * spread[:, None, :]).sum(axis=2)
    inwards = polar_jacobian(xyz) @ frame.radar_from_enu
    seen = (
        outwards * measured[:, None, :]
    ) @ inwards  # what of a displacement is measured; the identity for a whole plot
    across = seen * (1.0 - np.eye(3))
    noise = noise + (across * across * variance[:, None, :]).sum(axis=2)
    share = np.clip(np.diagonal(seen, axis1=1, axis2=2), 0.0, 1.0)
    share = np.where(measured.all(axis=1, keepdims=True), 1.0, np.where(share > 1e-6, share, 0.0))
    position = np.where(measured.any(axis=1, keepdims=True), frame.to_enu(xyz), np.nan)
    return position, np.sqrt(noise), share
