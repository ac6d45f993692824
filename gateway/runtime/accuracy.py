"""How far GPS reports, radar plots and the fused track were from the truth, where a simulator tells it.

Only read from pictures, never fed back. Scores are settled every few seconds, so memory does not grow with the
pictures: some thousands of errors remain, evenly over the session.
"""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import Truth
from gateway.picture import Picture
from gateway.settings import Runway

_SETTLE_NS = 5_000_000_000
_WAIT_FOR_TRUTH_NS = 15_000_000_000  # what no truth has caught up with by then is not scored
_LARGEST_GAP_NS = 2_000_000_000  # between two truths that are interpolated
_FORGOTTEN_NS = 60_000_000_000  # whose truth was told no later is gone
_KEPT_AT_MOST = 100_000  # errors of one kind

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Score:
    """Distances to the truth in three dimensions, metres."""

    count: int
    rmse_m: float
    median_m: float
    p95_m: float


@dataclass(frozen=True, slots=True)
class SmoothedScore:
    """Distances to the truth of the same rows as the filter left them in the end, and smoothed."""

    filtered: Score
    smoothed: Score


class Errors:
    """Errors of a session however long: all of them while they are few, then each second one, each fourth, and so on.

    So the scores of a short session are exact, and those of a long one are of errors from all of it.
    """

    __slots__ = ("count", "kept", "squares", "stride")

    def __init__(self) -> None:
        self.kept, self.stride, self.count, self.squares = array("f"), 1, 0, 0.0

    def extend(self, errors: Floats) -> None:
        """Take some more."""
        first = -self.count % self.stride
        self.count += len(errors)
        self.squares += float(np.sum(errors**2))
        self.kept.extend(errors[first :: self.stride].tolist())
        while len(self.kept) > _KEPT_AT_MOST:
            self.kept = self.kept[::2]
            self.stride *= 2

    def score(self) -> Score:
        """The score of all of them, at least one."""
        kept = score_of(np.array(self.kept, dtype=np.float64))
        if self.stride == 1:
            return kept
        return Score(self.count, math.sqrt(self.squares / self.count), kept.median_m, kept.p95_m)


class Truths:
    """What is known of one aircraft's true path, not yet settled: times, positions in the runway frame."""

    __slots__ = ("height_m", "latitude_rad", "longitude_rad", "msl", "time")

    def __init__(self) -> None:
        self.time: list[int] = []
        self.latitude_rad: list[float] = []
        self.longitude_rad: list[float] = []
        self.height_m: list[float] = []
        self.msl: list[bool] = []

    def add(self, truth: Truth) -> None:
        """Take one; without a height it tells nothing."""
        if self.time and truth.valid_at <= self.time[-1]:
            return  # repeated, or out of order: rare, and the neighbours tell nearly the same
        height = truth.height_m if truth.height_m is not None else truth.altitude_msl_m
        if height is None:
            return
        self.time.append(truth.valid_at)
        self.latitude_rad.append(truth.latitude_rad)
        self.longitude_rad.append(truth.longitude_rad)
        self.height_m.append(height)
        self.msl.append(truth.height_m is None)

    def forget_before(self, time: int) -> None:
        """Let go of what is older than an instant, but for the last before it."""
        keep = int(np.searchsorted(np.array(self.time, dtype=np.int64), time))
        for column in (self.time, self.latitude_rad, self.longitude_rad, self.height_m, self.msl):
            del column[: max(keep - 1, 0)]

    def runway_m(self, times: NDArray[np.int64], frame: RunwayFrame, separation_m: float) -> Floats:
        """Interpolated positions (n, 3) in the runway frame at times (n,); NaN outside, and where the truth has a gap.

        `separation_m` lifts what is only known above mean sea level.
        """
        known = np.array(self.time, dtype=np.int64)
        if len(known) < 2:
            return np.full((len(times), 3), np.nan)
        height = np.array(self.height_m) + np.where(self.msl, separation_m, 0.0)
        path = frame.runway_from_geodetic(self.latitude_rad, self.longitude_rad, height)
        after = np.clip(np.searchsorted(known, times), 1, len(known) - 1)
        gap = known[after] - known[after - 1]
        share = (times - known[after - 1]) / gap
        inside = (gap <= _LARGEST_GAP_NS) & (share >= 0.0) & (share <= 1.0)
        there = path[after - 1] + share[:, None] * (path[after] - path[after - 1])
        return np.where(inside[:, None], there, np.nan)


class Accuracy:
    """Gathers from pictures; `scores` at the end."""

    def __init__(self, runway: Runway) -> None:
        self._frame = RunwayFrame(runway)
        self._separation_m = runway.geoid_separation_m or 0.0
        self._separation_is_given = runway.geoid_separation_m is not None
        self._truths: defaultdict[str, Truths] = defaultdict(Truths)
        self._waiting: defaultdict[tuple[str, str], list[tuple[int, Floats]]] = defaultdict(list)
        self._errors: defaultdict[str, Errors] = defaultdict(Errors)
        self._settled_at: int | None = None

    def add(self, picture: Picture) -> None:
        """Take from a picture what can be scored."""
        for truth in picture.truth:
            self._truths[truth.aircraft].add(truth)
        if self._truths:
            self._gather(picture)
        if self._settled_at is None:
            self._settled_at = picture.now
        elif picture.now - self._settled_at >= _SETTLE_NS:
            self._settled_at = picture.now
            self._settle(picture.now)

    def _gather(self, picture: Picture) -> None:
        align, fuse = picture.align, picture.fuse
        measured = np.flatnonzero(align.report_has_height)
        reports_of = [align.report_aircraft[row] for row in measured]
        self._wait("gps", reports_of, align.report_time[measured], align.report_runway_m[measured])
        aircraft_of = {radar_track: aircraft for aircraft, radar_track in picture.associate.pairs}
        plots_of = [aircraft_of.get(radar_track) for radar_track in align.plot_radar_track]
        self._wait("radar", plots_of, align.plot_time, align.plot_runway_m)
        states = np.array(fuse.state, dtype=object)
        for state in set(fuse.state):
            rows = np.flatnonzero((states == state) & np.isfinite(fuse.height_m))  # no height, no distance to the truth
            self._wait(state, [fuse.aircraft[row] for row in rows], fuse.time[rows], fuse.runway_m[rows])
        if not self._separation_is_given and len(fuse.time):
            separations = (fuse.height_m - fuse.altitude_msl_m)[np.isfinite(fuse.altitude_msl_m)]
            if len(separations) and np.isfinite(separations[-1]):
                self._separation_m = float(separations[-1])

    def _wait(self, kind: str, aircraft: Iterable[str | None], times: NDArray[np.int64], runway_m: Floats) -> None:
        for name, time, position in zip(aircraft, times, runway_m, strict=True):
            if name is not None:
                self._waiting[name, kind].append((int(time), position))

    def _settle(self, now: int) -> None:
        """Score what the truth has caught up with, and let go of what it will not."""
        self._waiting = defaultdict(list, {key: rows for key, rows in self._waiting.items() if rows})
        for (aircraft, kind), rows in self._waiting.items():
            truths = self._truths.get(aircraft)
            if truths is None or not truths.time or not rows:
                rows[:] = [row for row in rows if row[0] > now - _WAIT_FOR_TRUTH_NS]
                continue
            ready = [row for row in rows if row[0] <= truths.time[-1]]
            rows[:] = [row for row in rows if max(truths.time[-1], now - _WAIT_FOR_TRUTH_NS) < row[0]]
            if ready:
                errors = self._distances(truths, ready)
                self._errors[kind].extend(errors[np.isfinite(errors)])
        for truths in self._truths.values():
            truths.forget_before(min(now - _WAIT_FOR_TRUTH_NS, truths.time[-1]) if truths.time else 0)
        gone = now - _FORGOTTEN_NS
        for name in [name for name, truths in self._truths.items() if truths.time and truths.time[-1] < gone]:
            del self._truths[name]

    def _distances(self, truths: Truths, rows: list[tuple[int, Floats]]) -> Floats:
        """Distance of each row to the interpolated truth (m); NaN where the truth has a gap or a component lacks."""
        times = np.array([time for time, _ in rows], dtype=np.int64)
        there = truths.runway_m(times, self._frame, self._separation_m)
        return np.asarray(np.linalg.norm(np.array([row for _, row in rows]) - there, axis=1))

    def scores(self) -> dict[str, Score]:
        """Scores by what was scored: "gps", "radar", and the fused track by its state ("fused", "gps only", ...)."""
        if self._settled_at is not None:
            self._settle(self._settled_at + _SETTLE_NS)
        return {kind: errors.score() for kind, errors in sorted(self._errors.items()) if errors.count}


def score_of(errors: Floats) -> Score:
    """The score of some distances, at least one."""
    median, p95 = np.quantile(errors, [0.5, 0.95])
    return Score(len(errors), float(np.sqrt(np.mean(errors**2))), float(median), float(p95))
