"""What became of earlier predictions: by how much sigmas were too small or too large for each track, and are so from now on.

Of each of the first horizons a few predictions are kept until they come due. Then the track itself tells how far off they were,
in sigmas along and across; the mean of that, against what it would be for a Gaussian, faded, scales the sigmas that follow.
Predictions without a turn and such with one learn apart. It begins as half of what the horizon before has learnt, which comes due
sooner, the first as "as they should be": who is off by more than others in ten seconds is so in a minute too.

Arrays are over n tracks. A track knows only what it has seen itself, at instants of its own predictions: how arrivals fall into
ticks changes nothing.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.predict.minds import KEPT, LEARNT, NOT_KEPT, Minds
from gateway.predict.spread import Spread
from gateway.predict.states import State

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PRIOR = 1.0  # horizons' worth of predictions that were as far off as is thought to begin with
MEMORY = 20.0  # horizons after which what was learnt has faded to a third
AT_MOST = 3.0  # of the sigmas now: who is off by more counts no more, or few would make all others' sigmas too large
USUAL = 0.7971  # the mean size of a Gaussian's values of sigma 1 that count at most so much
LEAST, MOST = 1.0 / 3.0, 10.0  # scales
LEAST_SIGMA_M = 0.01
FRESH_S = 2.0  # a track without a measurement for longer does not know where it is
MOVING_MPS = 3.0  # slower, there is no course that a prediction could be off along or across


def learnt(minds: Minds, at: int, state: State, horizons_s: tuple[float, ...]) -> Minds:
    """The same with what comes due at an instant, of tracks in such states, held against where they are."""
    due_at = minds.due_at
    late_s = (at - due_at) / SECOND
    due = (late_s >= 0.0) & (late_s < 1.0) & (state.since_s <= FRESH_S)[:, None, None]
    row, horizon, place = np.nonzero(due)  # of most instants nothing comes due
    if not len(row):
        return minds
    foretold = minds.foretold[row, horizon, place]
    off = state.position[row] - late_s[row, horizon, place][:, None] * state.velocity[row] - foretold[:, 0:2]
    cosine, sine = np.cos(foretold[:, 2]), np.sin(foretold[:, 2])
    along = np.abs(off[:, 0] * cosine + off[:, 1] * sine) / np.maximum(foretold[:, 3], LEAST_SIGMA_M)
    across = np.abs(off[:, 1] * cosine - off[:, 0] * sine) / np.maximum(foretold[:, 4], LEAST_SIGMA_M)
    worth = np.array([_every(one) / one for one in horizons_s[:LEARNT]])
    worth = np.concatenate([worth, np.zeros(LEARNT - len(worth))])
    slots = row, (foretold[:, 5] == 1.0).astype(np.int64), horizon
    most = AT_MOST * _scale(minds.sigmas[row], minds.counted[row])[horizon, np.arange(len(row)), slots[1]]
    sigmas, counted = np.zeros(minds.sigmas.shape), np.zeros(minds.counted.shape)
    np.add.at(sigmas, slots, np.minimum(np.stack([along, across], axis=-1), most))
    np.add.at(counted, slots, 1.0)
    sigmas, counted = sigmas * worth[:, None], counted * worth
    keep = np.exp(-counted / MEMORY)
    return replace(
        minds,
        due_at=np.where(due, NOT_KEPT, due_at),
        sigmas=minds.sigmas * keep[..., None] + sigmas,
        counted=minds.counted * keep + counted,
    )


def scaled(minds: Minds, spread: Spread, turns: Bools) -> Spread:
    """Sigmas (n, h) as the tracks' own past says they are; `turns` (n, h) where the way or the aircraft turns."""
    scale = _scale(minds.sigmas, minds.counted)
    slots = np.minimum(np.arange(turns.shape[1]), LEARNT - 1)
    each = scale[slots, np.arange(len(turns))[:, None], turns.astype(np.int64)]
    return Spread(spread.along * each[..., 0], spread.across * each[..., 1])


def _scale(sigmas: Floats, counted: Floats) -> Floats:
    """What sigmas are scaled by (LEARNT, n, 2, 2), of `Minds.sigmas` and `Minds.counted`."""
    known, room = np.ascontiguousarray(np.moveaxis(sigmas, 2, 0)) / USUAL, PRIOR + np.moveaxis(counted, 2, 0)
    begins: Floats | float = PRIOR
    for horizon in range(LEARNT):
        one = known[horizon]
        one += begins
        one /= room[horizon, ..., None]
        begins = PRIOR * np.sqrt(one)
    return np.asarray(np.minimum(np.maximum(known, LEAST), MOST))


def kept(
    minds: Minds,
    at: int,
    horizons_s: tuple[float, ...],
    mean: Floats,
    course: Floats,
    spread: Spread,
    turns: Bools,
    moves: Bools,
) -> Minds:
    """The same with what is foretold at an instant: places (n, h, 2), courses, sigmas before they are scaled.

    `moves` (n,) who moves fast enough to be held to it.
    """
    due_at, foretold = minds.due_at, minds.foretold
    second = at // SECOND
    now = [place for place, one in enumerate(horizons_s[:LEARNT]) if second % _every(one) == 0]
    if not now:
        return minds
    due_at, foretold = due_at.copy(), foretold.copy()
    for place in now:
        slot = second // _every(horizons_s[place]) % KEPT
        due_at[:, place, slot] = np.where(moves, at + int(horizons_s[place] * SECOND), NOT_KEPT)
        columns = (
            mean[:, place, 0],
            mean[:, place, 1],
            course[:, place],
            spread.along[:, place],
            spread.across[:, place],
        )
        foretold[:, place, slot] = np.stack([*columns, turns[:, place].astype(np.float64)], axis=-1)
    return replace(minds, due_at=due_at, foretold=foretold)


def _every(horizon_s: float) -> int:
    """How many seconds lie between those that are kept: so many that the first comes due before the last place is taken."""
    return max(math.ceil(horizon_s / (KEPT - 1)), 1)
