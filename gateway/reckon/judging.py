"""Whether a vehicle's position source is to be believed: what inertial data deny is refused until it agrees again.

A position, or a velocity, is compared with where the vehicle can be. The hypothesis that was corrected until a second ago
denies what jumps; those that went on without it for five to twenty seconds deny what walks off slowly. Either must be sure:
six sigma of what they know and of what the source usually scatters by, and once more what good sources wander by. Where
neither wings nor wheels hold the velocity, they must have proved as sure as they say (`proving`).

Where only the velocity beside a position is denied, the position is refused with it: so begins what walks off with velocities
to match. But what goes on where it can be, and not where its own velocities lead, is right, and these are left out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.dead_reckoning import Reckoning
from gateway.estimators.inertial import between, displaced
from gateway.reckon.cells import CELL_S, SECOND_CELLS
from gateway.reckon.proving import compared, is_proved
from gateway.reckon.tip import (
    DISAGREES,
    JUMPED,
    NOTHING,
    VELOCITY_JUMPED,
    VELOCITY_ONLY,
    WALKED_OFF,
    Tip,
    hypothesis,
    with_each,
    with_hypothesis,
    with_rows,
)
from gateway.reckon.walking import OFF_MPS, WANDERS_M, followed, forgotten, walks_away, walks_still
from gateway.settings import DeadReckoning

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FAR = 43.6  # chi-square of four degrees, passed once in 10^8: ten hours have 72 000 positions
WALKED = 33.4  # once in 10^6: they have 7200 hypotheses
UNHELD = 3.0  # times as much where nothing holds the velocity: gusts are rarer and stronger than any sigma says
NEAR = 13.3  # once in a hundred
AGREES_FOR = 10  # positions in a row, half a second apart, until one that was refused is believed
TRUSTED_AFTER = 30 * SECOND_CELLS  # since it began: before that it has not learnt its own errors
TELLS_AT_S = 14.0  # so old is the hypothesis that says which walks would be denied
OLD_ENOUGH = 4 * SECOND_CELLS  # a hypothesis without GPS that denies
WANDERS_MPS = 0.15  # what good sources' errors change by within half a minute, beside `walking.WANDERS_M`
LEAST_M, LEAST_MPS = 0.5, 0.1  # of the scatter that a source is taken to have
MOST_TIMES = 10.0  # the least, or what is stated if that is more: no source is taken to scatter by more
LEARNS = 0.05  # of each position, for the scatter
LASTS = 2.0  # how many positions in a row a source's error is the same for, about


def judged(tip: Tip, place: Floats, late_s: Floats, held: Bools, unseen: Floats, settings: DeadReckoning) -> Tip:
    """The tips with a position each (n, 9), see `told.PLACE`, told so long (n,) before; refused ones are not worked in.

    `held` (n,): whether wings or wheels hold the velocity; `unseen` (n, 3): what shakes the units, m/s2 in a root Hz.
    """
    motion = tip.state.motion
    late = late_s[:, None, None]
    told = (place[:, None, column] for column in range(3))
    height = np.where(np.isnan(place[:, None, 2]), motion.height_m, place[:, None, 2])
    latitude, longitude, _ = told
    off = between(latitude, longitude, height, motion) + motion.velocity_mps * late
    told_faster = place[:, None, 3:6] + tip.accelerated_mps2[:, None] * late - motion.velocity_mps
    parted = tip.denied == VELOCITY_ONLY
    faster = _of_believed(told_faster, tip)
    worst = _square(off[..., :2], faster[..., :2], tip)
    tip, walked, square = followed(tip, place, late_s)
    refuses = np.array(settings.refuses)
    learnt = tip.cell - tip.began >= TRUSTED_AFTER
    # Until then what is far off is no jump: dead reckoning was never right beside this source, and learns from here on.
    tip = replace(tip, began=np.where(~learnt & (worst[:, 0] > FAR), tip.cell, tip.began))
    trusted = learnt & refuses
    jumps = trusted & (worst[:, 0] > FAR)
    old = tip.cell[:, None] - tip.seeded[:, 1:] >= OLD_ENOUGH
    bound = np.where(held, WALKED, UNHELD * WALKED * np.maximum(tip.times, 1.0))
    walks = (trusted & (held | is_proved(tip)))[:, None] & old & (worst[:, 1:] > bound[:, None])
    disagrees = walks_away(tip, square) & refuses & ~parted[:, None]
    refused, began_to_walk = tip.refused, tip.denied == VELOCITY_JUMPED
    placed, sped = _apart(off[:, :1, :2], told_faster[:, :1, :2], tip, jumps | parted | began_to_walk)
    leaves = walks_still(tip, square)
    parts = began_to_walk & (placed < NEAR) & (sped > FAR) & leaves
    joins = parted & (sped < NEAR) & ~leaves
    near = refused & (worst[:, 0] < NEAR) & ~(leaves & (tip.denied != JUMPED) & ~began_to_walk)
    agreed = np.where(near | parts | joins, tip.agreed + 1, 0)
    returns = (agreed >= AGREES_FOR) & ~parts
    by_unit = walks.any(axis=1)
    newly = ~refused & (jumps | by_unit | disagrees.any(axis=1))
    jumped = np.where(placed < NEAR, VELOCITY_JUMPED, JUMPED)
    why = np.where(jumps, jumped, np.where(by_unit, WALKED_OFF, DISAGREES))
    settled = np.where(agreed >= AGREES_FOR, np.where(parts, VELOCITY_ONLY, NOTHING), tip.denied)
    denied = np.where(newly, why, settled)
    state = _of_the_oldest(tip, walks, newly & ~jumps & by_unit)
    state = _walked_back(replace(tip, state=state), walked, disagrees, newly & ~jumps & ~by_unit)
    tip = compared(replace(tip, state=state, denied=denied, agreed=agreed), worst, old, unseen, trusted)
    tip = forgotten(replace(tip, told_from_mps=_told_from(tip, bound)), returns)
    accepted = np.flatnonzero(~tip.refused)
    if not len(accepted):
        return tip
    faster = _of_believed(told_faster, tip)[accepted, 0]
    return tip.put(accepted, _worked_in(tip.taken(accepted), off[accepted, 0], faster, place[accepted]))


def _of_believed(faster: Floats, tip: Tip) -> Floats:
    """Velocities (n, h, 3) without those that are left out."""
    return np.where((tip.denied == VELOCITY_ONLY)[:, None, None], np.nan, faster)


def _apart(off: Floats, faster: Floats, tip: Tip, which: Bools) -> tuple[Floats, Floats]:
    """Of some vehicles the squares of positions alone and of velocities alone (n,), by the first hypothesis; of others NaN."""
    placed, sped = np.full((2, len(tip)), np.nan)
    rows = np.flatnonzero(which)
    if len(rows):
        scatter = _expected(tip.taken(rows), ~np.isnan(faster[rows, :, :1]))[:, 0]
        for square, told, one in ((placed, off, slice(0, 2)), (sped, faster, slice(2, 4))):
            square[rows] = _normalised(told[rows, 0], scatter[:, one, one])
    return placed, sped


def _normalised(off: Floats, covariance: Floats) -> Floats:
    """Squared Mahalanobis distances (...) of vectors (..., k)."""
    return np.asarray(np.sum(off * np.linalg.solve(covariance, off[..., None])[..., 0], axis=-1))


def _square(off: Floats, faster: Floats, tip: Tip) -> Floats:
    """Squared Mahalanobis distances (n, h) of level positions and velocities (n, h, 2); a velocity that was not told is none."""
    has_velocity = ~np.isnan(faster[..., :1])
    both = np.concatenate([off, np.where(has_velocity, faster, 0.0)], axis=-1)
    return _normalised(both, _expected(tip, has_velocity))


def _expected(tip: Tip, has_velocity: Bools) -> Floats:
    """What good level positions and velocities are off by from hypotheses: the covariance (n, h, 4, 4)."""
    rows = np.array([0, 1, 3, 4])
    known = tip.state.covariance[..., rows[:, None], rows]
    place, speed = (tip.scatter_m2 + WANDERS_M**2)[:, None, None], (tip.scatter_mps2 + WANDERS_MPS**2)[:, None, None]
    shape = (*known.shape[:2], 2)
    noise = np.concatenate(
        [np.broadcast_to(place, shape), np.where(has_velocity, speed, 1e6) * np.ones(shape)],
        axis=-1,
    )
    return np.asarray(known + noise[..., None] * np.eye(4))


def _told_from(tip: Tip, bound: Floats) -> Floats:
    """The slowest walk (n,), m/s, with velocities to match, that the oldest hypothesis would deny, squares beyond a bound (n,)
    given; as before where that is young.
    """
    rows = np.arange(len(tip))
    oldest = 1 + np.argmin(tip.seeded[:, 1:], axis=1)
    age_s = (tip.cell - tip.seeded[rows, oldest]) * CELL_S
    walk = np.concatenate([age_s[:, None, None] * np.eye(2), np.broadcast_to(np.eye(2), (len(tip), 2, 2))], axis=1)
    expected = _expected(tip, np.ones((len(tip), 1, 1), np.bool_))[rows, oldest]
    per = np.swapaxes(walk, -1, -2) @ np.linalg.solve(expected, walk)
    mean = 0.5 * (per[:, 0, 0] + per[:, 1, 1])
    least = mean - np.hypot(0.5 * (per[:, 0, 0] - per[:, 1, 1]), per[:, 0, 1])
    return np.where(age_s >= TELLS_AT_S, np.sqrt(bound / np.maximum(least, 1e-12)), tip.told_from_mps)


def _of_the_oldest(tip: Tip, walks: Bools, which: Bools) -> Reckoning:
    """Where only hypotheses without GPS deny it, the oldest of those is what all go on with: it was led astray least."""
    rows = np.flatnonzero(which)
    if not len(rows):
        return tip.state
    age = np.where(walks[rows], tip.seeded[rows, 1:], np.iinfo(np.int64).max)
    best = 1 + np.argmin(age, axis=1)
    return with_rows(tip.state, rows, with_each(lambda one: one[rows, best], tip.state))


def _walked_back(tip: Tip, walked: Floats, which_say: Bools, which: Bools) -> Reckoning:
    """Where positions have walked from their velocities, all go on from the first hypothesis without that way, as far as
    the oldest of those that say so knows it.
    """
    rows = np.flatnonzero(which)
    if not len(rows):
        return tip.state
    age = np.where(which_say[rows], tip.seeded[rows, 1:], np.iinfo(np.int64).max)
    best = np.argmin(age, axis=1)
    back = np.zeros((len(rows), 3))
    back[:, :2] = -walked[rows, best]
    late_s = (tip.cell[rows] - tip.seeded[rows, 1 + best]) * CELL_S
    main = with_each(lambda one: one[rows, 0], tip.state)
    motion = main.motion
    latitude, longitude, _ = displaced(motion.latitude_rad, motion.longitude_rad, motion.height_m, back)
    covariance = main.covariance.copy()
    covariance[:, (0, 1), (0, 1)] += ((OFF_MPS * late_s) ** 2)[:, None]
    main = replace(main, motion=replace(motion, latitude_rad=latitude, longitude_rad=longitude), covariance=covariance)
    return with_rows(tip.state, rows, main)


def _worked_in(tip: Tip, off: Floats, faster: Floats, place: Floats) -> Tip:
    """The tips with a position each worked into their first hypotheses; what it was off by (n, 3), and its velocity."""
    stated_m, upright_m, stated_mps = place[:, 6], place[:, 7], place[:, 8]
    has_velocity = ~np.isnan(faster[:, 0])
    scatter_m2, sigma_m = _scatter(tip.scatter_m2, off, stated_m, LEAST_M)
    found, sigma_mps = _scatter(tip.scatter_mps2, np.nan_to_num(faster), stated_mps, LEAST_MPS)
    scatter_mps2 = np.where(has_velocity, found, tip.scatter_mps2)
    upright = np.where(np.isnan(place[:, 2]), 1e4, np.maximum(upright_m * sigma_m / stated_m, LEAST_M))
    down = np.where(np.isnan(faster[:, 2]), 1e3, sigma_mps)
    level = np.where(has_velocity, sigma_mps, 1e3)
    main = hypothesis(tip.state, 0)
    main = dr.with_measured(
        main,
        np.concatenate([off, np.nan_to_num(faster)], axis=-1),
        np.stack([sigma_m, sigma_m, upright, level, level, down], axis=-1),
    )
    return replace(
        tip,
        state=with_hypothesis(tip.state, 0, main),
        heard=tip.cell,
        scatter_m2=scatter_m2,
        scatter_mps2=scatter_mps2,
    )


def _scatter(known: Floats, off: Floats, stated: Floats, least: float) -> tuple[Floats, Floats]:
    """What a source scatters by (n,), squared, with one more vector (n, 3) of what it was off by; and the sigma to use."""
    square = np.minimum(0.5 * (off[:, 0] ** 2 + off[:, 1] ** 2), 9.0 * known + 9.0 * least**2)
    learnt = known + LEARNS * (square - known)
    learnt = np.clip(learnt, least**2, np.maximum(stated, MOST_TIMES * least) ** 2)
    return learnt, np.sqrt(LASTS * learnt)
