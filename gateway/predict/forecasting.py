"""One round of predictions: the goals of some tracks, which is believed, and the way there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import two_segment
from gateway.estimators.intent import BELIEVED, USED_IN_TURN_RAD, to_turn, wrapped
from gateway.frames import RunwayFrame
from gateway.fuse import Lane, knows_height
from gateway.fuse.weighting import Model
from gateway.predict.goals import COUNT, GO_AROUND, LEGS, RUNWAY, Goals, goals_of
from gateway.predict.heights import heights
from gateway.predict.minds import Minds, Remembered
from gateway.predict.spread import (
    ALONG_POINTS,
    BY_MODEL,
    ENDS_LANDED,
    ENDS_ROUND,
    ROUND_A_POINT,
    beside,
    spread,
)
from gateway.predict.table import Forecast
from gateway.predict.thinking import Motions, inferred, motions, trusted
from gateway.predict.told import SECOND, Said, Tellings
from gateway.settings import Site

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

TOGETHER = 150  # tracks that are predicted at once; of more, each part has its own instant within the second
NEVER = 1 << 62
NONE, INFERRED, DECLARED_KIND = 0, 1, 2
TRUSTED = 0.5  # a declared goal with this trust is flown to
WIND_WITHIN = 60 * SECOND  # a wind told this lately is still so
LANDED_MPS2, ROUND_MPS2 = 2.0, 20.0  # braking beyond a landing, and at the middle of a circle that is to be flown
CIRCLE_LEAST, CIRCLE_MOST = 0.4, 2.0  # turn rate over that of a circle about the point: between them it is flown round
FINAL_M, FINAL_RAD = (
    30_000.0,
    math.radians(5.0),
)  # before the aiming point, and off the centreline as seen from it: on final


@dataclass(frozen=True, slots=True)
class Predicting:
    """What predict remembers: what was said, what is thought of each track, and each aircraft's goals as arrays."""

    tellings: Tellings = Tellings()
    remembered: Remembered = field(default_factory=Remembered)
    goals: Mapping[str | None, Goals] = field(default_factory=dict)  # by aircraft; None: of those that said nothing
    separation_m: float = 0.0  # of the geoid, as the goals have it
    planned: tuple[tuple[int, tuple[int, ...]], ...] = ()  # when which tracks are predicted next

    @property
    def due(self) -> int:
        """When the next tracks are predicted."""
        return self.planned[0][0] if self.planned else NEVER

    def planning(self, tracks: Sequence[int], at: int) -> Predicting:
        """The same with a round of predictions of these tracks, the first at an instant, the others within the second."""
        parts = [tuple(tracks[first : first + TOGETHER]) for first in range(0, len(tracks), TOGETHER)]
        return replace(
            self, planned=tuple((at + place * SECOND // len(parts), part) for place, part in enumerate(parts))
        )

    def begun(self, at: int) -> tuple[Predicting, tuple[int, ...]]:
        """The same without the part that is due at an instant, and its tracks."""
        if self.due > at:
            return self, ()
        return replace(self, planned=self.planned[1:]), self.planned[0][1]

    def hearing(self, said: Said) -> Predicting:
        """The same with one thing more that an aircraft said."""
        tellings = self.tellings.hearing(said)
        if tellings is self.tellings:
            return self
        known = self.tellings.by_aircraft.get(said.aircraft)
        now = tellings.by_aircraft[said.aircraft]
        if known is not None and known.plan is now.plan and known.intents is now.intents:
            return replace(self, tellings=tellings)
        goals = {aircraft: one for aircraft, one in self.goals.items() if aircraft != said.aircraft}
        return replace(self, tellings=tellings, goals=goals)

    def with_goals(self, lanes: Sequence[Lane], site: Site, frame: RunwayFrame, separation_m: float) -> Predicting:
        """The same with the goals of these tracks' aircraft made."""
        goals = self.goals if separation_m == self.separation_m else {}
        told = self.tellings.by_aircraft
        wanted = {lane.aircraft if lane.aircraft in told else None for lane in lanes}
        missing = [one for one in wanted if one not in goals]
        if not missing:
            return self
        made = {one: goals_of(told.get(one) if one else None, site, frame, separation_m) for one in missing}
        return replace(self, goals={**goals, **made}, separation_m=separation_m)

    def forgotten(self, lanes: Mapping[int, Lane], by_aircraft: Mapping[str, int], at: int) -> Predicting:
        """The same without what is said of aircraft, and thought of tracks, that are long gone."""
        tellings = self.tellings.remembered(by_aircraft, at)
        goals = self.goals
        if len(tellings.by_aircraft) < len(self.tellings.by_aircraft):
            goals = {one: goal for one, goal in goals.items() if one is None or one in tellings.by_aircraft}
        if not lanes:
            return Predicting(tellings)
        remembered = self.remembered.without(lanes)
        return replace(self, tellings=tellings, goals=goals, remembered=remembered)


@dataclass(frozen=True, slots=True, eq=False)
class _Chosen:
    """Which way n aircraft are expected to go."""

    route: Floats  # (n, 4, 2), NaN = the model's
    up: Floats  # (n, 4)
    lands: Bools  # (n, 4)
    circles: Bools  # (n,) about a point, at a rate (n,)
    rate: Floats
    rounds: two_segment.Circles
    ends_round: Bools  # (n,) the route ends at a point that is flown round
    best: Ints  # (n,) the candidate that is told, -1 = none
    kind: Ints
    confidence: Floats


def forecast(
    predicting: Predicting,
    lanes: Sequence[Lane],
    at: int,
    horizons_s: tuple[float, ...],
    model: Model,
    site: Site,
    frame: RunwayFrame,
    separation_m: float,
) -> tuple[Predicting, Forecast]:
    """Some tracks' predictions at an instant, and what is remembered after it."""
    predicting = predicting.with_goals(lanes, site, frame, separation_m)
    told = predicting.tellings.by_aircraft
    goals = [predicting.goals[lane.aircraft if lane.aircraft in told else None] for lane in lanes]
    tracks = tuple(lane.track for lane in lanes)
    before = predicting.remembered.of(tracks)
    state = _State.of(lanes, at, model)
    now, minds = motions(
        before, at, state.position, state.velocity, state.velocity_sigma, state.sides, _usual_rate(state.speed, model)
    )
    routes = np.stack([one.route for one in goals])
    chosen, minds = _chosen(before, minds, at, now, goals, routes, state, site, frame)
    horizons = state.since_s[:, None] + np.array(horizons_s)
    start = two_segment.Moving(state.at_position, state.velocity, np.where(chosen.circles, chosen.rate, now.turn_rate))
    around = beside(horizons)
    braking = np.where(chosen.lands.any(axis=1), LANDED_MPS2, np.where(chosen.ends_round, ROUND_MPS2, 0.0))
    whole = two_segment.ahead(
        start,
        chosen.route,
        around,
        now.turning,
        wind=_winds(predicting, lanes, at),
        braking=braking,
        circles=chosen.rounds if np.isfinite(chosen.rounds.radius).any() else None,
    )
    ahead, by_points = whole.first(horizons.shape[1]), whole.follows | chosen.circles
    sigma = spread(now, whole, horizons, state.place_sigma, _rests(chosen, whole), chosen.confidence)
    up = heights(state.up, state.climb, now, ahead, chosen.up, chosen.lands, chosen.route, horizons)
    mean = np.concatenate([ahead.position, up[..., None]], axis=2)
    told_names = [one.names[best] if best >= 0 else None for one, best in zip(goals, chosen.best.tolist(), strict=True)]
    made = Forecast(
        at,
        tuple(lane.number for lane in lanes),
        horizons_s,
        mean,
        ahead.course,
        sigma.along,
        sigma.across,
        state.has_height,
        by_points,
        tuple(told_names),
        chosen.kind,
        chosen.confidence,
    )
    return replace(predicting, remembered=predicting.remembered.after(tracks, minds)), made


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """Some tracks' states: where they were last, and at the instant."""

    since_s: Floats  # (n,) since the last state
    at_position: Floats  # (n, 2) then
    position: Floats  # (n, 2) now
    velocity: Floats
    speed: Floats
    up: Floats  # (n,) then
    climb: Floats
    place_sigma: Floats  # (n,)
    velocity_sigma: Floats
    sides: Floats  # (n, 3)
    has_height: Bools

    @classmethod
    def of(cls, lanes: Sequence[Lane], at: int, model: Model) -> _State:
        """The tracks' last states, brought to an instant straight on."""
        events = [lane.last for lane in lanes]
        mean = np.array([event.mean for event in events])
        covariance = np.array([event.covariance for event in events])
        since_s = np.maximum(at - np.array([event.at for event in events], dtype=np.int64), 0) / SECOND
        velocity = mean[:, 3:5]
        variance = np.maximum(covariance[:, range(9), range(9)], 0.0)
        sides = np.full((len(lanes), 3), math.nan)
        if model.modes is not None:
            weight = np.array([event.mixture.weight[0] for event in events if event.mixture is not None])
            sides = model.modes.directions(weight)
        return cls(
            since_s,
            mean[:, :2],
            mean[:, :2] + since_s[:, None] * velocity,
            velocity,
            np.sqrt(velocity[:, 0] * velocity[:, 0] + velocity[:, 1] * velocity[:, 1]),
            mean[:, 2],
            mean[:, 5],
            _reported_sigma(covariance),
            np.sqrt(0.5 * (variance[:, 3] + variance[:, 4])),
            sides,
            knows_height(events, [at] * len(events), covariance),
        )


def _reported_sigma(covariance: Floats) -> Floats:
    """Sigma (n,) an axis of where a track is as its position source will say it: the source's own error stays the same."""
    axes = np.arange(2)
    error = 2.0 * covariance[:, axes, axes + 6] + covariance[:, axes + 6, axes + 6]
    return np.asarray(np.sqrt(np.maximum((covariance[:, axes, axes] + error).mean(axis=1), 0.0)))


def _usual_rate(speed: Floats, model: Model) -> Floats:
    """How fast who turns at these speeds usually does, rad/s."""
    banked = 9.80665 * math.tan(math.radians(25.0)) / np.maximum(speed, 5.0)
    return np.maximum(banked, math.radians(3.0))


def _chosen(
    before: Minds,
    minds: Minds,
    at: int,
    now: Motions,
    goals: Sequence[Goals],
    routes: Floats,
    state: _State,
    site: Site,
    frame: RunwayFrame,
) -> tuple[_Chosen, Minds]:
    """What is believed of n aircraft, and what is thought of them from now on."""
    n = len(goals)
    rows = np.arange(n)
    final = _on_final(now, site, frame)
    lowered = np.ones((n, COUNT))
    lowered[:, RUNWAY] = final
    lowered[:, GO_AROUND] = final * _goes_around(now, state, site)
    planned = np.stack([one.planned for one in goals])
    seen, belief, off = inferred(before, at, now, routes[:, :, 0], planned, lowered)
    declared = np.array([one.declared for one in goals], dtype=np.int64)
    since = np.array([one.declared_at for one in goals], dtype=np.int64)
    said = np.maximum(declared, 0)
    goal = np.where((declared >= 0)[:, None], routes[rows, said, 0], math.nan)
    circles = np.array([one.circles[place] for one, place in zip(goals, said.tolist(), strict=True)])
    trust = trusted(before, at, now, goal, circles, since)
    trusts = np.nan_to_num(trust) >= TRUSTED
    left = to_turn(np.take_along_axis(np.nan_to_num(off), np.maximum(belief.best, 0)[:, None], axis=1), now.side)[:, 0]
    infers = (
        ~trusts & (belief.best >= 0) & (belief.direction > BELIEVED) & ((now.side == 0) | (left < USED_IN_TURN_RAD))
    )
    best = np.where(trusts, declared, np.where(infers, belief.best, np.where(declared >= 0, declared, belief.best)))
    kind = np.where(best < 0, NONE, np.where(best == declared, DECLARED_KIND, INFERRED))
    confidence = np.where(kind == NONE, math.nan, np.where(kind == DECLARED_KIND, trust, belief.confidence))
    taken = np.where((trusts | infers)[:, None, None], routes[rows, np.maximum(best, 0)], math.nan)
    unknown = np.array([one.rounds[place] for one, place in zip(goals, said.tolist(), strict=True)])
    circling, rate = _circling(now, goal, trusts & circles & unknown)
    taken = np.where(circling[:, None, None], math.nan, taken)
    up = np.stack([one.up[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    up = np.where((trusts | infers)[:, None], up, math.nan)
    lands = np.stack([one.lands[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    ends_round = np.stack([one.rounds[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    radius = np.stack([one.radius[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    least = np.stack([one.least[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    circled = _circled(
        before,
        now,
        goal,
        np.stack([one.radius[place, 0] for one, place in zip(goals, said.tolist(), strict=True)]),
        since,
    )
    least[:, 0] = np.where(best == declared, np.maximum(least[:, 0] - circled, 0.0), least[:, 0])
    rounds = two_segment.Circles(np.where((trusts | infers)[:, None], radius, math.nan), least)
    ends_round = ends_round & (trusts | infers)
    minds = replace(
        minds,
        agreed=seen.agreed,
        length=seen.length,
        last=seen.last,
        turning=seen.turning,
        flown_at=seen.flown_at,
        trust=np.nan_to_num(trust),
        declared_at=np.where(declared >= 0, since, before.declared_at),
        circled=circled,
    )
    lands = lands & (trusts | infers)[:, None]
    return _Chosen(taken, up, lands, circling, rate, rounds, ends_round, best, kind, confidence), minds


def _circling(now: Motions, centre: Floats, should: Bools) -> tuple[Bools, Floats]:
    """Who flies round a point (n, 2) as it `should` (n,), and the rate (n,) of the turn that stays at its distance."""
    way = centre - now.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    rate = now.speed / np.maximum(distance, 1.0)
    to_left = np.where(way[:, 1] * now.velocity[:, 0] - way[:, 0] * now.velocity[:, 1] > 0.0, 1.0, -1.0)
    turns_alike = (now.turn_rate * to_left > CIRCLE_LEAST * rate) & (now.turn_rate * to_left < CIRCLE_MOST * rate)
    return should & turns_alike, to_left * rate


def _circled(before: Minds, now: Motions, centre: Floats, radius: Floats, since: Ints) -> Floats:
    """How far (n,) each aircraft has flown round its declared point (n, 2), of a radius (n,), NaN = it is not flown round."""
    way = centre - now.position
    near = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1]) <= two_segment.ON_CIRCLE * np.abs(radius)
    turned = np.abs(wrapped(now.course - before.courses[:, 0]))
    return np.where(near & (before.declared_at == since), before.circled + np.nan_to_num(turned), 0.0)


def _rests(chosen: _Chosen, whole: two_segment.Ahead) -> Ints:
    """What is known of each aircraft's way (n,): `spread`'s kinds."""
    kind = np.where(whole.follows, np.where(chosen.ends_round, ENDS_ROUND, ALONG_POINTS), BY_MODEL)
    kind = np.where(whole.follows & chosen.lands.any(axis=1), ENDS_LANDED, kind)
    return np.where(chosen.circles, ROUND_A_POINT, kind)


def _on_final(now: Motions, site: Site, frame: RunwayFrame) -> Bools:
    """Who flies towards the runway along its centreline, (n,)."""
    sine, cosine = math.sin(site.runway.landing_compass_rad), math.cos(site.runway.landing_compass_rad)
    along = now.position[:, 0] * sine + now.position[:, 1] * cosine - site.runway.aiming_point_x_m
    left = now.position[:, 1] * sine - now.position[:, 0] * cosine
    flies = now.velocity[:, 0] * sine + now.velocity[:, 1] * cosine
    aligned = flies > math.cos(math.radians(20.0)) * now.speed
    return (along < 0.0) & (along > -FINAL_M) & (np.abs(left) < 100.0 - along * math.tan(FINAL_RAD)) & aligned


def _goes_around(now: Motions, state: _State, site: Site) -> Floats:
    """How much likelier (n,) the climb is of who goes around than of who goes on down."""
    down = -now.speed * math.tan(site.runway.glide_path_rad)
    lands = np.exp(-0.5 * ((state.climb - down) / 1.5) ** 2)
    climbs = np.exp(-0.5 * ((np.minimum(state.climb, 2.0) - 2.0) / 1.5) ** 2)
    return np.asarray(np.clip(climbs / np.maximum(lands, 1e-6), 0.01, 100.0))


def _winds(predicting: Predicting, lanes: Sequence[Lane], at: int) -> Floats:
    """Where the air moves to (n, 2) by each aircraft's own word, 0 where none is known."""
    told = predicting.tellings.by_aircraft
    winds = np.zeros((len(lanes), 2))
    for row, lane in enumerate(lanes):
        one = told.get(lane.aircraft) if lane.aircraft is not None else None
        if one is not None and one.wind is not None and at - one.wind.valid_at <= WIND_WITHIN:
            winds[row] = one.wind.wind_east_mps, one.wind.wind_north_mps
    return winds


__all__ = ["LEGS", "Predicting", "forecast"]
