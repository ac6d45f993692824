"""What a source's successive measurements tell of its noise, whatever a filter thinks of them.

A measurement is held against its own neighbours in time: the straight line or the parabola through those before it, or, for a
report with velocity, the last report moved by the mean of both velocities. What is left over is the noise of those
measurements, and the little that the target did otherwise. Constant errors, and errors that last, cancel out.

Of the ways the one is taken that a manoeuvre disturbs least, by the intervals and the stated noise alone; how much a hard
one would disturb it comes along. Manoeuvres only add: what is left over is never less than the noise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.frames import RadarFrame, polar_from_xyz
from gateway.fuse.events import Event

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# A hard manoeuvre, that lasts: acceleration m/s2, and its first and second derivative by time.
MANOEUVRE = (3.0, 0.6, 0.1)
CALM = 0.05  # of the noise's variance: no other way is looked for
# How much of the evidence counts, because measurements that follow each other share noise: for a line through the two
# before, a parabola through three, and pairs of reports. So that exp(evidence) has a mean of 1 where noise is as stated.
LINE, PARABOLA, PAIR = 0.52, 0.45, 0.65


@dataclass(frozen=True, slots=True)
class Rows:
    """n measurements of one kind, those of one track and source together and in order of time."""

    group: Ints  # (n,) which track and source
    new: Bools  # (n,) False: only there to be held against
    at_s: Floats  # (n,)
    value: Floats  # (n, k): position m and velocity m/s, or range m, azimuth and elevation rad; NaN = not measured
    sigma: Floats  # (n, k) as stated


@dataclass(frozen=True, slots=True)
class Left:
    """What is left over of each measurement's components, (n, k)."""

    by_noise: Floats  # by what stated noise alone would leave over; NaN = nothing to hold it against
    disturbed: Floats  # what a hard manoeuvre would add to its square; infinite where there is nothing
    share: Floats  # how much of the evidence counts

    def of(self, rows: Ints) -> Left:
        """Of some of the measurements."""
        return Left(self.by_noise[rows], self.disturbed[rows], self.share[rows])


def rows_of(groups: Sequence[tuple[Sequence[Event], int]]) -> Rows:
    """The measurements of some groups, each in order with how many of the first were looked at before."""
    events = [event for group, _ in groups for event in group]
    group = np.repeat(np.arange(len(groups)), [len(each) for each, _ in groups])
    new = np.concatenate([np.arange(len(each)) >= known for each, known in groups])
    at = np.array([event.at for event in events], dtype=np.int64)
    if isinstance(events[0].measure, Plot):
        plots = [event.measure for event in events if isinstance(event.measure, Plot)]
        value, sigma = np.array([plot.polar for plot in plots]), np.array([plot.sigma for plot in plots])
    else:
        fixes = [event.measure for event in events if isinstance(event.measure, Fix)]
        value = np.concatenate([[fix.enu_m for fix in fixes], [fix.velocity_mps for fix in fixes]], axis=1)
        value[[not fix.has_height for fix in fixes], 2] = math.nan
        speed_sigma = np.repeat([[fix.velocity_sigma_mps] for fix in fixes], 3, axis=1)
        sigma = np.concatenate([[fix.sigma_m for fix in fixes], speed_sigma], axis=1)
    return Rows(group, new, (at - at.min()) / SECOND, value, sigma)


def left_of_reports(rows: Rows) -> Left:
    """What is left over of reports' positions and velocities, k = 6."""
    left = _nothing(rows)
    for component in range(6):
        if component < 3:
            _pairs(rows, component, left)
        line, parabola = MANOEUVRE[component // 3], MANOEUVRE[component // 3 + 1]
        for size, derivative, share in ((3, line, LINE), (4, parabola, PARABOLA)):
            windows = _windows(rows, component, size)
            value = rows.value[windows, component]
            _differences(rows, component, windows, value, np.full(len(windows), derivative), share, left)
    return left


def left_of_plots(rows: Rows, events: Sequence[Event], frames: Mapping[int, RadarFrame]) -> Left:
    """What is left over of plots, k = 3, beside straight flight as the track (`events`, one a row) now knows it."""
    left = _nothing(rows)
    radar = np.array([event.measure.radar if isinstance(event.measure, Plot) else 0 for event in events])
    mean = np.array([event.mean for event in events])
    for number, frame in frames.items():
        for component in range(3):
            for size, derivative, share in ((3, MANOEUVRE[0], LINE), (4, MANOEUVRE[1], PARABOLA)):
                windows = _windows(rows, component, size)
                windows = windows[radar[windows[:, -1]] == number]
                newest = windows[:, -1]
                elapsed_s = rows.at_s[windows] - rows.at_s[newest][:, None]
                flown = mean[newest, None, :3] + elapsed_s[:, :, None] * mean[newest, None, 3:6]
                straight = polar_from_xyz(frame.from_enu(flown))
                value = rows.value[windows, component] - straight[:, :, component]
                if component == 1:
                    value = value - 2.0 * math.pi * np.round(value / (2.0 * math.pi))
                by = derivative / (1.0 if component == 0 else np.maximum(straight[:, -1, 0], 1.0))
                _differences(rows, component, windows, value, np.broadcast_to(by, newest.shape), share, left)
    return left


def _nothing(rows: Rows) -> Left:
    nowhere = np.full(rows.value.shape, math.nan)
    return Left(nowhere, np.full(rows.value.shape, math.inf), np.zeros(rows.value.shape))


def _windows(rows: Rows, component: int, size: int) -> Ints:
    """Rows (m, size) that follow each other in one group and have a component, the last of them new."""
    known = np.flatnonzero(~np.isnan(rows.value[:, component]))
    if len(known) < size:
        return np.zeros((0, size), dtype=np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(known, size)
    first, last = windows[:, 0], windows[:, -1]
    return np.asarray(windows[(rows.group[first] == rows.group[last]) & rows.new[last]])


def _differences(
    rows: Rows, component: int, windows: Ints, value: Floats, derivative: Floats, share: float, left: Left
) -> None:
    """Divided differences of values (m, size) into `left`, where they are less disturbed than what is there.

    The divided difference of s values is their (s-1)-th derivative somewhere between them, by (s-1)!.
    """
    size = windows.shape[1]
    at_s, sigma = rows.at_s[windows], rows.sigma[windows, component]
    apart = at_s[:, :, None] - at_s[:, None, :]
    apart[:, range(size), range(size)] = 1.0
    weight = 1.0 / apart.prod(axis=2)
    variance = (weight * weight * sigma * sigma).sum(axis=1)
    disturbed = (derivative / math.factorial(size - 1)) ** 2 / variance
    _take(left, windows[:, -1], component, (weight * value).sum(axis=1), variance, disturbed, share)


def _pairs(rows: Rows, component: int, left: Left) -> None:
    """Reports less the ones before them, moved by the mean of both velocities, into `left`."""
    windows = _windows(rows, component, 2)
    before, after = windows[:, 0], windows[:, 1]
    t = rows.at_s[after] - rows.at_s[before]
    value, speed = rows.value[:, component], rows.value[:, component + 3]
    off = value[after] - value[before] - 0.5 * t * (speed[before] + speed[after])
    variance = (rows.sigma[windows, component] ** 2).sum(axis=1)
    by_speed = 0.25 * t * t * (rows.sigma[windows, component + 3] ** 2).sum(axis=1)
    disturbed = ((MANOEUVRE[1] * t * t * t / 12.0) ** 2 + by_speed) / variance
    known = ~np.isnan(off)
    _take(left, after[known], component, off[known], variance[known], disturbed[known], PAIR)


def _take(
    left: Left, rows: Ints, component: int, off: Floats, variance: Floats, disturbed: Floats, share: float
) -> None:
    there = left.disturbed[rows, component]
    better = (there > CALM) & (disturbed < there)
    chosen = rows[better]
    left.by_noise[chosen, component] = off[better] / np.sqrt(variance[better])
    left.disturbed[chosen, component] = disturbed[better]
    left.share[chosen, component] = share
