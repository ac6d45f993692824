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

# How early or late it is on a way along points, seconds: a share of the time, more for each radian of turns on the way and for
# each radian that it turned lately, and more towards a landing. Beside the way: an amount that grows slowly, and what is left
# of a turn. Measured on SITL's aeroplanes (docs/papers/000-intent.md); in seconds they hold for a boat of 5 m/s as well.
LATE, LATE_A_TURN, LATE_IN_TURN, LATE_LANDING = 0.01, 0.75, 0.9, 0.05
BESIDE, BESIDE_GROWS, BESIDE_AFTER_TURN = 0.01, 0.7, 0.8
TURNING_S, TURNING_FADES_S = 1.8, 25.0  # beside the way of who turned lately, and its fading
UNSETTLED_RAD = 0.25  # by at least so much
SETTLES_S = 10.0  # after a turn
EARLY_S, EARLY = 2.0, 0.06  # how much earlier and later the way is looked at
MANOEUVRES = 0.02  # rad2/s of course: how fast a course wanders that nobody has declared, turns and straights together
ACCELERATES_S = 6.0  # who changes its speed goes on doing so for this long
DOUBTED = 0.9  # below this confidence the way may also be another one


@dataclass(frozen=True, slots=True)
class Spread:
    """Standard deviations (n, h) of a prediction, metres."""

    along: Floats
    across: Floats


def beside(horizons_s: Floats) -> Floats:
    """The horizons (n, h), then those a little earlier, a little later, and before a turn: (n, 4 h)."""
    early = EARLY_S + EARLY * horizons_s
    before = [np.maximum(horizons_s - early, 0.0), horizons_s + early, np.maximum(horizons_s - SETTLES_S, 0.0)]
    return np.concatenate([horizons_s, *before], axis=1)


def spread(
    now: Motions,
    whole: Ahead,
    horizons_s: Floats,
    place_sigma: Floats,
    kinds: Ints,
    confidence: Floats,
) -> Spread:
    """Of n aircraft's predictions at horizons (n, h), of the kinds (n,) named above, believed with a confidence (n,).

    `whole` is the path at `beside`: who is early or late is somewhere else on it, which in a turn is also to one side.
    """
    t, h = horizons_s, horizons_s.shape[1]
    speed, kind = now.speed[:, None], kinds[:, None]
    here, course, turned = whole.position[:, :h], whole.course[:, :h], whole.turned[:, :h]
    lately = turned - whole.turned[:, 3 * h :]
    landing = np.where(kind == ENDS_LANDED, LATE_LANDING * t, 0.0)
    late = (LATE * t) ** 2 + (LATE_A_TURN * turned) ** 2 + (LATE_IN_TURN * lately) ** 2 + landing**2
    way = np.stack([np.cos(course), np.sin(course)], axis=-1)
    to_side = np.zeros(t.shape)
    for part in (slice(h, 2 * h), slice(2 * h, 3 * h)):
        off = whole.position[:, part] - here
        to_side = to_side + (off[..., 1] * way[..., 0] - off[..., 0] * way[..., 1]) ** 2
    to_side = (
        0.5 * to_side * late / (EARLY_S + EARLY * t) ** 2
    )  # the mean over a Gaussian of sigma `late`, at three places
    turning = TURNING_S * np.minimum(now.unsettled / UNSETTLED_RAD, 1.0)[:, None] * np.exp(-t / TURNING_FADES_S)
    beside_s = (BESIDE * t**BESIDE_GROWS) ** 2 + (BESIDE_AFTER_TURN * lately) ** 2 + turning * turning
    over = np.where(kind == ENDS_LANDED, 0.0, whole.over_s[:, :h])
    free = np.where(kind == BY_MODEL, t, over)
    doubt = np.where(kinds == BY_MODEL, 0.0, np.maximum(DOUBTED - np.nan_to_num(confidence, nan=DOUBTED), 0.0))[:, None]
    unknown = MANOEUVRES * speed * speed * (free**3 + doubt * t**3)
    radius = speed / now.turning[:, None]
    round_about = np.where((kind == ENDS_ROUND) & (over > 0.0), (1.5 * radius) ** 2, 0.0)
    round_about = round_about + np.where(kind == ROUND_A_POINT, (0.25 * speed * t) ** 2, 0.0)
    place = place_sigma[:, None] ** 2 + round_about
    gains = now.speed_sigma[:, None] ** 2 + (ACCELERATES_S * now.acceleration[:, None]) ** 2
    by_points = kind != BY_MODEL
    along = place + gains * t * t + np.where(by_points, speed * speed * late, 0.0) + unknown / 6.0
    drifts = np.where(by_points, speed * speed * beside_s + to_side, (now.speed_sigma[:, None] * t) ** 2)
    return Spread(np.sqrt(along), np.sqrt(place + drifts + unknown / 3.0))
