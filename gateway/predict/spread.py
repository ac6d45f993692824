"""How sure a prediction is: sigmas along and across the course that is foretold.

What is not known adds up: where it is and how fast now, what speed and course it will take, when it will turn, whether it
keeps to its way at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.turns_and_straights import or_zero
from gateway.estimators.two_segment import Ahead
from gateway.predict.thinking import Motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ALONG_POINTS, ENDS_LANDED, ENDS_ROUND, ROUND_A_POINT, BY_MODEL = range(5)
"""What is known of a way: points to its end and maybe beyond it; to a landing; to a circle; on a circle; nothing."""

# How early or late it is on a way along points, seconds: a share of the time, more for each radian of turns on the way and for
# each radian that it turned lately, and where it is to fly slower. Beside the way: autopilots wander about a line, swing over
# after a turn, and more while they are in one. What turns bring is a share of the time in which a turn goes through a radian.
CRUISE, LATE_A_TURN, LATE_IN_TURN, LATE_SLOWER, LATE_LANDED_S = 0.009, 0.056, 0.14, 0.05, 6.0
# along and across, shares of speed, past the end of the way: it has landed, it circles, nobody knows
SOON_S = 6.0  # before a way's end: it flares, or turns aside onto a circle
ROUND_S = 2.5  # half of the time in which it flies the radius of a circle that nobody says
RESTS, ROUNDS, GOES_ANYWHERE = (0.4, 0.0), (0.25, 0.25), (1.2, 0.7)
WANDERS_S, WANDERS_FOR_S, WANDERS_A_TURN = 0.026, 3.0, 0.006
AFTER_TURN, AFTER_FOR_S = 0.03, 60.0  # who is in a turn comes back to its line slowly
LANDED_ASIDE_S = 0.07  # on the ground nothing brings it back to its line
ROUND_WANDERS_S = 0.3
SWINGS, SWINGS_NOW, SWINGS_FOR_S = 0.12, 0.45, 1.2
ACCELERATES_S = 2.7  # who changes its speed goes on doing so for this long
# of the mean square of gusts: how far off the speed that is kept is, and for how many seconds what comes lasts, twice
CRUISE_OFF, GUST_LASTS_S = 1.2, 11.0
ON_LINE_RAD = 0.3  # who has turned by more flies along a line between two points
SETTLES_S = 14.0  # after a turn
EARLY_S, EARLY = 2.0, 0.06  # how much earlier and later the way is looked at
MANOEUVRES = 0.02  # rad2/s of course: how fast a course wanders that nobody has declared, turns and straights together
DOUBTED = 0.9  # below this confidence a declared way may also be another one
LEAST_DOUBT = 0.02  # of an inferred point
# a told wind may be wrong by so much at first, and for good; an unknown one is this share of the speed
TOLD_WIND_MPS, WIND_MPS, UNKNOWN_WIND = 2.5, 0.3, 0.1


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


def wind_sigma(now: Motions, winds: Floats) -> Floats:
    """How far (n,) the wind is from what it is taken for, (n, 2), 0 = nobody told it: m/s an axis.

    What a vehicle says of it, it learns in turns.
    """
    told = (winds != 0.0).any(axis=1)
    learnt = np.sqrt((TOLD_WIND_MPS / (1.0 + now.turned)) ** 2 + WIND_MPS**2)
    return np.asarray(np.where(told, learnt, UNKNOWN_WIND * now.speed))


def spread(
    now: Motions,
    whole: Ahead,
    horizons_s: Floats,
    place_sigma: Floats,
    kinds: Ints,
    confidence: Floats,
    inferred: Bools,
    heads_round: Bools,
    wind_mps: Floats,
) -> Spread:
    """Of n aircraft's predictions at horizons (n, h), of the kinds (n,) named above, believed with a confidence (n,).

    Where the point is `inferred` (n,), that it flies there now is all that speaks for it; who `heads_round` (n,) a circle keeps
    to no line.

    `whole` is the path at `beside`: who is early or late is somewhere else on it, which in a turn is also to one side.
    `wind_mps` (n,) is how far the wind may be from what it is taken for, m/s an axis.
    """
    t, h = horizons_s, horizons_s.shape[1]
    speed, kind = now.speed[:, None], kinds[:, None]
    by_model, lands, rounds = kind == BY_MODEL, kind == ENDS_LANDED, kind == ENDS_ROUND
    turned, over = whole.turned[:, :h], whole.over_s[:, :h]
    radian_s = 1.0 / now.turning[:, None]
    turns_s, lately_s = turned * radian_s, (turned - whole.turned[:, 3 * h :]) * radian_s
    in_turn_s = now.unsettled[:, None] * radian_s
    ends_along, ends_across = (
        np.where(lands, RESTS[axis], np.where(rounds, ROUNDS[axis], GOES_ANYWHERE[axis])) * over for axis in (0, 1)
    )
    late = (CRUISE * t) ** 2 + (LATE_A_TURN * turns_s) ** 2 + (LATE_IN_TURN * in_turn_s) ** 2
    soon = t > _ends_s(whole, t)[:, None] - SOON_S
    landed = lands & soon
    late = late + (LATE_SLOWER * whole.slower_s[:, :h]) ** 2 + np.where(landed, LATE_LANDED_S**2, 0.0)
    late = late + ends_along * ends_along
    wanders = WANDERS_S**2 * np.where(turned > ON_LINE_RAD, 1.0, 1.0 - np.exp(-t / WANDERS_FOR_S))
    swings = SWINGS_NOW**2 * np.exp(-t / SWINGS_FOR_S) + AFTER_TURN**2 * np.exp(-t / AFTER_FOR_S)
    swings = (SWINGS * lately_s) ** 2 + in_turn_s * in_turn_s * swings
    at_circle = ROUND_WANDERS_S**2 * heads_round[:, None]
    beside_s = wanders + at_circle + swings + (WANDERS_A_TURN * turns_s) ** 2 + ends_across * ends_across
    beside_s = beside_s + np.where(landed, LANDED_ASIDE_S**2, 0.0)
    doubt = np.maximum(DOUBTED - np.where(np.isnan(confidence), DOUBTED, confidence), 0.0)[:, None]
    doubt = np.where(inferred[:, None], np.maximum(1.0 - or_zero(confidence), LEAST_DOUBT)[:, None], doubt)
    unknown = MANOEUVRES * speed * speed * np.where(by_model, 1.0, doubt) * t**3
    place = place_sigma[:, None] ** 2 + np.where(kind == ROUND_A_POINT, (0.25 * speed * t) ** 2, 0.0)
    place = place + np.where(rounds & soon, (ROUND_S * speed) ** 2, 0.0)
    gains = (ACCELERATES_S * now.acceleration[:, None]) ** 2 + np.where(
        by_model, now.speed_sigma[:, None] ** 2, CRUISE_OFF * now.gusts[:, None]
    )
    by_points = speed * speed * late + _of_wind(now, whole, t, wind_mps) + GUST_LASTS_S * now.gusts[:, None] * t
    along = place + gains * t * t + np.where(by_model, 0.0, by_points) + unknown / 6.0
    off_line = speed * speed * beside_s + _to_side(whole, t) * late
    drifts = np.where(by_model, (now.speed_sigma[:, None] * t) ** 2, off_line)
    return Spread(np.sqrt(along), np.sqrt(place + drifts + unknown / 3.0))


def _ends_s(whole: Ahead, t: Floats) -> Floats:
    """When (n,) the ways end, seconds from now; infinite = after all that is foretold."""
    over_s = whole.over_s[:, 3 * t.shape[1] - 1]
    return np.where(over_s > 0.0, (1.0 + EARLY) * t[:, -1] + EARLY_S - over_s, np.inf)


def _to_side(whole: Ahead, t: Floats) -> Floats:
    """How far (n, h) to one side of where it should be it is for each second that it is early or late there, m/s, squared."""
    h = t.shape[1]
    here, course = whole.position[:, :h], whole.course[:, :h]
    cosine, sine = np.cos(course), np.sin(course)
    squares = np.zeros(t.shape)
    for part in (slice(h, 2 * h), slice(2 * h, 3 * h)):
        off = whole.position[:, part] - here
        squares = squares + (off[..., 1] * cosine - off[..., 0] * sine) ** 2
    return 0.5 * squares / (EARLY_S + EARLY * t) ** 2  # the mean over a Gaussian, at three places


def _of_wind(now: Motions, whole: Ahead, t: Floats, wind_mps: Floats) -> Floats:
    """What a wrong wind makes (n, h), m2: it is felt as far as the way leads elsewhere than straight on, where it is known.

    Who flies on at his ground speed is where it leads whatever the wind.
    """
    elsewhere = whole.position[:, : t.shape[1]] - now.position[:, None] - now.velocity[:, None] * t[..., None]
    squares = elsewhere[..., 0] ** 2 + elsewhere[..., 1] ** 2
    return np.asarray(squares * (wind_mps / np.maximum(now.speed, 1.0))[:, None] ** 2)
