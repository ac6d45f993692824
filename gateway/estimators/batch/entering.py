"""How the modes of a block of tracks move, compiled: the entries of transition and noise of each, as `modes.moved` has them."""

from __future__ import annotations

import math

import numpy as np

from gateway.estimators.batch.packed import Floats, Ints, compiled
from gateway.estimators.mode_set import LEAST_SPEED_MPS
from gateway.estimators.turning import (
    ARC,
    BEND,
    BY_RATE,
    COS,
    FLAT,
    KEPT,
    LOST,
    NOTHING,
    SHAPES,
    SINC,
    SINC_HALF,
    SMALL,
    SWAY,
)

# What an acceleration that lasts adds to position and velocity, and what is left of it.
SHIFT, PUSH, LEFT = range(19, 22)
ENTRIES = 22  # those of `turning`, and these


@compiled
def flown(weight: Floats, mean: Floats, speed: Floats, course: Floats) -> None:
    """Level speed (L,) and course (2, L) of the modes in all; a course of 0 of what stands."""
    m, lanes = weight.shape
    course[:] = 0.0
    for j in range(m):  # mixing leaves the mean of all modes where it is
        for lane in range(lanes):
            course[0, lane] += weight[j, lane] * mean[j, 3, lane]
            course[1, lane] += weight[j, lane] * mean[j, 4, lane]
    for lane in range(lanes):
        speed[lane] = math.sqrt(course[0, lane] * course[0, lane] + course[1, lane] * course[1, lane])
    for lane in range(lanes):
        if speed[lane] > 0.0:
            course[0, lane] /= speed[lane]
            course[1, lane] /= speed[lane]


@compiled
def entered(
    elapsed_s: Floats,
    speed: Floats,
    turn: float,
    banked: float,
    least_rps: float,
    fades: float,
    scale: Floats,
    shape: Ints,
    power: Ints,
    entries: Floats,
) -> None:
    """The first 19 entries of a mode. `banked` is g times the tangent of the bank, `scale` (19,) what it is shaken by.

    Each is a function of the angle, times a power of the time: see `turning.carried`.
    """
    lanes = len(elapsed_s)
    shapes, powers = np.empty((SHAPES, lanes)), np.empty((4, lanes))
    for lane in range(lanes):
        t = elapsed_s[lane]
        powers[0, lane], powers[1, lane], powers[2, lane], powers[3, lane] = 1.0, t, t * t, t * t * t
        rate = turn * max(banked / max(speed[lane], LEAST_SPEED_MPS), least_rps)
        amount = abs(t * rate)
        half = 0.5 * max(amount, NOTHING)
        sine, cosine = (half, 1.0) if turn == 0.0 else (math.sin(half), math.cos(half))
        sinc = sine / half
        square = amount * amount
        if amount < SMALL:
            bend = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square / 362880.0))
        else:
            bend = (amount - 2.0 * sine * cosine) / (square * amount)
        keep = math.exp(t * fades)
        shapes[FLAT, lane], shapes[SINC, lane] = 1.0, sinc * cosine
        shapes[SINC_HALF, lane], shapes[BEND, lane] = sinc * sinc, bend
        shapes[BY_RATE, lane], shapes[ARC, lane] = rate * sinc * cosine, rate * sinc * sinc
        shapes[SWAY, lane], shapes[COS, lane] = rate * bend, 1.0 - 2.0 * sine * sine if turn != 0.0 else 1.0
        shapes[KEPT, lane], shapes[LOST, lane] = keep, 1.0 - keep * keep
    for p in range(SHIFT):
        for lane in range(lanes):
            entries[p, lane] = scale[p] * shapes[shape[p], lane] * powers[power[p], lane]


@compiled
def turned(course: Floats, speed: Floats, along: float, across: float, turn_rate_rps: float, way: Floats) -> None:
    """Which way (3, L) level noise lies that has a share `along` of its sigma along the course and no less across it, as much
    as the turn rate makes of the speed, of `across` m/s2; 0: it is alike. See `holding.turn_along`.
    """
    for lane in range(len(speed)):
        share = max(min(speed[lane] * turn_rate_rps / across, 1.0), along) if across > 0.0 else 1.0
        _lies(course, lane, along * along, share * share, way)


@compiled
def usual(course: Floats, speed: Floats, along: float, across: float, drag: float, drawn: Floats) -> None:
    """The covariance (3, L) of an acceleration of which nothing is known: along and across in m/s2, drag in 1/m.

    See `holding.usual`.
    """
    for lane in range(len(speed)):
        most = max(min(drag * speed[lane] * speed[lane], across), along)
        _lies(course, lane, most * most, across * across, drawn)


@compiled
def _lies(course: Floats, lane: int, along: float, across: float, lying: Floats) -> None:
    """Variances along and across a course, as east, both, north."""
    east, north = course[0, lane], course[1, lane]
    lying[0, lane] = across + (along - across) * east * east
    lying[1, lane] = (along - across) * east * north
    lying[2, lane] = across + (along - across) * north * north
