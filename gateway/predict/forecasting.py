"""One round of predictions: the goals of some tracks, which is believed, and the way there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import two_segment
from gateway.estimators.intent import BELIEVED, USED_IN_TURN_RAD, to_turn
from gateway.frames import RunwayFrame
from gateway.fuse import Lane, knows_height
from gateway.fuse.weighting import Model
from gateway.predict.goals import COUNT, GO_AROUND, LEGS, RUNWAY, Goals, goals_of
from gateway.predict.heights import heights
from gateway.predict.minds import Minds, Remembered
from gateway.predict.spread import spread
from gateway.predict.table import Forecast
from gateway.predict.thinking import Motions, inferred, motions, trusted
from gateway.predict.told import SECOND, Said, Tellings
from gateway.settings import Site

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NONE, INFERRED, DECLARED_KIND = 0, 1, 2
TRUSTED = 0.5  # a declared goal with this trust is flown to
WIND_WITHIN = 60 * SECOND  # a wind told this lately is still so
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
    now, courses, interval_s = motions(
        before, at, state.position, state.velocity, state.velocity_sigma, state.sides, _usual_rate(state.speed, model)
    )
    routes = np.stack([one.route for one in goals])
    chosen, minds = _chosen(before, at, now, goals, routes, state, site, frame)
    minds = replace(minds, courses=courses, interval_s=interval_s, turn_rate=now.turn_rate)
    horizons = state.since_s[:, None] + np.array(horizons_s)
    start = two_segment.Moving(state.at_position, state.velocity, now.turn_rate)
    ahead = two_segment.ahead(start, chosen.route, horizons, now.turning, wind=_winds(predicting, lanes, at))
    by_points = ahead.follows
    sigma = spread(now, ahead, horizons, state.place_sigma, state.velocity_sigma, by_points)
    up = heights(state.up, state.climb, now, ahead, chosen.up, chosen.lands, chosen.route, horizons)
    mean = np.concatenate([ahead.position, up[..., None]], axis=2)
    told_names = [one.names[best] if best >= 0 else None for one, best in zip(goals, chosen.best.tolist(), strict=True)]
    made = Forecast(
        at,
        tracks,
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
            np.sqrt(0.5 * (variance[:, 0] + variance[:, 1])),
            np.sqrt(0.5 * (variance[:, 3] + variance[:, 4])),
            sides,
            knows_height(events, [at] * len(events), covariance),
        )


def _usual_rate(speed: Floats, model: Model) -> Floats:
    """How fast who turns at these speeds usually does, rad/s."""
    banked = 9.80665 * math.tan(math.radians(25.0)) / np.maximum(speed, 5.0)
    return np.maximum(banked, math.radians(3.0))


def _chosen(
    before: Minds,
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
    taken = np.where((trusts & circles)[:, None, None], math.nan, taken)
    up = np.stack([one.up[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    up = np.where((trusts | infers)[:, None], up, math.nan)
    lands = np.stack([one.lands[place] for one, place in zip(goals, np.maximum(best, 0).tolist(), strict=True)])
    minds = replace(
        before,
        at=np.full(n, at),
        agreed=seen.agreed,
        length=seen.length,
        last=seen.last,
        turning=seen.turning,
        flown_at=seen.flown_at,
        trust=np.nan_to_num(trust),
        declared_at=np.where(declared >= 0, since, before.declared_at),
    )
    return _Chosen(taken, up, lands, best, kind, confidence), minds


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
