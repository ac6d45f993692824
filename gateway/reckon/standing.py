"""Whether a vehicle stands, by what it says while no position comes: it has no velocity then, and does not drift away.

Its autopilot says that it is disarmed, or on the ground; wings, that there is no wind over them; a unit, that nothing moves it.
None of that is enough alone, since smooth flight feels as standing does: it must also be as slow as what stands, as far as is
known. Ground speeds that VFR_HUD tells are not asked: without positions they are made up, or stay what they were. Source: 002-4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.dead_reckoning import Reckoning
from gateway.estimators.inertial import matrix
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from gateway.reckon.cells import BLOCK, CELL_S, SECOND_CELLS, Block
from gateway.reckon.kinds import By, Kinds
from gateway.reckon.ties import SLOWEST_AIR_MPS, of_some
from gateway.reckon.tip import Tip, hypothesis
from gateway.reckon.told import DISARMED, ON_GROUND

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SILENT_CELLS = 2 * SECOND_CELLS  # without positions: while these come they say it better
SLOW_MPS = 0.7  # and twice what is not known of the velocity: so slow is what its autopilot says that it rests
STILL_MPS = 0.5  # so slow, and as sure, is what only its sensors say that it stands
TURNS_RADPS, JERKED_MPS2 = 0.03, 0.5  # the mean of half a second: more is motion
STANDS_MPS = 0.05
CREEPS = 0.5  # m in a root second: what stands may be moved by hand


def with_standing(tip: Tip, told: Block, kinds: Kinds, cell: int) -> Tip:
    """With no velocity of those that stand, of all hypotheses."""
    rows = np.flatnonzero(stands(tip, told, kinds) & (cell - tip.heard > SILENT_CELLS))
    if not len(rows):
        return tip
    accelerated = tip.accelerated_mps2.copy()
    accelerated[rows] = 0.0
    return replace(tip, state=of_some(tip.state, rows, _stood), accelerated_mps2=accelerated)


def stands(tip: Tip, told: Block, kinds: Kinds) -> Bools:
    """Which vehicles (n,) stand, as far as they say."""
    state = hypothesis(tip.state, 0)
    speed = np.linalg.norm(state.motion.velocity_mps[:, :2], axis=-1)
    sigma = np.sqrt(state.covariance[:, (3, 4), (3, 4)].max(axis=-1))
    unmoved = _unmoved(state, told) | (kinds.by != By.UNIT)
    rests = (told.rest == DISARMED) | ((told.rest == ON_GROUND) & ~kinds.wings)
    says = rests & ~kinds.hull & (speed < SLOW_MPS + 2.0 * sigma)  # hulls drift
    sure = (speed < STILL_MPS) & (sigma < STILL_MPS)
    still = (kinds.wings & (told.airspeed <= SLOWEST_AIR_MPS)) | (kinds.wheels & kinds.unit)
    return np.asarray(unmoved & (says | (still & sure)))


def _unmoved(state: Reckoning, told: Block) -> Bools:
    """Whether units (n,) feel neither turning nor being pushed, less what they are known to be wrong by."""
    rate = told.rate.mean(axis=1) - state.rate_bias_radps
    body = matrix(state.motion.attitude)
    felt = (body @ (told.force.mean(axis=1) - state.force_bias_mps2)[..., None])[..., 0]
    felt[:, 2] += STANDARD_GRAVITY_MPS2
    return np.asarray((np.linalg.norm(rate, axis=-1) < TURNS_RADPS) & (np.linalg.norm(felt, axis=-1) < JERKED_MPS2))


def _stood(state: Reckoning) -> Reckoning:
    state, _ = dr.with_velocity(state, np.zeros(3), STANDS_MPS)
    covariance = state.covariance.copy()
    covariance[..., (0, 1), (0, 1)] += CREEPS**2 * BLOCK * CELL_S
    return replace(state, covariance=covariance)
