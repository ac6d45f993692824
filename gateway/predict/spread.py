"""How sure a prediction is: sigmas along and across the course that is foretold.

What is not known adds up: where it is and how fast now, what speed and course it will take, when it will turn, whether it
keeps to its way at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.two_segment import Ahead
from gateway.predict.thinking import Motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


ALONG_POINTS, ENDS_LANDED, ENDS_ROUND, ROUND_A_POINT, BY_MODEL = range(5)
"""What is known of a way: points to its end and maybe beyond it; to a landing; to a circle; on a circle; nothing."""

MANOEUVRES = 0.02  # rad2/s of course: how fast a course wanders that nobody has declared, turns and straights together
ON_COURSE_M = 2.0  # of who flies along points
EARLY_S, EARLY = 1.0, 0.03  # seconds, and of the horizon: so much earlier or later may it be anywhere on its way


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations (n, h) of a prediction, metres."""

    along: Floats
    across: Floats


def beside(horizons_s: Floats) -> Floats:
    """The horizons (n, h), then those a little earlier and those a little later: (n, 3 h), what `spread` wants to see."""
    early = EARLY_S + EARLY * horizons_s
    return np.concatenate([horizons_s, np.maximum(horizons_s - early, 0.0), horizons_s + early], axis=1)


def spread(
    now: Motions, whole: Ahead, horizons_s: Floats, place_sigma: Floats, speed_sigma: Floats, kinds: Ints
) -> Spread:
    """Of n aircraft's predictions at horizons (n, h), of the kinds (n,) named above.

    `whole` is the path at `beside`: who is early or late is somewhere else on it, which in a turn is also to one side.
    """
    t, h = horizons_s, horizons_s.shape[1]
    speed = now.speed[:, None]
    here, course = whole.position[:, :h], whole.course[:, :h]
    way = np.stack([np.cos(course), np.sin(course)], axis=-1)
    along, across = np.zeros(t.shape), np.zeros(t.shape)
    for part in (slice(h, 2 * h), slice(2 * h, 3 * h)):
        off = whole.position[:, part] - here
        along = along + 0.5 * (off * way).sum(axis=2) ** 2
        across = across + 0.5 * (off[..., 1] * way[..., 0] - off[..., 0] * way[..., 1]) ** 2
    known = place_sigma[:, None] ** 2 + (speed_sigma[:, None] * t) ** 2
    over = np.where(kinds[:, None] == ENDS_LANDED, 0.0, whole.over_s[:, :h])
    free = np.where(kinds[:, None] == BY_MODEL, t, over)
    radius = speed / now.turning[:, None]
    round_about = np.where((kinds[:, None] == ENDS_ROUND) & (over > 0.0), (1.5 * radius) ** 2, 0.0)
    round_about = round_about + np.where(kinds[:, None] == ROUND_A_POINT, (0.25 * speed * t) ** 2, 0.0)
    unknown = MANOEUVRES * speed * speed * free**3
    return Spread(
        np.sqrt(known + along + unknown / 6.0 + round_about),
        np.sqrt(place_sigma[:, None] ** 2 + ON_COURSE_M**2 + across + unknown / 3.0 + round_about),
    )
