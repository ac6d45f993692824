"""What dead reckoning is tied to beside positions: what a vehicle's kind says, its attitude, its altitude, and radars."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.dead_reckoning import Reckoning
from gateway.estimators.inertial import between, displaced
from gateway.reckon.cells import BLOCK, CELL_S, SECOND_CELLS, Block
from gateway.reckon.judging import FAR
from gateway.reckon.kinds import Kinds
from gateway.reckon.tip import Tip, with_each
from gateway.reckon.told import true_airspeed_mps
from gateway.settings import DeadReckoning

Ints = NDArray[np.int64]

LASTS_S = 30.0  # the errors of an autopilot's attitude, of an airspeed and of an altitude: what is told is that old
ATTITUDE_EVERY = 10  # cells
HULL_MPS = 1.5  # to the side, for half a minute: currents, leeway, and what a boat skids by in a bend
SLOWEST_AIR_MPS = 8.0  # below it an airspeed tells nothing
_LOOSE_M = 1e6


def tied(state: Reckoning, told: Block, kinds: Kinds, cell: int, settings: DeadReckoning) -> Reckoning:
    """With what a vehicle's kind and the autopilot's attitude tell, of those of which they tell something."""
    if cell % ATTITUDE_EVERY == 0:
        rows = np.flatnonzero(~np.isnan(told.attitude[:, 0]))
        # an error that lasts for so many samples tells as much as one sample of it in that time
        lasting = math.sqrt(2.0 * LASTS_S / (ATTITUDE_EVERY * CELL_S))
        sigma = settings.attitude_sigma_rad * np.array([1.0, 1.0, 2.0]) * lasting
        state = of_some(state, rows, lambda some: dr.with_attitude(some, told.attitude[rows][:, None], sigma)[0])
    rows = np.flatnonzero(kinds.wheels & kinds.unit)
    slip = settings.slip_mps
    state = of_some(state, rows, lambda some: dr.with_wheels(some, np.array([slip, slip]))[0])
    rows = np.flatnonzero(kinds.hull & kinds.unit)
    skids = HULL_MPS * math.sqrt(2.0 * LASTS_S / (BLOCK * CELL_S))
    state = of_some(state, rows, lambda some: dr.with_wheels(some, np.array([skids, _LOOSE_M]))[0])
    rows = np.flatnonzero(kinds.wings & (told.airspeed > SLOWEST_AIR_MPS))
    if len(rows):
        height = state.motion.height_m[rows]
        fast = true_airspeed_mps(told.airspeed[rows][:, None], height)
        sigma_mps = settings.airspeed_sigma_mps * math.sqrt(2.0 * 2.0 / (BLOCK * CELL_S))
        state = of_some(
            state, rows, lambda some: dr.with_airspeed(some, fast, sigma_mps, settings.sideslip_sigma_mps)[0]
        )
    return state


def of_some(state: Reckoning, rows: Ints, tie: Callable[[Reckoning], Reckoning]) -> Reckoning:
    """States of which some are tied to something."""
    if not len(rows):
        return state
    if len(rows) == len(state.covariance):
        return tie(state)
    return with_each(_put_rows(rows), state, tie(with_each(lambda one: one[rows], state)))


def _put_rows(rows: Ints) -> Callable[..., NDArray[Any]]:
    def changed(whole: NDArray[Any], part: NDArray[Any]) -> NDArray[Any]:
        whole = whole.copy()
        whole[rows] = part
        return whole

    return changed


def with_altitude(tip: Tip, told: Block, cell: int, settings: DeadReckoning) -> Tip:
    """With an altitude that is told beside positions, which while these come shows by how much it is another."""
    rows = np.flatnonzero(~np.isnan(told.altitude))
    if not len(rows):
        return tip
    known, altitude = tip.above_m[rows], told.altitude[rows]
    off = tip.state.motion.height_m[rows, 0] - altitude
    learns = (cell - tip.heard[rows] <= 2 * SECOND_CELLS) & ~tip.refused[rows]
    share = BLOCK * CELL_S / LASTS_S
    above = tip.above_m.copy()
    above[rows] = np.where(np.isnan(known), np.where(learns, off, np.nan), known + learns * share * (off - known))
    tip = replace(tip, above_m=above)
    ties = np.flatnonzero(~np.isnan(known) & ~learns)
    if not len(ties):
        return tip
    mine = rows[ties]
    sigma = settings.altitude_sigma_m * math.sqrt(2.0 * LASTS_S / (BLOCK * CELL_S))
    height = (altitude + above[rows])[ties][:, None]

    def tie(state: Reckoning) -> Reckoning:
        motion = state.motion
        return dr.with_place(state, motion.latitude_rad, motion.longitude_rad, height, (_LOOSE_M, _LOOSE_M, sigma))[0]

    return replace(tip, state=of_some(tip.state, mine, tie))


def with_picture(tip: Tip, told: Block, rows: Ints) -> Tip:
    """With where radars have the vehicles: of all hypotheses, unless it is far from where they are."""
    place, late = told.pictured[rows], told.pictured_late[rows][:, None]
    motion = tip.state.motion
    there = (place[:, None, column] for column in range(3))
    latitude, longitude, height = displaced(
        next(there), next(there), next(there), motion.velocity_mps * late[..., None]
    )
    off = between(latitude, longitude, height, motion)[..., :2]
    variance = tip.state.covariance[..., (0, 1), (0, 1)] + place[:, None, 6:7] ** 2
    near = (np.sum(off**2 / variance, axis=-1) < FAR).all(axis=1)
    chosen = np.flatnonzero(near)
    sigma = np.stack([place[chosen, 6], place[chosen, 6], place[chosen, 7]], axis=-1)[:, None]

    def tie(state: Reckoning) -> Reckoning:
        return dr.with_place(state, latitude[chosen], longitude[chosen], height[chosen], sigma)[0]

    return replace(tip, state=of_some(tip.state, chosen, tie))
