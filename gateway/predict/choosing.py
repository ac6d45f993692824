"""Which way aircraft are expected to go: where they say, if they keep to it, else to an inferred point, else nobody knows."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.circling import ON_CIRCLE, Circles
from gateway.estimators.intent import BELIEVED, USED_IN_TURN_RAD, Belief, Seen, to_turn
from gateway.estimators.turns_and_straights import or_zero
from gateway.frames import RunwayFrame
from gateway.geodesy import wrap_rad
from gateway.predict.goals import GO_AROUND, RUNWAY
from gateway.predict.joining import joining
from gateway.predict.minds import Minds
from gateway.predict.stacked import Stacked
from gateway.predict.table import DECLARED, INFERRED, NONE
from gateway.predict.thinking import Motions, inferred, trusted
from gateway.settings import Runway

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

TRUSTED = 0.5  # a declared goal with this trust is flown to
CIRCLE_LEAST, CIRCLE_MOST = 0.4, 2.0  # turn rate over that of a circle about the point: between them it is flown round
FINAL_M = 30_000.0  # before the aiming point begins the final
FINAL_RAD = math.radians(5.0)  # off the centreline as seen from the aiming point it is left


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """Which way n aircraft are expected to go."""

    route: Floats  # (n, 4, 2), NaN = the model's
    join: Floats  # (n, 2) where it comes back to the line to the first point, NaN = nowhere
    up: Floats  # (n, 4)
    lands: Bools  # (n, 4)
    over: Bools  # (n, 4)
    circles: Bools  # (n,) about a point, at a rate (n,)
    rate: Floats
    rounds: Circles
    ends_round: Bools  # (n,) the route ends at a point that is flown round
    best: Ints  # (n,) the candidate that is told, -1 = none
    kind: Ints
    confidence: Floats
    share: Floats  # (n, c) of each candidate; the rest goes elsewhere


@dataclass(frozen=True, slots=True, eq=False)
class _Declared:
    """The candidates (n,) that n aircraft say they go to, -1 = none, since when, and how each is flown."""

    place: Ints
    since: Ints
    goal: Floats  # (n, 2), NaN = none
    begins: Floats  # (n, 2) of the line to it, NaN = there is none
    circles: Bools
    rounds: Bools  # at a radius that nobody says
    radius: Floats  # NaN = it is not flown round, or at a radius that nobody says

    @classmethod
    def of(cls, goals: Stacked) -> _Declared:
        """As the goals have it."""
        rows, said = np.arange(len(goals.declared)), np.maximum(goals.declared, 0)
        return cls(
            goals.declared,
            goals.declared_at,
            np.where((goals.declared >= 0)[:, None], goals.route[rows, said, 0], math.nan),
            goals.begins,
            goals.circles[rows, said],
            goals.rounds[rows, said],
            goals.radius[rows, said, 0],
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Flown:
    """How n aircraft fly to one candidate each, as `Goals` has it."""

    route: Floats  # (n, 4, 2)
    up: Floats  # (n, 4)
    lands: Bools  # (n, 4)
    over: Bools  # (n, 4)
    ends_round: Bools  # (n,)
    radius: Floats  # (n, 4)
    least: Floats  # (n, 4)

    @classmethod
    def of(cls, goals: Stacked, slots: Ints) -> _Flown:
        """To these candidates (n,)."""
        at = np.arange(len(slots)), slots
        return cls(
            goals.route[at],
            goals.up[at],
            goals.lands[at],
            goals.over[at],
            goals.rounds[at],
            goals.radius[at],
            goals.least[at],
        )


def chosen(
    before: Minds, minds: Minds, at: int, now: Motions, goals: Stacked, climb: Floats, frame: RunwayFrame
) -> tuple[Chosen, Minds]:
    """What is believed of n aircraft that climb so fast (n,), and what is thought of them from now on."""
    declared = _Declared.of(goals)
    seen, belief, off = _inferred(before, at, now, goals, climb, frame)
    join = joining(now, declared.begins, declared.goal)
    trust = trusted(before, at, now, declared.goal, join, declared.circles, declared.since)
    trusts = or_zero(trust) >= TRUSTED
    left = to_turn(np.take_along_axis(or_zero(off), np.maximum(belief.best, 0)[:, None], axis=1), now.side)[:, 0]
    infers = (
        ~trusts & (belief.best >= 0) & (belief.direction > BELIEVED) & ((now.side == 0) | (left < USED_IN_TURN_RAD))
    )
    used, is_said = trusts | infers, declared.place >= 0
    best = np.where(trusts, declared.place, np.where(infers | ~is_said, belief.best, declared.place))
    kind = np.where(best < 0, NONE, np.where(best == declared.place, DECLARED, INFERRED))
    confidence = np.where(kind == NONE, math.nan, np.where(kind == DECLARED, trust, belief.confidence))
    circling, rate = _circling(now, declared.goal, trusts & declared.circles & declared.rounds)
    circled = _circled(before, now, declared)
    minds = replace(
        minds,
        agreed=seen.agreed,
        length=seen.length,
        last=seen.last,
        turning=seen.turning,
        flown_at=seen.flown_at,
        trust=or_zero(trust),
        declared_at=np.where(is_said, declared.since, before.declared_at),
        circled=circled,
    )
    slots = np.maximum(best, 0)
    flown = _Flown.of(goals, slots)
    least = flown.least
    least[:, 0] = np.maximum(least[:, 0] - np.where(best == declared.place, circled, 0.0), 0.0)
    way = Chosen(
        np.where((used & ~circling)[:, None, None], flown.route, math.nan),
        np.where((trusts & ~declared.circles)[:, None], join, math.nan),
        np.where(used[:, None], flown.up, math.nan),
        flown.lands & used[:, None],
        flown.over,
        circling,
        rate,
        Circles(np.where(used[:, None], flown.radius, math.nan), least),
        flown.ends_round & used,
        best,
        kind,
        confidence,
        _shares(belief.share, declared.place, trust),
    )
    return way, minds


def _shares(inferred_share: Floats, declared: Ints, trust: Floats) -> Floats:
    """How probably (n, c) each candidate is flown to: what is declared as far as it is trusted, the others share the rest."""
    rest = np.where(declared >= 0, 1.0 - or_zero(trust), 1.0)
    share = or_zero(inferred_share) * rest[:, None]
    said = np.flatnonzero(declared >= 0)
    share[said, declared[said]] = trust[said]
    return np.asarray(share)


def _inferred(
    before: Minds, at: int, now: Motions, goals: Stacked, climb: Floats, frame: RunwayFrame
) -> tuple[Seen, Belief, Floats]:
    """`thinking.inferred`, in which only who is on final lands or goes around."""
    final = _on_final(now, at, frame)
    lowered = goals.lowered.copy()
    lowered[:, RUNWAY] *= final
    lowered[:, GO_AROUND] *= final * _goes_around(now, climb, frame.runway)
    return inferred(before, at, now, goals.route[:, :, 0], goals.planned, lowered)


def _circling(now: Motions, centre: Floats, should: Bools) -> tuple[Bools, Floats]:
    """Who flies round a point (n, 2) as it `should` (n,), and the rate (n,) of the turn that stays at its distance."""
    way = centre - now.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    rate = now.speed / np.maximum(distance, 1.0)
    to_left = np.where(way[:, 1] * now.velocity[:, 0] - way[:, 0] * now.velocity[:, 1] > 0.0, 1.0, -1.0)
    turns_alike = (now.turn_rate * to_left > CIRCLE_LEAST * rate) & (now.turn_rate * to_left < CIRCLE_MOST * rate)
    return should & turns_alike, to_left * rate


def _circled(before: Minds, now: Motions, declared: _Declared) -> Floats:
    """How far (n,) each aircraft has flown round its declared point, rad."""
    way = declared.goal - now.position
    near = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1]) <= ON_CIRCLE * np.abs(declared.radius)
    turned = np.abs(wrap_rad(now.course - before.courses[:, 0]))
    return np.where(near & (before.declared_at == declared.since), before.circled + or_zero(turned), 0.0)


def _on_final(now: Motions, at: int, frame: RunwayFrame) -> Bools:
    """Who flies towards the runway, which may move, along its centreline, (n,)."""
    place, velocity, compass = now.position, now.velocity, frame.runway.landing_compass_rad
    if (deck := frame.deck) is not None:
        since_s = (at - deck.at) / SECOND
        place = place - (deck.enu_m + since_s * deck.velocity_mps)[:2]
        velocity, compass = velocity - deck.velocity_mps[:2], deck.compass_rad
    sine, cosine = math.sin(compass), math.cos(compass)
    along = place[:, 0] * sine + place[:, 1] * cosine - frame.runway.aiming_point_x_m
    left = place[:, 1] * sine - place[:, 0] * cosine
    flies = velocity[:, 0] * sine + velocity[:, 1] * cosine
    speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])
    aligned = flies > math.cos(math.radians(20.0)) * speed
    return (along < 0.0) & (along > -FINAL_M) & (np.abs(left) < 100.0 - along * math.tan(FINAL_RAD)) & aligned


def _goes_around(now: Motions, climb: Floats, runway: Runway) -> Floats:
    """How much likelier (n,) the climb is of who goes around than of who goes on down."""
    down = -now.speed * math.tan(runway.glide_path_rad)
    lands = np.exp(-0.5 * ((climb - down) / 1.5) ** 2)
    climbs = np.exp(-0.5 * ((np.minimum(climb, 2.0) - 2.0) / 1.5) ** 2)
    return np.asarray(np.clip(climbs / np.maximum(lands, 1e-6), 0.01, 100.0))
