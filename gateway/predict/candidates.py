"""Candidates as they are told: the points that each track may be going to, and how probably."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame, turn
from gateway.predict.goals import Goals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TRACKS_AT_MOST = 30  # of more nobody could read them
LEAST_WEIGHT = 0.03


@dataclass(frozen=True, slots=True)
class Candidates:
    """Points that tracks may be going to, n rows."""

    time: Ints  # (n,) ns
    track: Ints
    name: tuple[str, ...]
    weight: Floats
    places_m: Floats  # (n, 3) in the runway frame; the height is NaN where it is not known
    rounds: tuple[tuple[int, tuple[int, ...]], ...] = ()  # instants, and the tracks whose candidates were told then


@dataclass(frozen=True, slots=True)
class Weighed:
    """The candidates of some tracks at one instant: rows of track, name, weight, and place (m, 3) ENU."""

    at: int
    tracks: tuple[int, ...]
    rows: tuple[tuple[int, str, float], ...]
    places: Floats


def weighed(at: int, tracks: Sequence[int], goals: Sequence[Goals], share: Floats) -> Weighed | None:
    """What is told of the candidates of n tracks at an instant, by their shares (n, c); None of a crowd."""
    if len(tracks) > TRACKS_AT_MOST:
        return None
    rows, places = [], []
    for row, slot in np.argwhere(share >= LEAST_WEIGHT).tolist():
        name = goals[row].names[slot]
        if name is not None:
            rows.append((tracks[row], name, float(share[row, slot])))
            places.append([*goals[row].route[slot, 0].tolist(), float(goals[row].up[slot, 0])])
    return Weighed(at, tuple(tracks), tuple(rows), np.array(places, dtype=np.float64).reshape(-1, 3))


def table(rounds: Sequence[Weighed], frame: RunwayFrame) -> Candidates:
    """Candidates as columns."""
    if not rounds:
        return NO_CANDIDATES
    places = np.concatenate([np.zeros((0, 3)), *(one.places for one in rounds)])
    level = turn(frame.runway_from_enu, np.nan_to_num(places))
    level[np.isnan(places[:, 2]), 2] = math.nan
    told = [(one.at, *row) for one in rounds for row in one.rows]
    return Candidates(
        np.array([row[0] for row in told], dtype=np.int64),
        np.array([row[1] for row in told], dtype=np.int64),
        tuple(row[2] for row in told),
        np.array([row[3] for row in told], dtype=np.float64),
        level,
        tuple((one.at, one.tracks) for one in rounds),
    )


NO_CANDIDATES = Candidates(np.zeros(0, np.int64), np.zeros(0, np.int64), (), np.zeros(0), np.zeros((0, 3)))
"""Where none are told."""
