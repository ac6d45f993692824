"""Tracklets: where each radar track was a moment ago and how fast it flew, from its own plots of the last seconds.

They are what two radars are compared by: nothing of a position source and nothing of another radar is in them. Each of
range, azimuth and elevation is a parabola through the plots that have it, so that it does not matter which plots lack what.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Plot
from gateway.frames import RadarFrame, turn, xyz_from_polar
from gateway.geodesy import wrap_rad
from gateway.track import Key, RadarTracks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WINDOW_S = 6.0  # short enough that an aircraft's turn is a parabola
SLOW_WINDOW_S = 13.0  # for a radar that turns slowly: nearly all that is remembered of a track
LEAST_PLOTS, LEAST_SPAN_S = 3, 2.5  # with range and azimuth
SILENT_S = 2.0  # without a plot for longer, and for longer than three of its own rhythm, a track is not compared
ACCELERATION_MPS2 = 10.0  # of a parabola, 1 sigma: what an aircraft does, and what polar coordinates add near the radar
UNKNOWN_ELEVATION_RAD = (0.1, 0.1)  # where it is never measured: what aircraft have, and 1 sigma
UNKNOWN_RATE_RADPS = 0.03
_STEP = (1.0, 1e-5, 1e-5, 0.1, 1e-6, 1e-6)  # for derivatives


@dataclass(frozen=True, slots=True, eq=False)
class Tracklets:
    """n radar tracks at one instant: position and velocity in the runway's ENU, and what noise and radar's errors do to them."""

    at: int  # ns
    keys: tuple[Key, ...]
    radar: Ints  # (n,)
    state: Floats  # (n, 6) m, m/s
    covariance: Floats  # (n, 6, 6) of the noise
    by_error: Floats  # (n, 6, 3) derivatives by the radar's range, azimuth and elevation


@dataclass(frozen=True, slots=True, eq=False)
class _Plots:
    """The recent plots of k tracks, m at most, in order of time; where there are fewer, nothing is known."""

    time_s: Floats  # (k, m)
    polar: Floats  # (k, m, 3)
    sigma: Floats  # (k, m, 3)
    count: Ints  # (k,)

    def rows(self, chosen: Bools) -> _Plots:
        """Those of some tracks."""
        return _Plots(self.time_s[chosen], self.polar[chosen], self.sigma[chosen], self.count[chosen])


def tracklets(tracks: RadarTracks, at: int, radars: Mapping[int, RadarFrame]) -> Tracklets:
    """The radar tracks that have enough plots up to an instant, as they were `WINDOW_S` / 2 before it."""
    known = [
        (key, recent) for key, plots in tracks.plots.items() if key[0] in radars and (recent := _recent(plots, at))
    ]
    middle = at - int(0.5 * WINDOW_S * SECOND)
    plots = _gathered([recent for _, recent in known], middle)
    enough = _are_enough(plots)
    keys = tuple(key for (key, _), is_told in zip(known, enough.tolist(), strict=True) if is_told)
    value, rate, spread = _parabolas(plots.rows(enough))
    radar = np.array([key[0] for key in keys], np.int64)
    state, by_polar = _placed(np.concatenate([value, rate], axis=1), radar, radars)
    covariance = by_polar @ spread @ by_polar.transpose(0, 2, 1)
    return Tracklets(middle, keys, radar, state, covariance, np.ascontiguousarray(by_polar[:, :, :3]))


def _recent(plots: tuple[Plot, ...], at: int) -> tuple[Plot, ...]:
    """A track's plots of the last seconds; none where they are too few."""
    last = bisect_right(plots, at, key=_at) if plots[-1].at > at else len(plots)
    first = bisect_left(plots, at - int(WINDOW_S * SECOND), key=_at)
    if last - first <= LEAST_PLOTS:
        first = max(last - LEAST_PLOTS - 1, bisect_left(plots, at - int(SLOW_WINDOW_S * SECOND), key=_at))
    return plots[first:last] if last - first >= LEAST_PLOTS else ()


def _at(plot: Plot) -> int:
    return plot.at


def _gathered(tracks: Sequence[tuple[Plot, ...]], middle: int) -> _Plots:
    """Plots as arrays, their times from an instant on."""
    count = np.array([len(plots) for plots in tracks], np.int64)
    longest = int(count.max(initial=1))
    time_s = np.zeros((len(tracks), longest))
    polar, sigma = np.full((len(tracks), longest, 3), math.nan), np.ones((len(tracks), longest, 3))
    if len(tracks):
        filled, every = np.arange(longest) < count[:, None], [plot for plots in tracks for plot in plots]
        time_s[filled] = np.array([plot.at - middle for plot in every]) / SECOND
        # One number after the other: NumPy looks at every tuple thrice before it takes it for a row.
        told = np.fromiter(chain.from_iterable(plot.polar + plot.sigma for plot in every), np.float64, 6 * len(every))
        polar[filled], sigma[filled] = told.reshape(-1, 2, 3).transpose(1, 0, 2)
    return _Plots(time_s, polar, sigma, count)


def _are_enough(plots: _Plots) -> Bools:
    """Which tracks (k,) are told by their plots: of enough of them, and not too old."""
    newest = np.take_along_axis(plots.time_s, np.maximum(plots.count - 1, 0)[:, None], axis=1)[:, 0]
    span_s = newest - plots.time_s[:, 0]
    silence_s = 0.5 * WINDOW_S - newest
    rhythm_s = span_s / np.maximum(plots.count - 1, 1)
    measured = (~np.isnan(plots.polar[:, :, :2])).sum(axis=1).min(axis=1)
    is_heard = silence_s <= np.maximum(SILENT_S, 3.0 * rhythm_s)
    return np.asarray((measured >= LEAST_PLOTS) & (span_s >= LEAST_SPAN_S) & is_heard)


def _parabolas(plots: _Plots) -> tuple[Floats, Floats, Floats]:
    """Range, azimuth, elevation of k tracks (k, 3), their rates (k, 3), and the covariance of both (k, 6, 6); at time 0."""
    polar, time_s, count = plots.polar, plots.time_s, len(plots.count)
    known = ~np.isnan(polar)
    first = np.take_along_axis(polar, known.argmax(axis=1)[:, None, :], axis=1)  # (k, 1, 3) the first that is known
    first = np.where(np.isnan(first), UNKNOWN_ELEVATION_RAD[0], first)
    off = np.where(known, polar - first, 0.0)
    off[:, :, 1] = wrap_rad(off[:, :, 1])
    weight = np.where(known, plots.sigma**-2.0, 0.0)
    information, vector = np.zeros((count, 3, 3, 3)), np.zeros((count, 3, 3))
    powers = (np.ones_like(time_s), time_s, 0.5 * time_s**2)
    for row in range(3):
        vector[:, :, row] = (weight * off * powers[row][:, :, None]).sum(axis=1)
        for column in range(row, 3):
            told = (weight * (powers[row] * powers[column])[:, :, None]).sum(axis=1)
            information[:, :, row, column] = information[:, :, column, row] = told
    distance = np.maximum(first[:, 0, 0], 300.0)
    bend = np.stack([np.ones_like(distance), distance, distance], axis=-1) / ACCELERATION_MPS2
    information[:, :, 2, 2] += bend**2
    flat = ~known[:, :, 2].any(axis=1)
    information[:, 2, 0, 0] += flat / UNKNOWN_ELEVATION_RAD[1] ** 2
    information[:, 2, 1, 1] += 1.0 / UNKNOWN_RATE_RADPS**2
    spread = np.linalg.inv(information)
    found = (spread @ vector[..., None])[..., 0]
    covariance = np.zeros((count, 6, 6))
    for component in range(3):
        places = np.ix_(range(count), (component, component + 3), (component, component + 3))
        covariance[places] = spread[:, component, :2, :2]
    return first[:, 0] + found[:, :, 0], found[:, :, 1], covariance


def _placed(polar: Floats, radar: Ints, radars: Mapping[int, RadarFrame]) -> tuple[Floats, Floats]:
    """Position and velocity in ENU (n, 6) of polar values and rates (n, 6), and the derivatives (n, 6, 6) of these by those."""
    state, by_polar = np.zeros((len(polar), 6)), np.zeros((len(polar), 6, 6))
    for number in np.unique(radar).tolist():
        rows, frame = radar == number, radars[number]
        state[rows] = _moving(polar[rows], frame)
        for place, step in enumerate(_STEP):
            aside = np.zeros(6)
            aside[place] = step
            ahead, behind = _moving(polar[rows] + aside, frame), _moving(polar[rows] - aside, frame)
            by_polar[rows, :, place] = (ahead - behind) / (2.0 * step)
    return state, by_polar


def _moving(polar: Floats, frame: RadarFrame) -> Floats:
    """ENU position and velocity (n, 6) of range, azimuth, elevation and their rates (n, 6)."""
    r, azimuth, elevation, closing, turning, rising = polar.T
    level, climb = r * np.cos(elevation), np.sin(elevation)
    out = closing * np.cos(elevation) - rising * r * climb
    x = out * np.cos(azimuth) - turning * level * np.sin(azimuth)
    y = out * np.sin(azimuth) + turning * level * np.cos(azimuth)
    velocity = np.stack([x, y, closing * climb + rising * level], axis=-1)
    place = frame.to_enu(xyz_from_polar(np.ascontiguousarray(polar[:, :3])))
    return np.concatenate([place, turn(frame.enu_from_radar, velocity)], axis=1)
