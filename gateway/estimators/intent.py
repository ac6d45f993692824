"""Intent: to which of some points an aircraft is going, by its course, its turn, and how soon it would be there.

Arrays are over n aircraft and c candidates. A place without a candidate is NaN and gets no weight. Two rules:

`default`   angles wrapped; while it turns, the angle still to turn in the direction of the turn; planned points count for minutes
`literal`   as printed: while it turns, how much the agreement has grown since the last step; planned points count for 17 s

Source: 000 2.2 eq 16 to 21.
Deviation: eq 16's arccos mirrors about north, so angles are taken with atan2. Eq 20's normalised Gaussians give the plan the
greater weight, against the paper's own words that regulation outweighs it: both are 1 for a point that is here now. "Somewhere
else" is a candidate too, of all courses alike, so that a point that does not fit is not believed for want of another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.modes import Modes
from gateway.estimators.turns_and_straights import or_zero
from gateway.geodesy import wrap_rad

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Rule = Literal["literal", "default"]

FULL_TURN = 2.0 * math.pi
ROLL_OUT_RAD = math.radians(15.0)
TURN_SURE = 0.9  # a turn less sure than this does not make forget what the straight before it said
BELIEVED = 0.6  # an inferred point with this share of the weight is believed
USED_IN_TURN_RAD = math.radians(25.0)  # but not in a turn that would have to go on further than this
ALIGNED_RAD = math.radians(7.5)  # a point this close to the course is flown at
# the rates of entering and leaving turns with the point ahead, to those without
ENTERS, LEAVES = 0.02 / 0.03, 0.10 / 0.03


@dataclass(frozen=True, slots=True)
class Inference:
    """How intent is inferred; angles in radians, times in seconds."""

    rule: Rule = "default"
    course_sigma: float = math.radians(5.0)  # of the direction to the point that it flies to, about its course; eq 17
    fade: float = 0.9  # of what was seen a second ago; eq 18
    regulation_sigma_s: float = 900.0  # of the time to go to a published or ordered point; eq 20
    plan_sigma_s: float = 170.0  # and to a planned one
    mean_turn: float = math.radians(60.0)  # what is left of a turn, on average, whatever was turned already
    kept: float = 10.0  # how much more a point counts in a turn that it was flown at just before

    @classmethod
    def of(cls, rule: Rule) -> Inference:
        """The settings of a rule."""
        return cls(rule, plan_sigma_s=17.0) if rule == "literal" else cls()

    @property
    def elsewhere(self) -> float:
        """The weight of "somewhere else" against that of a candidate dead ahead: all courses alike."""
        return self.course_sigma / math.sqrt(FULL_TURN)


@dataclass(frozen=True, slots=True)
class Seen:
    """What the past says of n aircraft and c candidates: sums since the last change of mode, and the last agreement."""

    agreed: Floats  # (n, c) faded sum of agreements
    length: Floats  # (n,) faded count of them; 0 = nothing yet
    last: Floats  # (n, c) the last agreement; NaN = none yet
    turning: Ints  # (n,) the last mode: 0 straight, 1 left, -1 right
    flown_at: Floats  # (n, c) the weight on the last straight, faded since it ended

    @classmethod
    def nothing(cls, aircraft: int, candidates: int) -> Seen:
        """Before anything was seen."""
        return cls(
            np.zeros((aircraft, candidates)),
            np.zeros(aircraft),
            np.full((aircraft, candidates), math.nan),
            np.zeros(aircraft, dtype=np.int64),
            np.zeros((aircraft, candidates)),
        )


@dataclass(frozen=True, slots=True)
class Belief:
    """Which candidate is believed, (n,), -1 = none; its share (n,), and that of each (n, c): the rest goes elsewhere.

    `direction` (n,) is the share of all that lie in its direction: two points in one line say the same for the next while.
    """

    best: Ints
    confidence: Floats
    share: Floats
    direction: Floats


def off_course(position: Floats, velocity: Floats, points: Floats) -> Floats:
    """How far to the left of its course (n, c) each point (n, c, 2) lies, of aircraft at (n, 2) with velocity (n, 2).

    Source: 000 2.2.1 eq 16.
    """
    way = points - position[:, None]
    along = way[..., 0] * velocity[:, None, 0] + way[..., 1] * velocity[:, None, 1]
    left = way[..., 1] * velocity[:, None, 0] - way[..., 0] * velocity[:, None, 1]
    return np.arctan2(left, along)


def to_turn(off: Floats, turning: Ints) -> Floats:
    """How far (n, c) aircraft that turn (n,), 1 to the left and -1 to the right, still have to, in [0, 2 pi).

    Who has turned a little too far is rolling out, and does not go round once more.
    """
    left = np.remainder(off * turning[:, None] + ROLL_OUT_RAD, FULL_TURN) - ROLL_OUT_RAD
    return np.abs(left)


def time_to_go(position: Floats, velocity: Floats, points: Floats) -> Floats:
    """Seconds (n, c) to each point straight on at the present ground speed. Source: 000 2.2.2, TTG."""
    way = points - position[:, None]
    speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])
    distance = np.sqrt(way[..., 0] * way[..., 0] + way[..., 1] * way[..., 1])
    return np.asarray(distance / np.maximum(speed, 1.0)[:, None])


def seen(before: Seen, off: Floats, turning: Ints, elapsed_s: Floats, inference: Inference) -> tuple[Seen, Floats]:
    """What is seen now added to the past, and the weight (n, c) of each candidate by course. Source: 000 2.2.1 eq 17 to 19.

    `off` (n, c) as from `off_course`, `turning` (n,) the likeliest mode, `elapsed_s` (n,) since the last call.
    """
    agreement = np.exp(-0.5 * (off / inference.course_sigma) ** 2)
    fresh = turning != before.turning
    kept = np.where(fresh, 0.0, inference.fade**elapsed_s)
    agreed = or_zero(before.agreed) * kept[:, None] + agreement
    length = before.length * kept + 1.0
    straight = agreed / length[:, None]
    flown_at = np.where((turning == 0)[:, None], straight, before.flown_at * (inference.fade**elapsed_s)[:, None])
    after = Seen(agreed, length, agreement, turning, flown_at)
    if inference.rule == "literal":
        manoeuvring = agreement - np.where(np.isnan(before.last), agreement, before.last)
    else:
        usual = np.exp(-to_turn(off, turning) / inference.mean_turn)
        manoeuvring = usual * (1.0 + inference.kept * or_zero(flown_at))
    return after, np.where((turning == 0)[:, None], straight, manoeuvring)


def by_time(time_s: Floats, planned: Bools, inference: Inference) -> Floats:
    """The weight (n, c) of points by the time to go, those of a plan (n, c) and others. Source: 000 2.2.2 eq 20."""
    sigma = np.where(planned, inference.plan_sigma_s, inference.regulation_sigma_s)
    return np.asarray(np.exp(-0.5 * (time_s / sigma) ** 2))


def believed(weight: Floats, off: Floats, inference: Inference) -> Belief:
    """The candidate of the greatest weight (n, c), NaN or not above 0 = none, and its share. Source: 000 2.2.2 eq 21.

    `off` (n, c) as from `off_course`. Under `literal` there is no "somewhere else": the share is among the candidates.
    """
    usable = np.where(weight > 0.0, weight, 0.0)
    best = usable.argmax(axis=1)
    rest = 0.0 if inference.rule == "literal" else inference.elsewhere
    total = usable.sum(axis=1) + rest
    share = usable / np.where(total > 0.0, total, 1.0)[:, None]
    confidence = share.max(axis=1)
    near = np.abs(wrap_rad(off - np.take_along_axis(off, best[:, None], axis=1))) <= ALIGNED_RAD
    direction = np.where(near, share, 0.0).sum(axis=1)
    return Belief(np.where(confidence > 0.0, best, -1), confidence, share, direction)


def transition(modes: Modes, elapsed_s: Floats, aligned: Bools) -> Floats:
    """Probabilities (n, m, m) of being in mode j after times (n,) when in mode i before, for aircraft `aligned` (n,) or not.

    Who flies at the point that he is believed to go to goes on straight, and who turns rolls out. Of the paper's three modes,
    kept with 0.97 over a second, that makes 0.98 of straight flight and 0.90 of turns. Source: 000 2.2, feedback.
    """
    usual = modes.transition(elapsed_s)
    straight = np.array([mode.turn == 0.0 for mode in modes.modes])
    changes = straight[:, None] != straight[None, :]
    factor = np.where(straight, ENTERS, LEAVES)
    leaving = np.where(changes, usual, 0.0)
    total = leaving.sum(axis=2, keepdims=True)
    wanted = 1.0 - (1.0 - total) ** np.where(aligned[:, None], factor, 1.0)[:, :, None]
    leaving = leaving * (wanted / np.maximum(total, 1e-300))
    staying = np.where(changes, 0.0, usual)
    staying = staying * ((1.0 - wanted) / np.maximum(1.0 - total, 1e-300))
    return np.asarray(np.where(aligned[:, None, None], leaving + staying, usual))
