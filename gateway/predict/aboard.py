"""The runway as a goal where it moves, a ship's deck: aircraft fly to where it will be when they are there, and go on with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.two_segment import Ahead
from gateway.frames import RunwayFrame, turn
from gateway.fuse import Lane
from gateway.predict.goals import GO_AROUND, RUNWAY, Goals, runway_goals
from gateway.predict.states import State

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LONGEST_S = 300.0  # to go; a deck is not foretold further ahead
_SLOTS = (RUNWAY, GO_AROUND)


def on_deck(goals: Sequence[Goals], lanes: Sequence[Lane], at: int, state: State, frame: RunwayFrame) -> list[Goals]:
    """The goals of n aircraft with runway and go-around where the deck carries them until each is there.

    The deck goes on straight and does not turn: nobody knows how long a turn lasts. The ship that carries it has neither goal.
    Of a runway that stands still the goals are what they were.
    """
    follows, deck = frame.runway.follows, frame.deck
    if follows is None:
        return list(goals)
    places = np.full((len(goals), len(_SLOTS), 3), math.nan)
    if deck is not None:
        now = deck.enu_m + (at - deck.at) / SECOND * deck.velocity_mps
        points = now + turn(deck.deck_from_enu.T, runway_goals(frame.runway))
        to_go_s = meets_s(points[:, :2] - state.position[:, None], deck.velocity_mps[:2], state.speed[:, None])
        places = points + to_go_s[..., None] * deck.velocity_mps
    carries = np.array([lane.aircraft == follows for lane in lanes])
    places[carries] = math.nan
    shifts = carries if deck is None else np.ones(len(goals), dtype=np.bool_)
    return [_moved(one, there) if shift else one for one, there, shift in zip(goals, places, shifts, strict=True)]


def meets_s(way: Floats, velocity: Floats, speed: Floats) -> Floats:
    """When (...) who flies so fast (...) is where a point that is a way (..., 2) off and moves (2,) then is, s.

    At most `LONGEST_S`, and so much where it is never caught up with.
    """
    along = way[..., 0] * velocity[0] + way[..., 1] * velocity[1]
    distance_sq = way[..., 0] * way[..., 0] + way[..., 1] * way[..., 1]
    gains = speed * speed - (velocity[0] * velocity[0] + velocity[1] * velocity[1])
    faster = gains > 0.0
    needed = np.sqrt(np.maximum(along * along + gains * distance_sq, 0.0)) + along
    return np.where(faster, np.minimum(needed / np.where(faster, gains, 1.0), LONGEST_S), LONGEST_S)


def carried(ahead: Ahead, lands: Bools, touch: Floats, velocity: Floats, braking: float, frame: RunwayFrame) -> Ahead:
    """The paths of n aircraft of which some (n,) land on the deck at places (n, 2), coming there with `velocity` (n, 2).

    From there on it carries them; they come to rest on it, brought to that no slower than it is long.
    """
    if frame.deck is None or not lands.any():
        return ahead
    deck_mps = frame.deck.velocity_mps[:2]
    relative = velocity - deck_mps
    speed = np.sqrt(relative[:, 0] * relative[:, 0] + relative[:, 1] * relative[:, 1])
    room_m = 0.5 * frame.runway.length_m - frame.runway.aiming_point_x_m
    brakes = np.maximum(braking, 0.5 * speed * speed / room_m)
    over_s = ahead.over_s
    rolls_s = np.minimum(over_s, (speed / brakes)[:, None])
    rolled_m = speed[:, None] * rolls_s - 0.5 * brakes[:, None] * rolls_s * rolls_s
    onward = relative / np.maximum(speed, 1e-9)[:, None]
    there = touch[:, None] + over_s[..., None] * deck_mps + rolled_m[..., None] * onward[:, None]
    aboard = lands[:, None] & (over_s > 0.0)
    return replace(ahead, position=np.where(aboard[..., None], there, ahead.position))


def _moved(goals: Goals, places: Floats) -> Goals:
    """The same with runway and go-around at places (2, 3)."""
    route, up = goals.route.copy(), goals.up.copy()
    for slot, there in zip(_SLOTS, places, strict=True):
        route[slot, 0] = there[:2]
    up[RUNWAY, 0] = places[0, 2]  # at which height it goes around is not known
    return replace(goals, route=route, up=up)
