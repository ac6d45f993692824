"""Score: what was foretold held against what came, by horizon, along and across.

What came is the simulator's truth where the session has one of the aircraft, else the track itself, later. Beside each
prediction stands what flying on at constant velocity would have been off by. Arrays are over n predictions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from gateway.geodesy import geodetic_to_ecef, wrap_rad

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECOND = 1_000_000_000
GAP = 5 * SECOND  # a way that is not known for longer is not filled in
TURNED_RAD = math.radians(20.0)  # a course that changed by more, from when it was foretold until it came, has turned
MOVING_MPS = 3.0  # slower, a course says nothing
COURSE_OVER_S = 1.0  # to either side, of what came


@dataclass(frozen=True, slots=True)
class Way:
    """Where something was at times (m,) ns, ascending: latitude, longitude rad, height m; velocity (m, 2) east, north, or NaN."""

    time: Ints
    latitude: Floats
    longitude: Floats
    height: Floats

    def at(self, times: Ints) -> tuple[Floats, Floats, Floats]:
        """Latitude, longitude and height at times (n,); NaN where it is not known."""
        after = np.clip(np.searchsorted(self.time, times, side="left"), 1, max(len(self.time) - 1, 1))
        if len(self.time) < 2:
            nothing = np.full(len(times), math.nan)
            return nothing, nothing, nothing
        before = after - 1
        span = (self.time[after] - self.time[before]).astype(np.float64)
        share = (times - self.time[before]) / np.maximum(span, 1.0)
        known = (share >= 0.0) & (share <= 1.0) & (span <= GAP)
        share = np.where(known, share, math.nan)
        turn = wrap_rad(self.longitude[after] - self.longitude[before])
        return (
            self.latitude[before] + share * (self.latitude[after] - self.latitude[before]),
            self.longitude[before] + share * turn,
            self.height[before] + share * (self.height[after] - self.height[before]),
        )


@dataclass(frozen=True, slots=True)
class Foretold:
    """Predictions of one track, n points: when they were made and for when, where, how sure, and by what."""

    made: Ints
    valid: Ints
    horizon_s: Floats
    latitude: Floats
    longitude: Floats
    height: Floats
    sigma_along_m: Floats
    sigma_across_m: Floats
    course: Floats  # compass, rad
    method: NDArray[np.str_]
    kind: NDArray[np.str_]  # "declared", "inferred", "" = none


@dataclass(frozen=True, slots=True)
class Errors:
    """How far n predictions were off, metres: along and across the foretold course, in height; by sigmas; and what turned."""

    horizon_s: Floats
    along_m: Floats
    across_m: Floats
    height_m: Floats
    along_sigmas: Floats
    across_sigmas: Floats
    straight_on_m: Floats  # what constant velocity would have been off by
    turned: Bools  # the course changed in the meantime
    method: NDArray[np.str_]
    kind: NDArray[np.str_]
    part: Ints  # whose they are: 0 of one track, numbered where several are `joined`

    def chosen(self, rows: Bools) -> Errors:
        """Some of them."""
        return Errors(*(getattr(self, one.name)[rows] for one in fields(self)))


@dataclass(frozen=True, slots=True)
class Score:
    """One row: a group of predictions at one horizon. Shares within one and two sigmas; 0.68 and 0.95 are honest."""

    group: str
    horizon_s: float
    count: int
    rms_m: float
    straight_on_rms_m: float
    along_rms_m: float
    across_rms_m: float
    height_rms_m: float
    heights: int  # of how many predictions both heights are known
    along_within: tuple[float, float]
    across_within: tuple[float, float]
    along_independent: float  # how many independent predictions the share within one sigma is worth
    across_independent: float


def errors(told: Foretold, came: Way, known: Way) -> Errors:
    """How far predictions were off what came; `known` is the track as it was known, for constant velocity.

    Predictions of which it is not known what came are left out.
    """
    latitude, longitude, height = came.at(told.valid)
    east, north = _offset_m(latitude, longitude, told.latitude, told.longitude)
    along = east * np.sin(told.course) + north * np.cos(told.course)
    across = north * np.sin(told.course) - east * np.cos(told.course)
    before, after = _course(came, told.made), _course(came, told.valid)
    span = int(COURSE_OVER_S * SECOND)
    now, a_moment_ago = known.at(told.made), known.at(told.made - span)
    moved_east, moved_north = _offset_m(a_moment_ago[0], a_moment_ago[1], now[0], now[1])
    gone_east, gone_north = _offset_m(now[0], now[1], latitude, longitude)
    straight_east = gone_east - moved_east / COURSE_OVER_S * told.horizon_s
    straight_north = gone_north - moved_north / COURSE_OVER_S * told.horizon_s
    moving = np.hypot(moved_east, moved_north) >= MOVING_MPS * COURSE_OVER_S
    found = Errors(
        told.horizon_s,
        along,
        across,
        told.height - height,
        np.abs(along) / told.sigma_along_m,
        np.abs(across) / told.sigma_across_m,
        np.hypot(straight_east, straight_north),
        np.abs(wrap_rad(after - before)) > TURNED_RAD,
        told.method,
        told.kind,
        np.zeros(len(along), dtype=np.int64),
    )
    return found.chosen(~np.isnan(along) & ~np.isnan(found.straight_on_m) & moving)


def joined(parts: Sequence[Errors]) -> Errors:
    """The errors of several tracks as one."""
    nothing, words, whole = np.zeros(0), np.zeros(0, dtype="U16"), np.zeros(0, dtype=np.int64)
    none = np.zeros(0, dtype=np.bool_)
    empty = Errors(nothing, nothing, nothing, nothing, nothing, nothing, nothing, none, words, words, whole)
    numbered = [replace(part, part=np.full(len(part.part), number)) for number, part in enumerate(parts)]
    return Errors(*(np.concatenate([getattr(part, one.name) for part in (empty, *numbered)]) for one in fields(empty)))


def scores(found: Errors) -> list[Score]:
    """The rows: by group and horizon, those that have predictions."""
    groups: Mapping[str, Bools] = {
        "all": np.ones(len(found.along_m), dtype=np.bool_),
        "that turned": found.turned,
        "straight": ~found.turned,
        "two segments": found.method == "two segments",
        "model": found.method == "model",
        "declared": found.kind == "declared",
        "inferred": found.kind == "inferred",
    }
    return [
        _score(name, float(horizon), found.chosen(rows & (found.horizon_s == horizon)))
        for name, rows in groups.items()
        for horizon in np.unique(found.horizon_s)
        if (rows & (found.horizon_s == horizon)).any()
    ]


def _score(group: str, horizon_s: float, some: Errors) -> Score:
    height = some.height_m[~np.isnan(some.height_m)]
    return Score(
        group,
        horizon_s,
        len(some.along_m),
        _rms(np.hypot(some.along_m, some.across_m)),
        _rms(some.straight_on_m),
        _rms(some.along_m),
        _rms(some.across_m),
        _rms(height),
        len(height),
        _within(some.along_sigmas),
        _within(some.across_sigmas),
        _independent(some.along_sigmas, some.part),
        _independent(some.across_sigmas, some.part),
    )


def standard_error(share: float, independent: float) -> float:
    """Of a share that was found in so many independent predictions, if it is true."""
    return math.sqrt(share * (1.0 - share) / independent) if independent > 0.0 else math.nan


def _independent(sigmas: Floats, part: Ints) -> float:
    """How many independent values "within one sigma" (n,) is worth: predictions a second apart are nearly the same.

    Each track's count over 1 + 2 x the sum of its autocorrelation, up to where that is first not positive. Who is always
    within, or never, tells once.
    """
    worth = 0.0
    for one in np.unique(part):
        within = (sigmas[part == one] <= 1.0).astype(np.float64)
        off = within - within.mean()
        power = float(off @ off)
        if power == 0.0:
            worth += 1.0
            continue
        correlation = np.correlate(off, off, "full")[len(off) :] / power
        ends = np.flatnonzero(correlation <= 0.0)
        last = int(ends[0]) if len(ends) else len(correlation)
        worth += len(off) / (1.0 + 2.0 * float(correlation[:last].sum()))
    return worth


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values))) if len(values) else math.nan


def _within(sigmas: Floats) -> tuple[float, float]:
    return float((sigmas <= 1.0).mean()), float((sigmas <= 2.0).mean())


def _course(way: Way, times: Ints) -> Floats:
    """Compass course (n,) of what came, from a moment before to a moment after."""
    span = int(COURSE_OVER_S * SECOND)
    first, last = way.at(times - span), way.at(times + span)
    east, north = _offset_m(first[0], first[1], last[0], last[1])
    return np.arctan2(east, north)


def _offset_m(latitude: Floats, longitude: Floats, to_latitude: Floats, to_longitude: Floats) -> tuple[Floats, Floats]:
    """East and north (n,) metres from one place to another, on the ellipsoid, along the axes at the first."""
    away = geodetic_to_ecef(to_latitude, to_longitude, 0.0) - geodetic_to_ecef(latitude, longitude, 0.0)
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    east = away[..., 1] * cos_lon - away[..., 0] * sin_lon
    north = away[..., 2] * cos_lat - sin_lat * (away[..., 0] * cos_lon + away[..., 1] * sin_lon)
    return east, north
