"""How each aircraft moves now, to which candidate it goes, and whether it goes where it said: one round for many tracks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import intent
from gateway.estimators.intent import Belief, Inference
from gateway.estimators.turns_and_straights import or_zero
from gateway.geodesy import wrap_rad
from gateway.predict.minds import UNKNOWN, Minds

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

INFERENCE = Inference()
LEAST_SPEED_MPS = 3.0  # slower, a course says nothing
STALE_S = 10.0  # after a gap as long as this the course begins anew
LEAST_RATE_RPS = math.radians(0.75)  # a slower turn is none
SURE_SIGMAS = 3.0
STILL_THERE_RAD = math.radians(12.0)  # sigma of the course now about the direction to an inferred point
SPEED_SIGMAS = 1.5
WANDER_MEMORY_S = 20.0
WANDERS_LESS = 3.0  # a filter's velocity is wrong by no more than so often what it changes by in a second
SURE_AT_MOST = 0.25  # but by no less than this share of what the filter says
TURNS_RAD = 0.25  # who has turned by more lately is in a turn, or just out of one
CRUISE_S, CRUISE_IN_TURN_S, GUSTS_S = 10.0, 60.0, 40.0  # for how long a speed is remembered, and how it moves about
STEADY = 0.05  # of its speed, a second: who slows down faster has not come to another speed yet
ANOTHER_CRUISE = 0.12  # who flies straight and is faster or slower by such a share has taken up another speed
NEW_GOAL_S = 8.0  # a new goal was declared: how long it takes to take up another speed
UNSETTLED_S = 8.0  # how long a turn is felt

REACTS_S = 6.0  # after a new goal was declared the aircraft has this long to begin to turn
TOLERATED_RAD = math.radians(10.0)  # sigma of a follower's course about the way to its goal
WANDERS = 0.15  # likelihood of a course against a follower's best, if it does not go there
STOPS, RESUMES = 0.005, 0.01  # a second, of following
TRUSTED_AT_FIRST, TRUSTED_AGAIN = 0.8, 0.6  # where a goal is declared, and where another one is after a doubted one
NEAR_RADII = 2.5  # so many turn radii from its goal a course says nothing: it may be turning to the next one


@dataclass(frozen=True, slots=True)
class Motions:
    """n aircraft as they move: position (n, 2), velocity (n, 2), speed, course, side of the turn, turn rate (n,)."""

    position: Floats
    velocity: Floats
    speed: Floats
    course: Floats
    side: Ints  # 1 left, -1 right, 0 where no turn is sure
    turn_rate: Floats  # of the turn, 0 where there is none
    turning: Floats  # how fast it turns when it does, rad/s
    acceleration: Floats  # of the ground speed, as far as it is sure, m/s2
    speed_sigma: Floats  # of the velocity, m/s: the filter's, or less where the speed hardly moves about
    unsettled: Floats  # radians that it turned by lately
    cruise: Floats  # speed through the air that it keeps
    gusts: Floats  # mean square of what it is off that on straights
    turned: Floats  # radians that it has turned by since it was first thought of


def motions(
    before: Minds,
    at: int,
    position: Floats,
    velocity: Floats,
    velocity_sigma: Floats,
    sides: Floats,
    usual_rate: Floats,
    air_speed: Floats,
    adapts: Bools,
) -> tuple[Motions, Minds]:
    """How n aircraft move now, and what is remembered of that.

    `sides` (n, 3) are the modes' probabilities of straight, left, right, NaN = no modes; `usual_rate` (n,) how fast one turns
    at this speed; who `adapts` (n,) may slow down for a while. The turn rate is what the course has changed by, weighed against
    the usual one by how well it is known.
    """
    speed = np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1])
    course = np.arctan2(velocity[:, 1], velocity[:, 0])
    elapsed_s = np.where(before.at == UNKNOWN, math.inf, (at - before.at) / SECOND)
    fresh = (elapsed_s > STALE_S) | (elapsed_s <= 0.0)
    course_sigma = velocity_sigma / np.maximum(speed, LEAST_SPEED_MPS)
    span_s = np.where(np.isnan(before.courses[:, 1]), elapsed_s, elapsed_s + before.interval_s)
    older = np.where(np.isnan(before.courses[:, 1]), before.courses[:, 0], before.courses[:, 1])
    measured = np.where(fresh, 0.0, wrap_rad(course - older) / np.where(fresh, 1.0, span_s))
    measured = np.where(speed < LEAST_SPEED_MPS, 0.0, measured)
    sigma = math.sqrt(2.0) * velocity_sigma / np.maximum(speed, LEAST_SPEED_MPS) / np.where(fresh, 1.0, span_s)
    side, turn_rate = _turning(measured, sigma, sides, usual_rate, before.unsettled < TURNS_RAD)
    gained = np.where(fresh, 0.0, np.maximum(np.abs(speed - before.speed) - SPEED_SIGMAS * velocity_sigma, 0.0))
    gained = gained / np.where(fresh, 1.0, elapsed_s)
    period_s = np.where(fresh, 1.0, elapsed_s)
    wander = _wander(before, speed, fresh, period_s)
    steady = np.where(np.isnan(wander), math.inf, WANDERS_LESS * np.sqrt(or_zero(wander)))
    sure = np.clip(steady, SURE_AT_MOST * velocity_sigma, velocity_sigma)
    slow = np.minimum(speed, before.speed) < LEAST_SPEED_MPS
    turned = np.where(fresh | slow, 0.0, np.abs(wrap_rad(course - before.courses[:, 0])))
    turned = turned**3 / np.maximum(turned * turned + (2.0 * course_sigma) ** 2, 1e-12)  # as far as it is no noise
    unsettled = np.where(fresh, 0.0, before.unsettled * np.exp(-period_s / UNSETTLED_S)) + turned
    cruise, gusts = _cruise(before, speed, air_speed, unsettled, fresh, adapts, period_s)
    all_turned = before.turned + turned
    minds = replace(
        before,
        at=np.full(len(speed), at),
        courses=np.stack([course, np.where(fresh, math.nan, before.courses[:, 0])], axis=1),
        interval_s=np.where(fresh, 0.0, elapsed_s),
        speed=speed,
        wander=wander,
        unsettled=unsettled,
        cruise=cruise,
        gusts=gusts,
        turned=all_turned,
    )
    kinematics = position, velocity, speed, course, side, turn_rate, usual_rate, gained, sure
    return Motions(*kinematics, unsettled, cruise, gusts, all_turned), minds


def _turning(measured: Floats, sigma: Floats, sides: Floats, usual_rate: Floats, begins: Bools) -> tuple[Ints, Floats]:
    """The side (n,) that each surely turns to, and how fast, of turn rates that were measured so well.

    Of who only `begins` to turn a part of what was measured is still straight flight: it turns no slower than usual.
    """
    by_modes = np.where(np.isnan(sides[:, 0]), 0, np.array([0, 1, -1])[or_zero(sides).argmax(axis=1)])
    by_modes = np.where(or_zero(sides).max(axis=1) > intent.TURN_SURE, by_modes, 0)
    by_course = np.where(np.abs(measured) > np.maximum(SURE_SIGMAS * sigma, LEAST_RATE_RPS), np.sign(measured), 0.0)
    side = np.where(np.isnan(sides[:, 0]), by_course, by_modes).astype(np.int64)
    usual_sigma = 0.5 * usual_rate
    known, assumed = 1.0 / np.maximum(sigma, 1e-4) ** 2, 1.0 / usual_sigma**2
    agrees = measured * side > 0.0
    rate = np.where(agrees, (measured * known + side * usual_rate * assumed) / (known + assumed), side * usual_rate)
    rate = np.where(begins, side * np.maximum(np.abs(rate), usual_rate), rate)
    return side, np.where(side == 0, 0.0, rate)


def _cruise(
    before: Minds,
    speed: Floats,
    air_speed: Floats,
    unsettled: Floats,
    fresh: Bools,
    adapts: Bools,
    period_s: Floats,
) -> tuple[Floats, Floats]:
    """The speed (n,) through the air that is kept, and the mean square of what it is off that.

    In a turn it is what it was before, since turns slow down or speed up; who slows down has no other speed before it is there,
    nor as long as it `adapts`.
    """
    known = ~(fresh | np.isnan(before.cruise) | (before.speed < LEAST_SPEED_MPS))
    kept = np.where(known, before.cruise, air_speed)
    turns = (unsettled > TURNS_RAD) | (adapts & (air_speed < kept))
    settled = (air_speed > kept) | (np.abs(speed - before.speed) < STEADY * speed * period_s)
    other = ~turns & settled & (np.abs(air_speed - kept) > ANOTHER_CRUISE * kept)
    keep = np.where(other, 0.0, np.exp(-period_s / np.where(turns, CRUISE_IN_TURN_S, CRUISE_S)))
    slowly = np.where(known & ~turns & ~other, np.exp(-period_s / GUSTS_S), 1.0)
    gusts = slowly * before.gusts + (1.0 - slowly) * (air_speed - kept) ** 2
    return np.asarray(keep * kept + (1.0 - keep) * air_speed), gusts


def _wander(before: Minds, speed: Floats, fresh: Bools, period_s: Floats) -> Floats:
    """The mean square (n,) of what the speed changes by in a second, faded; NaN = not known yet."""
    change = (speed - before.speed) ** 2 / period_s
    keep = np.exp(-period_s / WANDER_MEMORY_S)
    after = np.where(np.isnan(before.wander), change, keep * or_zero(before.wander) + (1.0 - keep) * change)
    return np.where(fresh, before.wander, after)


def inferred(
    before: Minds, at: int, now: Motions, places: Floats, planned: Bools, lowered: Floats
) -> tuple[intent.Seen, Belief, Floats]:
    """To which of its candidates (n, c, 2) each aircraft goes; `lowered` (n, c) are factors on their weights."""
    elapsed_s = np.where(before.at == UNKNOWN, 1.0, np.maximum((at - before.at) / SECOND, 0.0))
    off = intent.off_course(now.position, now.velocity, places)
    seen, by_course = intent.seen(before.seen, off, now.side, elapsed_s, INFERENCE)
    time_s = intent.time_to_go(now.position, now.velocity, places)
    weight = by_course * intent.by_time(time_s, planned, INFERENCE) * lowered
    # what was agreed on for long is forgotten slowly; who flies elsewhere now does not go there
    here = np.where((now.side == 0)[:, None], np.exp(-0.5 * (off / STILL_THERE_RAD) ** 2), 1.0)
    weight = weight * here
    weight = np.where((now.speed < LEAST_SPEED_MPS)[:, None], math.nan, weight)
    return seen, intent.believed(weight, off, INFERENCE), off


def trusted(before: Minds, at: int, now: Motions, goal: Floats, join: Floats, circles: Bools, since: Ints) -> Floats:
    """How far it is to be believed (n,) that each aircraft goes to its declared goal (n, 2), said `since`; NaN = none.

    A hidden Markov model of two states, following and not: who follows flies at the goal, or turns towards it, or flies to
    where it comes back to the line to it, `join` (n, 2), NaN = nowhere.
    """
    said = ~np.isnan(goal[:, 0])
    off = intent.off_course(now.position, now.velocity, goal[:, None])[:, 0]
    way = goal - now.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    radius = now.speed / now.turning
    another = said & (since != before.declared_at)
    start = np.where(before.declared_at == UNKNOWN, TRUSTED_AT_FIRST, np.maximum(before.trust, TRUSTED_AGAIN))
    trust = np.where(another, start, before.trust)
    elapsed_s = np.where(before.at == UNKNOWN, 1.0, np.clip((at - before.at) / SECOND, 0.0, STALE_S))
    toward = (now.side != 0) & (intent.to_turn(or_zero(off)[:, None], now.side)[:, 0] < math.pi)
    away = (now.side != 0) & ~toward
    aside = intent.off_course(now.position, now.velocity, join[:, None])[:, 0]
    least = np.fmin(np.abs(or_zero(off)), np.abs(aside))
    fits = np.exp(-0.5 * (least / TOLERATED_RAD) ** 2)
    likelihood = np.where(toward, np.maximum(fits, 0.5), np.where(away, 0.05, np.maximum(fits, 0.02)))
    likelihood = np.where(
        circles & (distance < 2.0 * NEAR_RADII * radius), np.where(now.side != 0, 0.5, WANDERS), likelihood
    )
    past = (np.abs(or_zero(off)) > 0.5 * math.pi) & (distance > REACTS_S * now.speed)  # and nobody said what is next
    near = (distance < NEAR_RADII * radius) & ~past
    silent = ~circles & (near | ((at - since) / SECOND < REACTS_S)) | (now.speed < LEAST_SPEED_MPS)
    weight = np.where(silent, 1.0, (likelihood / WANDERS) ** elapsed_s)
    after = trust * weight / (trust * weight + 1.0 - trust)
    after = after + elapsed_s * (RESUMES * (1.0 - after) - STOPS * after)
    return np.where(said, np.clip(after, 0.01, 0.99), math.nan)
