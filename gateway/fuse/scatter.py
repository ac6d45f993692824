"""What a source's successive measurements tell of its noise, whatever a filter thinks of them.

A measurement is held against its own neighbours in time: the straight line or the parabola through those before it, or, for a
report with velocity, the last report moved by the mean of both velocities. What is left over is the noise of those
measurements, and the little that the target did otherwise. Constant errors, and errors that last, cancel out.

Of the ways the one is taken that a manoeuvre disturbs least, by the intervals and the stated noise alone; how much a hard
one would disturb it comes along. Manoeuvres only add: what is left over is never less than the noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.estimators.kalman import VELOCITY
from gateway.fuse.events import Event

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A hard manoeuvre, that lasts: acceleration m/s2, and its first and second derivative by time.
MANOEUVRE = (3.0, 0.6, 0.1)
GUST_MPS = 0.17  # what level velocities change by in a second, in turbulence
LEVEL, CLIMB = slice(3, 5), 5  # of a report's components
RADARS = 1 << 16  # numbers of radars that a track's groups are told apart by
CALM = 0.05  # of the noise's variance: no other way is looked for
# How much of the evidence counts, because measurements that follow each other share noise: for a line through the two
# before, a parabola through three, and pairs of reports. So that exp(evidence) has a mean of 1 where noise is as stated.
LINE, PARABOLA, PAIR = 0.52, 0.45, 0.65


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """n measurements of one kind; once `merged`, those of a track and source together and in order of time."""

    group: Ints  # (n,) which track and source
    at: Ints  # (n,) ns
    value: Floats  # (n, k): position m and velocity m/s, or range m, azimuth and elevation rad; NaN = not measured
    sigma: Floats  # (n, k) as stated
    speed_mps: Floats  # (n,) of the track
    event: Ints  # (n,) which of the new ones it is; -1 = only there to be held against

    @property
    def at_s(self) -> Floats:
        """Times (n,) after the first of all."""
        return np.asarray((self.at - self.at.min()) / SECOND)

    @property
    def new(self) -> Bools:
        """Which are new, (n,)."""
        return np.asarray(self.event >= 0)

    def of(self, chosen: Ints | Bools) -> Rows:
        """Some of them."""
        return Rows(
            self.group[chosen],
            self.at[chosen],
            self.value[chosen],
            self.sigma[chosen],
            self.speed_mps[chosen],
            self.event[chosen],
        )

    def after(self, before: Rows) -> Rows:
        """Others, and then these."""
        return Rows(
            np.concatenate([before.group, self.group]),
            np.concatenate([before.at, self.at]),
            np.concatenate([before.value, self.value]),
            np.concatenate([before.sigma, self.sigma]),
            np.concatenate([before.speed_mps, self.speed_mps]),
            np.concatenate([before.event, self.event]),
        )

    def in_order(self) -> Rows:
        """Those of a track and source together, in order of time, and of arrival."""
        return self.of(np.lexsort((self.event, self.at, self.group)))

    def parted(self, groups: Ints) -> tuple[Rows, Rows]:
        """Those of some groups, and the others."""
        theirs = np.isin(self.group, groups)
        return self.of(theirs), self.of(~theirs)

    def merged(self, kept: Rows | None) -> Rows:
        """These, all new, in order behind what was kept of the same groups; what came late or twice is left out."""
        rows = (self if kept is None else self.after(kept)).in_order()
        again = np.zeros(len(rows.at), dtype=np.bool_)
        again[1:] = (rows.group[1:] == rows.group[:-1]) & (rows.at[1:] == rows.at[:-1])
        first = _firsts(rows)
        place = np.arange(len(rows.at))
        last_kept = np.maximum.reduceat(np.where(rows.new, -1, place), first)
        late = rows.new & (place < np.repeat(last_kept, np.diff(first, append=len(place))))
        return rows.of(~(again | late))

    def latest(self, count: int, since: int) -> Rows:
        """The last ones of each group, so many at most, of groups that were heard since; none of them new any more."""
        first = _firsts(self)
        size = np.diff(first, append=len(self.at))
        from_end = np.repeat(first + size, size) - np.arange(len(self.at))
        heard = np.repeat(self.at[first + size - 1] >= since, size)
        rows = self.of((from_end <= count) & heard)
        return Rows(rows.group, rows.at, rows.value, rows.sigma, rows.speed_mps, np.full(len(rows.at), -1))


def _firsts(rows: Rows) -> Ints:
    """Where each group begins."""
    return np.flatnonzero(np.append(True, rows.group[1:] != rows.group[:-1])[: len(rows.group)])


@dataclass(frozen=True, slots=True)
class Left:
    """What is left over of each measurement's components, (n, k)."""

    by_noise: Floats  # by what stated noise alone would leave over; NaN = nothing to hold it against
    disturbed: Floats  # what a hard manoeuvre would add to its square; infinite where there is nothing
    share: Floats  # how much of the evidence counts

    def of(self, rows: Ints) -> Left:
        """Of some of the measurements."""
        return Left(self.by_noise[rows], self.disturbed[rows], self.share[rows])


def rows_of(told: Sequence[tuple[int, Event]]) -> Rows:
    """Measurements of one kind, reports or plots, each with its track; not in order yet."""
    events = [event for _, event in told]
    at = np.array([event.measure.at for event in events], dtype=np.int64)
    source = np.zeros(len(told), dtype=np.int64)
    if isinstance(events[0].measure, Plot):
        plots = [event.measure for event in events if isinstance(event.measure, Plot)]
        source = np.array([plot.radar for plot in plots], dtype=np.int64)
        value, sigma = np.array([plot.polar for plot in plots]), np.array([plot.sigma for plot in plots])
    else:
        fixes = [event.measure for event in events if isinstance(event.measure, Fix)]
        value = np.concatenate([part for fix in fixes for part in (fix.enu_m, _velocity(fix))]).reshape(-1, 6)
        value[[not fix.has_height for fix in fixes], 2] = math.nan
        sigma = np.empty(value.shape)
        sigma[:, :3] = np.concatenate([fix.sigma_m for fix in fixes]).reshape(-1, 3)
        sigma[:, 3:] = np.array([fix.velocity_sigma_mps for fix in fixes])[:, None]
    group = np.array([track for track, _ in told], dtype=np.int64) * RADARS + source
    velocity = np.concatenate([event.mean[VELOCITY] for event in events]).reshape(-1, 3)
    speed_mps = np.sqrt(np.square(velocity).sum(axis=1))
    return Rows(group, at, value, sigma, speed_mps, np.arange(len(told)))


def _velocity(fix: Fix) -> Floats:
    """East, north, up (3,) of a report, m/s; where one is missing along its own axes, turned by a degree 100 km away."""
    if fix.local is None or not math.isnan(fix.velocity_mps[0]):
        return fix.velocity_mps
    return fix.local.velocity_mps


def left_of_reports(rows: Rows) -> Left:
    """What is left over of reports' positions and velocities, k = 6.

    Gusts shake velocities like noise does: vertical ones by any amount, and level ones a little.
    """
    left = _nothing(rows)
    for known, components in _alike(rows, range(3)):
        _pairs(rows, known, components, left)
    for first in (0, 1):
        for known, components in _alike(rows, range(3 * first, 3 * first + 3)):
            _differences(rows, _windows(rows, known, 3), components, MANOEUVRE[first], LINE, left)
            _differences(rows, _windows(rows, known, 4), components, MANOEUVRE[first + 1], PARABOLA, left)
    apart_s = np.append(math.inf, np.diff(rows.at_s))
    shaken = GUST_MPS * np.clip(apart_s, 0.0, 1.0)[:, None] / rows.sigma[:, LEVEL]
    left.disturbed[:, LEVEL] += shaken * shaken
    left.disturbed[:, CLIMB] = math.inf
    return left


def left_of_plots(rows: Rows) -> Left:
    """What is left over of plots, k = 3: straight flight bends range and angles too, more at speed and close by."""
    left = _nothing(rows)
    distance_m = _last_known(rows)
    bends = MANOEUVRE[0] + 2.0 * rows.speed_mps**2 / distance_m
    bends_more = MANOEUVRE[1] + 6.0 * rows.speed_mps**3 / distance_m**2
    for known, (component,) in _alike(rows, (0,), (1,), (2,)):
        by = np.ones_like(distance_m) if component == 0 else 1.0 / distance_m
        for size, derivative, share in ((3, bends * by, LINE), (4, bends_more * by, PARABOLA)):
            windows = _windows(rows, known, size)
            _differences(rows, windows, [component], derivative[windows[:, -1:]], share, left)
    return left


def _last_known(rows: Rows) -> Floats:
    """The distance (n,) of each plot's target when it was last measured; 1 m, at which anything may be, where it never was."""
    distance = rows.value[:, 0]
    place = np.maximum.accumulate(np.where(np.isnan(distance), 0, np.arange(len(distance))))
    known = (rows.group[place] == rows.group) & (distance[place] > 1.0)
    return np.where(known, distance[place], 1.0)


def _nothing(rows: Rows) -> Left:
    nowhere = np.full(rows.value.shape, math.nan)
    return Left(nowhere, np.full(rows.value.shape, math.inf), np.zeros(rows.value.shape))


def _alike(rows: Rows, *wholes: Sequence[int]) -> Iterator[tuple[Ints, list[int]]]:
    """The rows in which components are known, and these: together where it is the same rows."""
    known = ~np.isnan(rows.value)
    for whole in wholes:
        by_mask: dict[bytes, list[int]] = {}
        for component in whole:
            by_mask.setdefault(known[:, component].tobytes(), []).append(component)
        for components in by_mask.values():
            yield np.flatnonzero(known[:, components[0]]), components


def _windows(rows: Rows, known: Ints, size: int) -> Ints:
    """Rows (m, size) that follow each other among those known, in one group, the last of them new."""
    count = max(len(known) - size + 1, 0)
    windows = np.stack([known[start : start + count] for start in range(size)], axis=1)
    return np.asarray(windows[(rows.group[windows[:, 0]] == rows.group[windows[:, -1]]) & rows.new[windows[:, -1]]])


def _differences(
    rows: Rows, windows: Ints, components: Sequence[int], derivative: Floats | float, share: float, left: Left
) -> None:
    """Divided differences in windows (m, size) into `left`, where they are less disturbed than what is there.

    The divided difference of s values is their (s-1)-th derivative somewhere between them, by (s-1)!.
    """
    if not len(windows):
        return
    size = windows.shape[1]
    at_s = rows.at_s[windows]
    apart = at_s[:, :, None] - at_s[:, None, :]
    apart[:, range(size), range(size)] = 1.0
    weight = (1.0 / apart.prod(axis=2))[:, :, None]
    value, sigma = rows.value[windows][:, :, components], rows.sigma[windows][:, :, components]
    if rows.value.shape[1] == 3 and components[0] == 1:  # azimuths turn over
        value = value - 2.0 * math.pi * np.round((value - value[:, -1:]) / (2.0 * math.pi))
    variance = np.square(weight * sigma).sum(axis=1)
    disturbed = np.square(np.asarray(derivative) / math.factorial(size - 1)) / variance
    _take(left, windows[:, -1], components, (weight * value).sum(axis=1), variance, disturbed, share)


def _pairs(rows: Rows, known: Ints, components: Sequence[int], left: Left) -> None:
    """Reports less the ones before them, moved by the mean of both velocities, into `left`."""
    windows = _windows(rows, known, 2)
    if not len(windows):
        return
    t = np.diff(rows.at_s[windows], axis=1)
    faster = [component + 3 for component in components]
    value, speed = rows.value[windows][:, :, components], rows.value[windows][:, :, faster]
    off = value[:, 1] - value[:, 0] - 0.5 * t * speed.sum(axis=1)
    variance = np.square(rows.sigma[windows][:, :, components]).sum(axis=1)
    by_speed = 0.25 * t * t * np.square(rows.sigma[windows][:, :, faster]).sum(axis=1)
    disturbed = np.where(np.isnan(off), math.inf, (np.square(MANOEUVRE[1] * t * t * t / 12.0) + by_speed) / variance)
    _take(left, windows[:, -1], components, off, variance, disturbed, PAIR)


def _take(
    left: Left, rows: Ints, components: Sequence[int], off: Floats, variance: Floats, disturbed: Floats, share: float
) -> None:
    place = rows[:, None], np.array(components)
    there = left.disturbed[place]
    better = (there > CALM) & (disturbed < there)
    left.by_noise[place] = np.where(better, off / np.sqrt(variance), left.by_noise[place])
    left.share[place] = np.where(better, share, left.share[place])
    left.disturbed[place] = np.where(better, disturbed, there)
