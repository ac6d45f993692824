"""How far the picture is from positions that it was not given: what is muted scores what went on without it.

The track is scored, dead reckoning by itself, and what a constant velocity would have come to, once a second, against the
muted positions between which they lie.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import Motion, between, displaced
from gateway.observation import GpsReport
from gateway.picture import MutedError, Picture

SECOND = 1_000_000_000
ANEW_NS = 10 * SECOND  # positions that are muted after so long are another time without them
GAP_NS = 6 * SECOND  # between two of them nothing is scored
MARKS_S = (10, 20, 30, 60, 120, 300)
KEPT_AT_MOST = 100_000

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MutedScore:
    """One aircraft without its positions for a while: level distances to them, m, of one thing that went on."""

    aircraft: str
    what: str
    begins_at: int
    lasts_s: float
    median_m: float
    largest_m: float
    at_end_m: float
    by_mark_m: dict[int, float]  # at so many seconds
    inside: float | None  # share of those within three sigma on both axes; None: it does not say how sure it is


@dataclass(slots=True)
class _Episode:
    """One aircraft's time without positions."""

    begins_at: int
    known: GpsReport | None  # the last position before
    times: list[int] = field(default_factory=list)
    places: list[tuple[float, float, float]] = field(default_factory=list)
    waiting: dict[tuple[str, int], tuple[float, float, float, float]] = field(default_factory=dict)
    found: list[MutedError] = field(default_factory=list)


class Muted:
    """Gathers what is muted, and pictures; `scores` at the end."""

    def __init__(self) -> None:
        self._episodes: defaultdict[str, list[_Episode]] = defaultdict(list)
        self._last: dict[str, GpsReport] = {}

    def hear(self, report: GpsReport) -> None:
        """A position that is muted."""
        episodes, at = self._episodes[report.aircraft], report.valid_at
        if not episodes or at - episodes[-1].times[-1] > ANEW_NS:
            episodes.append(_Episode(at, self._last.get(report.aircraft)))
        one = episodes[-1]
        if not one.times or at > one.times[-1]:
            one.times.append(at)
            height = report.height_m if report.height_m is not None else report.altitude_msl_m
            one.places.append((report.latitude_rad, report.longitude_rad, 0.0 if height is None else height))

    def know(self, report: GpsReport) -> None:
        """A position that is not muted."""
        self._last[report.aircraft] = report

    def add(self, picture: Picture) -> Picture:
        """The picture with the errors that are known by now."""
        if self._episodes:
            self._gather(picture)
        found = tuple(
            error for aircraft, episodes in self._episodes.items() for error in _settled(aircraft, episodes[-1])
        )
        return replace(picture, muted=found) if found else picture

    def _gather(self, picture: Picture) -> None:
        fuse = picture.fuse
        for row, aircraft in enumerate(fuse.aircraft):
            if aircraft is None or aircraft not in self._episodes:
                continue
            variance = fuse.covariance[row].reshape(6, 6)
            sigmas = math.sqrt(variance[1, 1]), math.sqrt(variance[0, 0])
            self._wait(aircraft, "track", int(fuse.time[row]), fuse.latitude_rad[row], fuse.longitude_rad[row], sigmas)
        for one in picture.reckoned:
            if one.aircraft in self._episodes:
                sigmas = float(one.sigma_m[0]), float(one.sigma_m[1])
                self._wait(one.aircraft, "dead reckoning", one.at, one.latitude_rad, one.longitude_rad, sigmas)

    def _wait(
        self, aircraft: str, what: str, at: int, latitude: float, longitude: float, sigmas: tuple[float, float]
    ) -> None:
        one = self._episodes[aircraft][-1]
        if one.begins_at <= at <= one.times[-1] + ANEW_NS:  # what comes after it has ended waits for nothing
            one.waiting[what, at] = (float(latitude), float(longitude), *sigmas)
            if ("constant velocity", at) not in one.waiting:
                _wait_for_constant(one, at)

    def scores(self) -> tuple[MutedScore, ...]:
        """One of each thing for each aircraft and time without positions, in their order."""
        made = []
        for aircraft, episodes in sorted(self._episodes.items()):
            for one in episodes:
                for what in ("track", "dead reckoning", "constant velocity"):
                    mine = [error for error in one.found if error.what == what]
                    if mine:
                        made.append(_score(aircraft, what, one, mine))
        return tuple(made)


def _wait_for_constant(one: _Episode, at: int) -> None:
    known = one.known
    if known is None or known.velocity_north_mps is None or known.velocity_east_mps is None:
        return
    elapsed_s = (at - known.valid_at) / SECOND
    metres = np.array([known.velocity_north_mps * elapsed_s, known.velocity_east_mps * elapsed_s, 0.0])
    place = np.array(known.latitude_rad), np.array(known.longitude_rad), np.zeros(())
    latitude, longitude, _ = displaced(*place, metres)
    one.waiting["constant velocity", at] = float(latitude), float(longitude), math.nan, math.nan


def _settled(aircraft: str, one: _Episode) -> list[MutedError]:
    """The errors of what the muted positions have caught up with; the last word for each time counts."""
    ready = sorted(key for key in one.waiting if key[1] <= one.times[-1])
    if not ready or len(one.times) < 2:
        return []
    times = one.times
    found = []
    for what, at in ready:
        latitude, longitude, north_m, east_m = one.waiting.pop((what, at))
        after = min(max(bisect_left(times, at), 1), len(times) - 1)
        gap = times[after] - times[after - 1]
        if gap > GAP_NS:
            continue
        share = (at - times[after - 1]) / gap
        before, later = np.array(one.places[after - 1]), np.array(one.places[after])
        true = before + share * (later - before)
        off = _metres(true, latitude, longitude)
        inside = bool(abs(off[0]) <= 3.0 * north_m and abs(off[1]) <= 3.0 * east_m)
        sigma = math.sqrt(0.5 * (north_m**2 + east_m**2))
        since_s = (at - one.begins_at) / SECOND
        found.append(MutedError(aircraft, at, since_s, what, math.hypot(off[0], off[1]), sigma, inside))
    if len(one.found) < KEPT_AT_MOST:
        one.found += found
    return found


def _metres(true: Floats, latitude: float, longitude: float) -> tuple[float, float]:
    """North and east from where something is to where it should be."""
    here = Motion(np.array(latitude), np.array(longitude), np.array(true[2]), np.zeros(3), np.zeros(4))
    off = between(np.array(true[0]), np.array(true[1]), np.array(true[2]), here)
    return float(off[0]), float(off[1])


def _score(aircraft: str, what: str, one: _Episode, errors: Sequence[MutedError]) -> MutedScore:
    since = np.array([error.since_s for error in errors])
    order = np.argsort(since, kind="stable")
    off = np.array([error.error_m for error in errors])[order]
    since = since[order]
    lasts_s = (one.times[-1] - one.begins_at) / SECOND
    marks = {
        mark: float(off[int(np.argmin(np.abs(since - mark)))])
        for mark in MARKS_S
        if mark <= lasts_s and float(np.abs(since - mark).min()) <= 1.5
    }
    says = [error.is_inside for error in errors if error.sigma_m == error.sigma_m]
    inside = float(np.mean(says)) if says else None
    whole = float(np.median(off)), float(off.max()), float(off[-1])
    return MutedScore(aircraft, what, one.begins_at, lasts_s, *whole, marks, inside)
