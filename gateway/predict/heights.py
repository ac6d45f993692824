"""Heights along a prediction: on at the present climb to the planned height, and down the glide path to a landing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.two_segment import Ahead
from gateway.predict.thinking import Motions

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LEAST_CLIMB_MPS = 0.3  # who climbs less than this and is not where it should be begins to
PITCH = 0.08  # climb per ground speed of who has not begun yet


def heights(
    up_now: Floats,
    climb_now: Floats,
    now: Motions,
    ahead: Ahead,
    planned_up: Floats,
    lands: Bools,
    route: Floats,
    horizons_s: Floats,
) -> Floats:
    """Heights (n, h) of n aircraft at heights and with climbs (n,): `planned_up` (n, 4) of their routes' points, NaN = none.

    To a point that is landed at, `lands` (n, 4), the way is straight down, from here or from the point before it.
    Source: 000 2.3, vertical.
    """
    wanted = planned_up[:, 0]
    known = ~np.isnan(wanted) & ahead.follows
    free = up_now[:, None] + climb_now[:, None] * horizons_s
    gap = np.where(known, wanted - up_now, 0.0)
    toward = climb_now * gap > 0.0
    climb = np.where(toward & (np.abs(climb_now) > LEAST_CLIMB_MPS), climb_now, np.sign(gap) * PITCH * now.speed)
    reached = up_now[:, None] + np.sign(gap)[:, None] * np.minimum(
        np.abs(climb)[:, None] * horizons_s, np.abs(gap)[:, None]
    )
    up = np.where(known[:, None], reached, free)
    before = np.concatenate([up_now[:, None], planned_up[:, :-1]], axis=1)
    places = np.concatenate([now.position[:, None], route[:, :-1]], axis=1)
    for leg in np.flatnonzero(lands.any(axis=0)).tolist():  # of a crowd in the air, none
        here = lands[:, leg] & ahead.follows & ~np.isnan(planned_up[:, leg]) & ~np.isnan(before[:, leg])
        whole, left = _length(route[:, leg] - places[:, leg]), _length(route[:, leg, None] - ahead.position)
        share = np.clip(left / np.maximum(whole, 1.0)[:, None], 0.0, 1.0)
        down = planned_up[:, leg, None] + share * (before[:, leg] - planned_up[:, leg])[:, None]
        on = here[:, None] & (ahead.passed >= leg)
        up = np.where(on, np.where(ahead.passed > leg, planned_up[:, leg, None], down), up)
    return np.asarray(up)


def _length(way: Floats) -> Floats:
    """Of ways (..., 2)."""
    return np.asarray(np.sqrt(way[..., 0] * way[..., 0] + way[..., 1] * way[..., 1]))
