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
    for known, components in _alike(rows, range(3)):
        _pairs(rows, known, components, left)
    for first in (0, 1):
        for known, components in _alike(rows, range(3 * first, 3 * first + 3)):
            _differences(rows, _windows(rows, known, 3), components, MANOEUVRE[first], LINE, left)
            _differences(rows, _windows(rows, known, 4), components, MANOEUVRE[first + 1], PARABOLA, left)
    return left


def left_of_plots(rows: Rows, speed_mps: Floats) -> Left:
    """What is left over of plots, k = 3, of targets that fly at speeds (n,): straight flight bends range and angles too."""
    left = _nothing(rows)
    distance_m = _last_known(rows)
    bends = MANOEUVRE[0] + 2.0 * speed_mps**2 / distance_m
    bends_more = MANOEUVRE[1] + 6.0 * speed_mps**3 / distance_m**2
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
