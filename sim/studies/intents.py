"""Paper 000's case of intent: the flight of `rmimm`, the points it flies to, decoys beside them, and what is foretold of it.

A filter, the inference of intent and the prediction run over all runs as one batch. Source: 000, 2.2, 2.3 and 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import intent, modes, two_segment
from gateway.estimators.intent import BELIEVED, TURN_SURE, USED_IN_TURN_RAD, Inference, Rule
from gateway.estimators.kalman import SIZE
from gateway.estimators.modes import Mixture, combine
from gateway.estimators.two_segment import Ahead, Moving
from sim.studies import rmimm as case
from sim.studies.rmimm import END_S, POINTS, TURN_RPS, Flight, Tracks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

HORIZONS_S = (10, 30, 60, 120)
LEGS_OF_POINTS = ((0, 100), (200, 300), (350, END_S))  # the straights that lead to the three points
TURNS = ((100, 200), (300, 350))
FOUND_S, SETTLED_S = 10, 20  # into a turn, into a straight: by then the filter has found it
FIRST_S = 20  # what comes before is the filter's start
DECOYS_RAD = math.radians(25.0)
SIDES = np.array([0, 1, -1])  # of straight, left, right

Feedback = Literal["none", "inferred", "known"]
Origins = Literal["turns", "straights", "all"]
Method = Literal[
    "likeliest mode", "straight on", "known point, literal", "known point", "inferred, literal", "inferred"
]


@dataclass(frozen=True, slots=True)
class Points:
    """The candidates (c, 2), the first three those that are flown to, and which are of the plan (c,)."""

    place: Floats
    planned: Bools

    def known(self, step: int) -> Floats:
        """The point (2,) that is flown to, or turned towards, after a step."""
        return np.asarray(self.place[[step < until for until, _ in POINTS].index(True)])


@dataclass(frozen=True, slots=True)
class Followed:
    """What a filter and the inference made of a flight, each second: by (t, runs)."""

    tracks: Tracks
    likeliest: Ints  # the likeliest mode's side: 0 straight, 1 left, -1 right
    side: Ints  # the same, 0 also where a turn is not sure
    best: Ints  # the believed candidate, -1 = none
    believed: Floats  # share of the weight in its direction
    to_turn: Floats  # angle still to turn to it; on a straight 0


VARIANTS: tuple[tuple[str, modes.Rule, Rule, Feedback], ...] = (
    ("RMIMM", "rmimm", "default", "none"),
    ("literal", "literal", "literal", "none"),
    ("default", "rmimm", "default", "inferred"),
    ("known point", "rmimm", "default", "known"),
    ("literal, known point", "literal", "literal", "known"),
)


def variant(name: str, flown: Flight, points: Points) -> Followed:
    """One of `VARIANTS` over a flight."""
    _, filtering, inferring, feedback = next(one for one in VARIANTS if one[0] == name)
    return followed(flown, points, filtering, Inference.of(inferring), feedback)


def candidates(flown: Flight) -> Points:
    """The three points and, for each, two decoys: turned by 25 degrees to either side as seen from its leg's beginning."""
    true = [flown.points[until - 1] for until, _ in POINTS]
    places, planned = list(true), [True, False, False]
    for point, (since, _), of_plan in zip(true, LEGS_OF_POINTS, tuple(planned), strict=True):
        begins = flown.position[since - 1] if since else np.full(2, case.START_M)
        for angle in (DECOYS_RAD, -DECOYS_RAD):
            turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
            places.append(begins + turn @ (point - begins))
            planned.append(of_plan)
    return Points(np.array(places), np.array(planned))


def followed(flown: Flight, points: Points, rule: modes.Rule, inference: Inference, feedback: Feedback) -> Followed:
    """A filter over a flight, all runs as one batch, with the intent inferred each second."""
    chosen = case.modes(rule)
    runs, measured = flown.measured.shape[1:]
    sensitivity = np.zeros((1, measured, SIZE))
    sensitivity[0, np.arange(measured), [0, 1, 3, 4][:measured]] = 1.0
    variance = np.tile(flown.sigma**2, (runs * chosen.count, 1))
    mixture, second = modes.begin(flown.start, chosen), np.ones(runs)
    places = np.broadcast_to(points.place, (runs, *points.place.shape))
    planned = np.broadcast_to(points.planned, (runs, len(points.planned)))
    seen = intent.Seen.nothing(runs, len(points.place))
    goal = np.full((runs, 2), math.nan)
    columns: list[tuple[NDArray[Any], ...]] = []
    for step, told in enumerate(flown.measured):
        if feedback == "known":
            goal = np.broadcast_to(points.known(step), (runs, 2))
        changes = None if feedback == "none" else intent.transition(chosen, second, _aligned(mixture, goal))
        mixture = modes.predict(mixture, second, chosen, changes)
        rows = mixture.each()
        innovation = np.repeat(told, chosen.count, axis=0) - (sensitivity @ rows.mean[:, :, None])[:, :, 0]
        mixture, _ = modes.update(mixture, innovation, sensitivity, variance, chosen)
        mean = combine(mixture).mean
        likeliest = SIDES[mixture.weight.argmax(axis=1)]
        side = likeliest if inference.rule == "literal" else _sure(mixture.weight, likeliest)
        position, velocity = mean[:, :2], mean[:, 3:5]
        off = intent.off_course(position, velocity, places)
        seen, by_course = intent.seen(seen, off, side, second, inference)
        time_s = intent.time_to_go(position, velocity, places)
        belief = intent.believed(by_course * intent.by_time(time_s, planned, inference), off, inference)
        best = np.maximum(belief.best, 0)
        left = np.take_along_axis(intent.to_turn(off, side), best[:, None], axis=1)[:, 0]
        goal = np.where((belief.direction > BELIEVED)[:, None], points.place[best], math.nan)
        columns.append(
            (mean, mixture.weight, likeliest, side, belief.best, belief.direction, np.where(side, left, 0.0))
        )
    mean, weight, likeliest, side, best, confidence, left = (np.array(column) for column in zip(*columns, strict=True))
    return Followed(Tracks(mean, np.zeros((0, runs)), weight), likeliest, side, best, confidence, left)


def _sure(weight: Floats, likeliest: Ints) -> Ints:
    """The mode's side, where a turn is as good as sure."""
    return np.asarray(np.where(weight.max(axis=1) > TURN_SURE, likeliest, 0))


def _aligned(mixture: Mixture, goal: Floats) -> Bools:
    """Who flies at his point (n, 2); nobody at NaN."""
    state = combine(mixture)
    off = intent.off_course(state.mean[:, :2], state.mean[:, 3:5], goal[:, None])[:, 0]
    return np.asarray(np.abs(off) <= intent.ALIGNED_RAD)


def right(one: Followed, leg: int) -> float:
    """The share of a leg's seconds, over all runs, in which its point is the believed one."""
    begins, ends = LEGS_OF_POINTS[leg]
    return float((one.best[begins:ends] == leg).mean())


def origins(which: Origins, horizon_s: int) -> list[int]:
    """The steps from which is predicted: settled in turns; on settled straights that go on to the horizon; all."""
    if which == "turns":
        return [step for begins, ends in TURNS for step in range(begins + FOUND_S, ends)]
    if which == "straights":
        legs = [(max(begins, FIRST_S) if begins == 0 else begins + SETTLED_S, ends) for begins, ends in LEGS_OF_POINTS]
        return [step for begins, ends in legs for step in range(begins, ends - horizon_s)]
    return list(range(FIRST_S, END_S - horizon_s))


def predicted(one: Followed, points: Points, step: int, horizons_s: Floats, method: Method) -> Ahead:
    """Where the runs will be, as foretold at a step for some horizons (h,)."""
    position, velocity = one.tracks.mean[step, :, :2], one.tracks.mean[step, :, 3:5]
    runs = len(position)
    rate = one.likeliest[step] * TURN_RPS
    route = np.full((runs, 2), math.nan)
    rule: two_segment.Rule = "default"
    if method == "straight on":
        rate = np.zeros(runs)
    elif method in ("known point", "known point, literal"):
        route = np.broadcast_to(points.known(step), (runs, 2))
        rule = "literal" if method == "known point, literal" else "default"
    elif method == "inferred":
        side, left = one.side[step], one.to_turn[step]
        used = (one.believed[step] > BELIEVED) & ((side == 0) | (left < USED_IN_TURN_RAD))
        route = np.where(used[:, None], points.place[np.maximum(one.best[step], 0)], math.nan)
        rate = np.where(used, side * TURN_RPS, rate)
    elif method == "inferred, literal":
        route, rule = points.place[np.maximum(one.best[step], 0)], "literal"
    turning = np.full(runs, TURN_RPS)
    return two_segment.ahead(Moving(position, velocity, rate), route[:, None], horizons_s, turning, rule=rule)


def errors_m(one: Followed, flown: Flight, points: Points, method: Method) -> Floats:
    """How far (t, runs, h) the flight was from where it was foretold, by when that was; NaN beyond its end and at its start."""
    off = np.full((END_S, one.best.shape[1], len(HORIZONS_S)), math.nan)
    for step in range(FIRST_S, END_S - min(HORIZONS_S)):
        within = [horizon for horizon in HORIZONS_S if step + horizon < END_S]
        found = predicted(one, points, step, np.array(within, dtype=np.float64), method).position
        off[step, :, : len(within)] = np.linalg.norm(
            found - flown.position[[step + horizon for horizon in within]], axis=2
        )
    return off


def rms_m(off_m: Floats, which: Origins) -> tuple[float, ...]:
    """RMS by horizon of `errors_m`, over the origins of a kind from which the flight lasts that long."""
    chosen = [off_m[origins(which, horizon), :, place] for place, horizon in enumerate(HORIZONS_S)]
    return tuple(float(np.sqrt(np.nanmean(off**2))) for off in chosen)
