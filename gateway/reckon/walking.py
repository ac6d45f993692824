"""Whether a position walks away from the velocity that is told beside it.

A receiver finds its velocity from other measurements than its position, and an autopilot works both into one estimate: where
positions are good, what lies between two of them is what the velocities between add up to, within a few metres in twenty
seconds. It needs no inertial unit: a copter that tells its own twice a second, too seldom to be carried on by it, is told of
a false position by this alone. One whose velocities are false too must be found by how it moves.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import Motion, between
from gateway.reckon.cells import CELL_S
from gateway.reckon.tip import NOTHING, Tip

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PAUSE_S = 1.6  # between two positions: beyond it nobody knows how it went
FOLLOWED = 40  # positions without a longer pause: before that an autopilot may still be finding where it is
REACQUIRED_S = 6.0  # that much longer: radios pause for so long; what found its fix again may be led back to it
OFF_MPS = 0.25  # an axis: what velocities are off by for half a minute
WANDERS_M = 1.5  # an axis: what good positions wander by meanwhile
DEGREES = 2.0
APART = 27.6  # chi-square of two degrees, passed once in 10^6
TOGETHER = 9.2  # once in a hundred
OLD_S, FRESH_S = 4.0, 11.0  # since when it is looked at; and hypotheses as young as that say whether it walks now
TIMES = 3.0  # what it usually strays by, or should: a position counts as so much at most, so that walks are not learnt
REMEMBERS = 400.0  # the mean of what a source strays by is of so many positions, at most


def followed(tip: Tip, place: Floats, late_s: Floats) -> tuple[Tip, Floats, Floats]:
    """The tips with a position each (n, 9), see `told.PLACE`, told so long (n,) before; how far positions have walked from
    their velocities since hypotheses were split off (n, branches, 2), m; and the square of that, of what good ones do
    (n, branches), nought where it is not known.
    """
    motion, last = tip.state.motion, tip.last
    height = motion.height_m[:, 0]
    there = Motion(last[:, 0], last[:, 1], height, motion.velocity_mps[:, 0], motion.attitude[:, 0])
    took_s = (tip.cell - tip.placed) * CELL_S - late_s + last[:, 4]
    walked = between(place[:, 0], place[:, 1], height, there)[:, :2]
    walked = walked - 0.5 * (place[:, 3:5] + last[:, 2:4]) * took_s[:, None]
    known = (took_s > 0.0) & (took_s <= PAUSE_S) & np.isfinite(walked).all(axis=1)
    walks = np.where(known[:, None, None], tip.walked_m, 0.0)
    walks[:, 0] += np.where(known[:, None], walked, 0.0)
    count = np.where(known, tip.followed + 1, np.where(took_s <= REACQUIRED_S, tip.followed, 0))
    off = walks[:, :1] - walks[:, 1:]
    age_s = (tip.cell[:, None] - tip.seeded[:, 1:]) * CELL_S
    variance = 2.0 * WANDERS_M**2 + (OFF_MPS * age_s) ** 2
    square = np.where(age_s >= OLD_S, np.sum(off**2, axis=-1) / variance, 0.0)
    share = np.where(known & (tip.denied == NOTHING), 1.0 / np.minimum(count + 1.0, REMEMBERS), 0.0)
    most = np.where(count < FOLLOWED, math.inf, TIMES * np.maximum(tip.strays, 1.0))
    strays = tip.strays + share * (np.minimum(square.max(axis=1) / DEGREES, most) - tip.strays)
    last = np.concatenate([place[:, :2], place[:, 3:5], late_s[:, None]], axis=-1)
    return replace(tip, last=last, placed=tip.cell, walked_m=walks, followed=count, strays=strays), off, square


def walks_away(tip: Tip, square: Floats) -> Bools:
    """Which hypotheses say that positions walk away from their velocities (n, branches), by the squares of `followed`."""
    bound = APART * np.maximum(tip.strays, 1.0)
    return np.asarray((tip.followed >= FOLLOWED)[:, None] & (square > bound[:, None]))


def walks_still(tip: Tip, square: Floats) -> Bools:
    """Whether positions walk away now (n,)."""
    fresh = (tip.cell[:, None] - tip.seeded[:, 1:]) * CELL_S <= FRESH_S
    bound = TOGETHER * np.maximum(tip.strays, 1.0)
    return np.asarray((fresh & (square > bound[:, None])).any(axis=1))


def acquainted(tip: Tip, former: Tip) -> Tip:
    """A vehicle's tip that begins anew, with what an earlier one knew of its positions and their velocities."""
    return replace(tip, last=former.last, placed=former.placed, followed=former.followed, strays=former.strays)


def forgotten(tip: Tip, rows: Bools) -> Tip:
    """The tips with nothing that positions of some (n,) have walked by."""
    return replace(tip, walked_m=np.where(rows[:, None, None], 0.0, tip.walked_m))
