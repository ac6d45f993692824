"""How vehicles without an inertial unit move on: their way through the air, or the water, turns with them or is dragged.

What they hold is their velocity less that of what they move through: `wind_mps`, where that moves to. Either way it is a linear
map of the level part, and the error states of `dead_reckoning` go with it. All over leading axes.

Source: 002-4; vehicles that tell where their nose points, or how they tilt, but no inertial samples are not in the paper.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.dead_reckoning import DRAG, WIND, Reckoning
from gateway.estimators.inertial import Motion, displaced

Floats = NDArray[np.float64]

_NORTH_EAST, _LEVEL = slice(0, 2), slice(3, 5)


def turned_through(state: Reckoning, turned_rad: Floats, interval_s: float) -> Reckoning:
    """A while later, in which noses have turned by so much (...,), clockwise, and the ways through the medium with them."""
    cosine, sine = np.cos(turned_rad), np.sin(turned_rad)
    kept = np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)
    return _kept(state, kept, interval_s, by_drag=False)


def dragged(state: Reckoning, interval_s: float) -> Reckoning:
    """A while later, in which drag has slowed the ways through the air."""
    kept = np.exp(-np.maximum(state.drag_per_s, 0.0) * interval_s)
    return _kept(state, kept[..., None, None] * np.eye(2), interval_s, by_drag=True)


def _kept(state: Reckoning, kept: Floats, interval_s: float, *, by_drag: bool) -> Reckoning:
    """A while later, of which level ways through the medium are what a matrix (..., 2, 2) makes of them."""
    motion, wind = state.motion, state.wind_mps
    through = motion.velocity_mps[..., :2] - wind
    after = (kept @ through[..., None])[..., 0]
    changed = np.zeros_like(motion.velocity_mps)
    changed[..., :2] = after - through
    place = displaced(motion.latitude_rad, motion.longitude_rad, motion.height_m, 0.5 * interval_s * changed)
    across = np.zeros(state.covariance.shape)
    across[..., :, :] = state.one
    lost = kept - np.eye(2)
    across[..., _LEVEL, _LEVEL], across[..., _LEVEL, WIND] = kept, -lost
    across[..., _NORTH_EAST, _LEVEL], across[..., _NORTH_EAST, WIND] = 0.5 * interval_s * lost, -0.5 * interval_s * lost
    if by_drag and len(state.one) > DRAG:
        across[..., _LEVEL, DRAG] = -interval_s * after
        across[..., _NORTH_EAST, DRAG] = -0.5 * interval_s**2 * after
    return replace(
        state,
        motion=Motion(*place, motion.velocity_mps + changed, motion.attitude),
        covariance=across @ state.covariance @ np.swapaxes(across, -1, -2),
    )
