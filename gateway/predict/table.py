"""Predictions as columns: what the archive, the viewer and everybody else reads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame, turn
from gateway.predict import candidates, conflicts, finals
from gateway.predict.candidates import NO_CANDIDATES, Candidates, Weighed
from gateway.predict.conflicts import NONE_FOUND, Conflicts
from gateway.predict.finals import NONE_JUDGED, GateAlerts
from gateway.predict.ways import Ways

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

METHODS = ("model", "two segments")
KINDS = (None, "inferred", "declared")
NONE, INFERRED, DECLARED = range(3)  # places in them


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
    sigma_along_m: Floats  # along the course that is foretold, and across it
    sigma_across_m: Floats
    course_rad: Floats  # compass course there
    conflicts: Conflicts = NONE_FOUND
    gates: GateAlerts = NONE_JUDGED
    candidates: Candidates = NO_CANDIDATES


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """One instant's predictions of some tracks, before they are brought into the world's coordinates: t tracks, h horizons."""

    made: int
    tracks: tuple[int, ...]
    horizons_s: tuple[float, ...]
    mean: Floats  # (t, h, 3) ENU
    course: Floats  # (t, h) from east to north
    along_m: Floats  # (t, h) sigmas
    across_m: Floats
    has_height: Bools  # (t,)
    by_points: Bools  # (t,)
    intent: tuple[str | None, ...]  # (t)
    kind: Ints  # (t,) 0 none, 1 inferred, 2 declared
    confidence: Floats  # (t,)
    ways: Ways
    judged: finals.Judged | None = None
    weighed: Weighed | None = None


def table(forecasts: Sequence[Forecast], frame: RunwayFrame, rounds: Sequence[conflicts.Round] = ()) -> Predicted:
    """Forecasts, and rounds of the conflict probe, as columns in geodetic coordinates."""
    return _as_columns(forecasts, frame, rounds) if forecasts or rounds else _nothing(frame)


@lru_cache(maxsize=1)  # most steps foretell nothing, and a frame stays
def _nothing(frame: RunwayFrame) -> Predicted:
    return _as_columns((), frame, ())


def _as_columns(forecasts: Sequence[Forecast], frame: RunwayFrame, rounds: Sequence[conflicts.Round]) -> Predicted:
    each = [len(f.horizons_s) for f in forecasts]
    made_at = _joined([np.full(f.course.size, f.made, dtype=np.int64) for f in forecasts], np.int64)
    horizon_s = _joined([np.tile(np.array(f.horizons_s), len(f.tracks)) for f in forecasts])
    position = np.concatenate([np.zeros((0, 3)), *(f.mean.reshape(-1, 3) for f in forecasts)])
    latitude, longitude, height = frame.geodetic_from_enu(position)
    known = _joined([np.repeat(f.has_height, h) for f, h in zip(forecasts, each, strict=True)], np.bool_)
    along, across = _joined([f.along_m for f in forecasts]), _joined([f.across_m for f in forecasts])
    by_points = _joined([np.repeat(f.by_points, h) for f, h in zip(forecasts, each, strict=True)], np.int64)
    kinds = _joined([np.repeat(f.kind, h) for f, h in zip(forecasts, each, strict=True)], np.int64)
    return Predicted(
        made=made_at,
        track=_joined([np.repeat(np.array(f.tracks, dtype=np.int64), len(f.horizons_s)) for f in forecasts], np.int64),
        valid=made_at + (horizon_s * SECOND).astype(np.int64),
        horizon_s=horizon_s,
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=np.where(known, height, math.nan),
        sigma_m=np.sqrt(0.5 * (along * along + across * across)),
        method=tuple([METHODS[one] for one in by_points.tolist()]),
        intent=tuple([one for f, h in zip(forecasts, each, strict=True) for one in f.intent for _ in range(h)]),
        intent_kind=tuple([KINDS[one] for one in kinds.tolist()]),
        confidence=_joined([np.repeat(f.confidence, h) for f, h in zip(forecasts, each, strict=True)]),
        runway_m=turn(frame.runway_from_enu, position),
        sigma_along_m=along,
        sigma_across_m=across,
        course_rad=np.remainder(0.5 * math.pi - _joined([f.course for f in forecasts]), 2.0 * math.pi),
        conflicts=conflicts.table(rounds, frame) if rounds else NONE_FOUND,
        gates=finals.table([one.judged for one in forecasts if one.judged is not None]),
        candidates=candidates.table([one.weighed for one in forecasts if one.weighed is not None], frame),
    )


def _joined(parts: Sequence[NDArray[Any]], kind: type = np.float64) -> NDArray[Any]:
    return np.concatenate([np.zeros(0, dtype=kind), *(part.reshape(-1) for part in parts)]).astype(kind, copy=False)
