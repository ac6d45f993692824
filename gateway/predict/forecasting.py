"""One round of predictions: the goals of some tracks, which is believed, and the way there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import two_segment
from gateway.estimators.mode_set import level_turn_rate
from gateway.estimators.turns_and_straights import or_zero
from gateway.frames import RunwayFrame
from gateway.fuse import Lane
from gateway.fuse.weighting import Model
from gateway.geodesy import wrap_rad
from gateway.predict import weather
from gateway.predict.aboard import carried, on_deck
from gateway.predict.candidates import weighed
from gateway.predict.choosing import Chosen, chosen
from gateway.predict.finals import Gates, Judged
from gateway.predict.goals import RUNWAY
from gateway.predict.heights import heights
from gateway.predict.hindsight import MOVING_MPS, kept, learnt, scaled
from gateway.predict.minds import Minds
from gateway.predict.predicting import Predicting
from gateway.predict.spread import (
    ALONG_POINTS,
    BY_MODEL,
    ENDS_LANDED,
    ENDS_ROUND,
    ROUND_A_POINT,
    Spread,
    beside,
    spread,
    wind_sigma,
)
from gateway.predict.stacked import Stacked
from gateway.predict.states import State
from gateway.predict.table import INFERRED, Forecast
from gateway.predict.thinking import NEW_GOAL_S, TURNS_RAD, Motions, motions
from gateway.predict.ways import ways_of
from gateway.settings import Site

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WIND_WITHIN = 60 * SECOND  # a wind told this lately is still so
APPROACH = 0.8  # of its speed through the air an aircraft keeps on the way to a landing
LEAD_S = 2.0  # autopilots fly on until they are so near to a point
# who was told its next point lately, which lies aside, begins to turn; nobody turns tighter than for such a corner
BEGINS_S, BEGINS_RAD, BEGUN_RAD, CORNER_RAD = 4.0, 0.2, 0.6, 2.3
SLOWS_S = 4.0  # before a corner, if it does
SETTLES = 10 * SECOND  # after a radar's track began: before, it may be an aircraft's, and its velocity is worth little
LANDED_MPS2, ROUND_MPS2 = 2.0, 20.0  # braking beyond a landing, and at the middle of a circle that is to be flown


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
    tracks, numbers = tuple([lane.track for lane in lanes]), tuple([lane.number for lane in lanes])
    before = predicting.remembered.of(tracks)
    state = State.of(lanes, at, model)
    winds = _winds(predicting, lanes, at)
    gates, judged = _on_final(predicting.gates, tracks, numbers, lanes, at, state, winds, site, frame)
    goals = on_deck(goals, lanes, at, state, frame)
    goals = goals if predicting.flows is None else predicting.flows.along(goals, state)
    goals = weather.around(goals, state, weather.areas(predicting.tellings, site, frame, at, separation_m))
    predicting, stacked = predicting.stacked(lanes[0].track, goals)
    now, minds = _motions(before, at, state, stacked, winds, site)
    way, minds = chosen(before, minds, at, now, stacked, state.climb, frame)
    horizons = state.since_s[:, None] + np.array(horizons_s)
    around = beside(horizons)
    whole = _paths(now, minds, at, way, state, winds, around)
    on_runway = (way.best == RUNWAY) & way.lands[:, 0]
    whole = carried(whole, on_runway, way.route[:, 0], state.velocity, LANDED_MPS2, frame)
    ahead, by_points = whole.first(horizons.shape[1]), whole.follows | way.circles
    rests, inferred = _rests(way, whole), way.kind == INFERRED
    heads_round = np.isfinite(way.rounds.radius[:, 0]) | np.isfinite(way.rounds.radius[:, 1])
    wind = wind_sigma(now, winds)
    unscaled = spread(now, whole, horizons, state.place_sigma, rests, way.confidence, inferred, heads_round, wind)
    sigma, minds = _in_hindsight(minds, at, horizons_s, state, now, ahead, unscaled)
    up = heights(state.up, state.climb, now, ahead, way.up, way.lands, way.route, horizons)
    mean = np.concatenate([ahead.position, up[..., None]], axis=2)
    known_s, reported = around - state.since_s[:, None], np.array([lane.aircraft is not None for lane in lanes])
    settled = np.array([lane.aircraft is not None or at - lane.began >= SETTLES for lane in lanes])
    ways = ways_of(numbers, at, state, now, whole, known_s, up, sigma, horizons_s, by_points, settled, reported, frame)
    told_names = [one.names[best] if best >= 0 else None for one, best in zip(goals, way.best.tolist(), strict=True)]
    made = Forecast(
        at,
        numbers,
        horizons_s,
        mean,
        ahead.course,
        sigma.along,
        sigma.across,
        state.has_height,
        by_points,
        tuple(told_names),
        way.kind,
        way.confidence,
        ways,
        judged,
        weighed(at, numbers, goals, way.share),
    )
    return replace(predicting, remembered=predicting.remembered.after(tracks, minds), gates=gates), made


def _motions(before: Minds, at: int, state: State, goals: Stacked, winds: Floats, site: Site) -> tuple[Motions, Minds]:
    """How n aircraft move now, in winds (n, 2), and what is remembered of that."""
    usual = level_turn_rate(state.speed, site.estimation.bank_rad, site.estimation.turn_rate_rps)
    through_air = np.sqrt(((state.velocity - winds) ** 2).sum(axis=1))
    adapts, sigma = _adapts(goals, at, state), state.velocity_sigma
    return motions(before, at, state.position, state.velocity, sigma, state.sides, usual, through_air, adapts)


def _adapts(goals: Stacked, at: int, state: State) -> Bools:
    """Who (n,) on a line of its plan is just before its end, or has lately begun it: there it may slow down."""
    said = np.maximum(goals.declared, 0)
    way = goals.route[np.arange(len(said)), said, 0] - state.position
    near = (way * way).sum(axis=1) < (SLOWS_S * np.maximum(state.speed, 1.0)) ** 2
    lately = at - goals.declared_at < NEW_GOAL_S * SECOND
    return np.asarray(~np.isnan(goals.begins[:, 0]) & (near | lately))


def _paths(
    now: Motions, minds: Minds, at: int, way: Chosen, state: State, winds: Floats, horizons: Floats
) -> two_segment.Ahead:
    """The paths of n aircraft on their ways at horizons (n, h), in winds (n, 2)."""
    said_s = (at - minds.declared_at) / SECOND
    slows = way.lands[:, 0] & (said_s < NEW_GOAL_S)  # and has not done so yet
    turn_rate = np.where(said_s < BEGINS_S, _cornering(now, way), now.turn_rate)
    start = two_segment.Moving(state.at_position, state.velocity, np.where(way.circles, way.rate, turn_rate))
    return two_segment.ahead(
        start,
        way.route,
        horizons,
        now.turning,
        wind=winds,
        air_speed=np.where(slows, APPROACH, 1.0) * now.cruise,
        slower=np.where(way.lands, APPROACH, 1.0),
        lead_m=LEAD_S * np.maximum(state.speed, 1.0),
        braking=np.where(way.lands.any(axis=1), LANDED_MPS2, np.where(way.ends_round, ROUND_MPS2, 0.0)),
        over=way.over,
        join=way.join if np.isfinite(way.join).any() else None,
        circles=way.rounds if np.isfinite(way.rounds.radius).any() else None,
    )


def _cornering(now: Motions, way: Chosen) -> Floats:
    """The turn rates (n,) of who begins a corner: as sharp as it asks of who has begun to turn so near to it."""
    to_go = way.route[:, 0] - now.position
    off = or_zero(wrap_rad(np.arctan2(to_go[:, 1], to_go[:, 0]) - now.course))
    needed = np.tan(0.5 * np.minimum(np.abs(off), CORNER_RAD)) / LEAD_S
    rate = np.maximum(np.abs(now.turn_rate), np.clip(needed, now.turning, two_segment.FASTER * now.turning))
    starts = (np.abs(off) > BEGINS_RAD) & (now.side * off >= 0.0) & (now.unsettled < BEGUN_RAD)
    return np.where(starts, np.sign(off) * rate, now.turn_rate)


def _in_hindsight(
    minds: Minds,
    at: int,
    horizons_s: tuple[float, ...],
    state: State,
    now: Motions,
    ahead: two_segment.Ahead,
    unscaled: Spread,
) -> tuple[Spread, Minds]:
    """The sigmas scaled by what became of earlier predictions, and these predictions kept until they come due."""
    minds = learnt(minds, at, state, horizons_s)
    turns = (ahead.turned > TURNS_RAD) | (now.unsettled > TURNS_RAD)[:, None]
    sigma, moves = scaled(minds, unscaled, turns), now.speed >= MOVING_MPS
    return sigma, kept(minds, at, horizons_s, ahead.position, ahead.course, unscaled, turns, moves)


def _on_final(
    gates: Gates,
    tracks: Sequence[int],
    numbers: Sequence[int],
    lanes: Sequence[Lane],
    at: int,
    state: State,
    winds: Floats,
    site: Site,
    frame: RunwayFrame,
) -> tuple[Gates, Judged | None]:
    """Who of some tracks is not stabilised on final."""
    place = np.concatenate([state.position, (state.up + state.climb * state.since_s)[:, None]], axis=1)
    velocity = np.concatenate([state.velocity, state.climb[:, None]], axis=1)
    aircraft = [lane.aircraft for lane in lanes]
    return gates.judged(at, tracks, numbers, aircraft, place, velocity, winds, state.has_height, site.stabilised, frame)


def _rests(way: Chosen, whole: two_segment.Ahead) -> Ints:
    """What is known of each aircraft's way (n,): `spread`'s kinds."""
    kind = np.where(whole.follows, np.where(way.ends_round, ENDS_ROUND, ALONG_POINTS), BY_MODEL)
    kind = np.where(whole.follows & way.lands.any(axis=1), ENDS_LANDED, kind)
    return np.where(way.circles, ROUND_A_POINT, kind)


def _winds(predicting: Predicting, lanes: Sequence[Lane], at: int) -> Floats:
    """Where the air moves to (n, 2) by each aircraft's own word, 0 where none is known."""
    told = predicting.tellings.by_aircraft
    winds = np.zeros((len(lanes), 2))
    for row, lane in enumerate(lanes):
        one = told.get(lane.aircraft) if lane.aircraft is not None else None
        if one is not None and one.wind is not None and at - one.wind.valid_at <= WIND_WITHIN:
            winds[row] = one.wind.wind_east_mps, one.wind.wind_north_mps
    return winds
