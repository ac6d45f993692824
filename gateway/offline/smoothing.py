"""Smoothed tracks: a track's pieces, the last one first, each with what the later ones tell of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.kalman import ERROR, POSITION, Motion
from gateway.estimators.modes import Modes
from gateway.estimators.smoothing import States, smooth
from gateway.frames import RunwayFrame, turn
from gateway.fuse import Fused
from gateway.fuse.rows import in_the_world
from gateway.fuse.weighting import Model
from gateway.offline.pieces import Piece

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Smoothed:
    """A piece's rows with the smoothed states in place of the filter's, and both positions (n, 3) in the runway frame."""

    rows: Fused
    step: Ints
    filtered_m: Floats
    smoothed_m: Floats


def smoothed(pieces: Iterable[Piece], model: Model, frame: RunwayFrame) -> Iterator[Smoothed]:
    """One track's pieces, given and returned last first. In memory is one at a time, and an instant of the next."""
    how: Motion | Modes = model.motion if model.modes is None else model.modes
    after: tuple[int, States, bool] | None = None
    for piece in pieces:
        filtered = States(piece.mean[:, None], piece.covariance[:, None], piece.weight[:, None])
        later = None if after is None or after[2] else after[1]
        times = piece.rows.time if later is None or after is None else np.append(piece.rows.time, after[0])
        states = filtered if later is None else _followed(filtered, later)
        found = _in_segments(states, times, piece.begins, later, how)
        first = found.between(0, 1)
        after = int(times[0]), first, bool(piece.begins[0])
        yield _rows(piece, filtered, found.between(0, len(piece.rows.time)), model, frame)


def _followed(states: States, later: States) -> States:
    """A piece's states and the first of the next one."""
    return States(
        np.concatenate([states.mean, later.mean]),
        np.concatenate([states.covariance, later.covariance]),
        np.concatenate([states.weight, later.weight]),
    )


def _in_segments(
    filtered: States, times: Ints, begins: NDArray[np.bool_], later: States | None, how: Motion | Modes
) -> States:
    """The states smoothed between the places where the filter began anew: what comes after tells nothing of before."""
    found = States(filtered.mean.copy(), filtered.covariance.copy(), filtered.weight.copy())
    cuts = [0, *(int(place) for place in np.flatnonzero(begins) if place), len(times)]
    for first, end in pairwise(cuts):
        elapsed_s = (np.diff(times[first:end]) / SECOND)[:, None]
        known = later if end == len(times) else None
        part = smooth(filtered.between(first, end), elapsed_s, how, known)
        found.mean[first:end], found.covariance[first:end], found.weight[first:end] = (
            part.mean,
            part.covariance,
            part.weight,
        )
    return found


def _rows(piece: Piece, filtered: States, found: States, model: Model, frame: RunwayFrame) -> Smoothed:
    """The piece's rows with smoothed numbers; what the filter did not know (height, climb) stays unknown."""
    rows, state = piece.rows, found.combined()
    mean, covariance = state.mean[:, 0], state.covariance[:, 0]
    latitude, longitude, height, velocity, along = in_the_world(mean, covariance, frame)
    separation_m = rows.height_m - rows.altitude_msl_m
    height = np.where(np.isnan(rows.height_m), math.nan, height)
    runway_m = turn(frame.runway_from_enu, np.ascontiguousarray(mean[:, POSITION]))
    ways = rows.modes if model.modes is None else model.modes.directions(found.weight[:, 0])
    before = filtered.combined().mean[:, 0, POSITION]
    smooth_rows = replace(
        rows,
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=height,
        altitude_msl_m=height - separation_m,
        velocity_mps=np.where(np.isnan(rows.velocity_mps), math.nan, velocity),
        covariance=along.reshape(-1, 36),
        modes=ways,
        runway_m=runway_m,
        bias_m=np.where(np.isnan(rows.bias_m), math.nan, mean[:, ERROR]),
    )
    return Smoothed(smooth_rows, piece.step, turn(frame.runway_from_enu, np.ascontiguousarray(before)), runway_m)
