"""Predict: where it will be, and how sure that is. At constant velocity, or, where the estimator has modes, in the likeliest one.

Predictions are made at whole multiples of their period, for every track at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.kalman import POSITION
from gateway.frames import RunwayFrame, turn
from gateway.fuse import Lane, knows_height
from gateway.fuse.filtering import carried_on
from gateway.fuse.weighting import Model

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Predicted:
    """Predicted points, n rows."""

    made: Ints  # (n,) ns
    track: Ints
    valid: Ints  # (n,) ns
    horizon_s: Floats
    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats  # NaN where the track's height is not known
    sigma_m: Floats  # horizontal, 1 sigma an axis
    method: tuple[str, ...]  # "two segments", "model"
    intent: tuple[str | None, ...]
    intent_kind: tuple[str | None, ...]  # "declared", "inferred"
    confidence: Floats  # NaN where there is no intent
    runway_m: Floats  # (n, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """One instant's predictions of all tracks, before they are brought into the world's coordinates: t tracks, h horizons."""

    made: int
    tracks: tuple[int, ...]
    horizons_s: tuple[float, ...]
    mean: Floats  # (t, h, 3) ENU
    sigma_m: Floats  # (t, h)
    has_height: Bools  # (t,)


def forecast(lanes: Sequence[Lane], at: int, horizons_s: tuple[float, ...], model: Model) -> Forecast:
    """Every track carried on from an instant to each horizon."""
    n, h = len(lanes), len(horizons_s)
    covariance = np.array([lane.last.covariance for lane in lanes]).reshape(n, 9, 9)
    has_height = knows_height([lane.last for lane in lanes], [at] * n, covariance)
    since_s = np.array([max(at - lane.last.at, 0) / SECOND for lane in lanes])
    events = [lane.last for lane in lanes for _ in horizons_s]
    ahead, _ = carried_on(events, (since_s[:, None] + np.array(horizons_s)).reshape(-1), model, far=True)
    variance = 0.5 * (ahead.covariance[:, 0, 0] + ahead.covariance[:, 1, 1])
    tracks = tuple(lane.track for lane in lanes)
    mean = ahead.mean[:, POSITION].reshape(n, h, 3)
    return Forecast(at, tracks, horizons_s, mean, np.sqrt(variance).reshape(n, h), has_height)


def table(forecasts: Sequence[Forecast], frame: RunwayFrame) -> Predicted:
    """Forecasts as columns in geodetic coordinates."""
    made = [np.full(f.sigma_m.size, f.made, dtype=np.int64) for f in forecasts]
    track = [np.repeat(np.array(f.tracks, dtype=np.int64), len(f.horizons_s)) for f in forecasts]
    horizon = [np.tile(np.array(f.horizons_s), len(f.tracks)) for f in forecasts]
    position = np.concatenate([np.zeros((0, 3)), *(f.mean.reshape(-1, 3) for f in forecasts)])
    latitude, longitude, height = frame.geodetic_from_enu(position)
    known = [np.repeat(f.has_height, len(f.horizons_s)) for f in forecasts]
    height = np.where(np.concatenate([np.zeros(0, dtype=np.bool_), *known]), height, math.nan)
    made_at = np.concatenate([np.zeros(0, dtype=np.int64), *made])
    horizon_s = np.concatenate([np.zeros(0), *horizon])
    n = len(made_at)
    return Predicted(
        made=made_at,
        track=np.concatenate([np.zeros(0, dtype=np.int64), *track]),
        valid=made_at + (horizon_s * SECOND).astype(np.int64),
        horizon_s=horizon_s,
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=height,
        sigma_m=np.concatenate([np.zeros(0), *(f.sigma_m.reshape(-1) for f in forecasts)]),
        method=("model",) * n,
        intent=(None,) * n,
        intent_kind=(None,) * n,
        confidence=np.full(n, math.nan),
        runway_m=turn(frame.runway_from_enu, position),
    )
