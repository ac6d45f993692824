"""The time of dead reckoning: cells of a tenth of a second, and what a vehicle told in each.

Within a cell the unit's rate and force are their means, of samples joined by straight lines, however often they come. What
else was told in a cell is brought to the cell's end. The filters go through a block of cells at once, of many vehicles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import product, turned_by
from gateway.reckon.told import AIRSPEED, ALTITUDE, ATTITUDE, PLACE, RESTING, Series, Told

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SECOND = 1_000_000_000
CELL_NS = 100_000_000
CELL_S = CELL_NS / 1e9
SECOND_CELLS = 10
BLOCK = 5  # cells that the filters go through at once: what is told in one counts at its end
PAST_CELLS = 20
RESTS_NS = 3 * SECOND  # so long counts what a vehicle says of its rest
GAP_NS = 500_000_000  # between two samples of the unit: beyond it nobody knows how it moved


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """n cells of one vehicle, from the cell `first` on; NaN = not told. Places stand where they were `late_s` before the end."""

    first: int
    rate_radps: Floats  # (n, 3)
    force_mps2: Floats  # (n, 3)
    unseen: Floats  # (n, 6) of force and rate, in a root Hz: what moved between samples and was not seen
    turned_radps: Floats  # (n, 3) the rate by the autopilot's attitude; NaN where it does not tell it often enough
    attitude: Floats  # (n, 4)
    airspeed_mps: Floats  # (n,) indicated
    altitude_m: Floats  # (n,)
    rest: Floats  # (n,) see `told.RESTING`
    place: Floats  # (n, 9), see `told.PLACE`: of each half second the first position
    place_late_s: Floats  # (n,)
    pictured: Floats  # (n, 9)
    pictured_late_s: Floats  # (n,)

    def __len__(self) -> int:
        return len(self.rate_radps)

    @property
    def end(self) -> int:
        """The cell after the last one."""
        return self.first + len(self)


def covered_until(told: Told, first: int) -> int:
    """The cell after the last one, from `first` on, that the unit's samples cover without a gap; `first` if there is none."""
    at = told.inertial.at
    begin = int(np.searchsorted(at, first * CELL_NS, side="right")) - 1
    if begin < 0:
        return first
    gaps = np.flatnonzero(np.diff(at[begin:]) > GAP_NS)
    last = int(at[begin + gaps[0]] if len(gaps) else at[-1])
    return max(last // CELL_NS // BLOCK * BLOCK, first)


def first_covered(told: Told, after: int) -> int:
    """The first cell, not before `after`, that the unit's newest unbroken samples cover."""
    at = told.inertial.at
    gaps = np.flatnonzero(np.diff(at) > GAP_NS)
    since = int(at[gaps[-1] + 1] if len(gaps) else at[0]) if len(at) else 1 << 62
    return max(-(-since // CELL_NS), after)


def cells(told: Told, first: int, end: int) -> Cells:
    """What was told in the cells from `first` up to `end`, which the unit's samples must cover."""
    inertial, n = told.inertial, end - first
    means = _means(inertial, first - 1, n + 1)
    attitude, turned = _attitudes(told, means[:, 3:6], first, n)
    unseen = _unseen(inertial, first, n) if told.noise is None else np.broadcast_to(told.noise, (n, 6))
    place, place_late = _first_of_blocks(told.places, first, n)
    pictured, pictured_late = _first_of_blocks(told.pictured, first, n)
    airspeed, altitude = (_last(told.series[kind], first, n)[0][:, 0] for kind in (AIRSPEED, ALTITUDE))
    return Cells(
        first,
        means[1:, 3:6],
        means[1:, :3],
        unseen,
        turned,
        attitude,
        airspeed,
        altitude,
        _held(told.series[RESTING], first, n),
        place,
        place_late,
        pictured,
        pictured_late,
    )


def _attitudes(told: Told, gyro_radps: Floats, first: int, n: int) -> tuple[Floats, Floats]:
    """The autopilot's attitude at the ends of cells (n, 4), and the rates (n, 3) that it turned by in them.

    `gyro_radps`: of these cells and the one before (n + 1, 3). Where it tells its attitude in one cell and in the one before,
    it has turned by what is between them: it has seen all samples of its gyro, and of those few may be told.
    """
    attitude, late_s = _last(told.series[ATTITUDE], first - 1, n + 1)
    attitude = product(attitude, turned_by(gyro_radps * np.nan_to_num(late_s)[:, None]))
    turned = product(attitude[:-1] * [1.0, -1.0, -1.0, -1.0], attitude[1:])
    rate = 2.0 / CELL_S * turned[:, 1:] * np.where(turned[:, :1] < 0.0, -1.0, 1.0)
    return attitude[1:], rate


def _means(inertial: Series, first: int, n: int) -> Floats:
    """Means (n, 6) over cells of what straight lines between samples say."""
    begin, over = inertial.between(first * CELL_NS, (first + n) * CELL_NS + 1)
    begin, over = max(begin - 1, 0), min(over + 1, len(inertial.at))
    time = (inertial.at[begin:over] - first * CELL_NS) / 1e9
    values = inertial.values[begin:over, :6]
    steps = np.diff(time)[:, None]
    whole = np.concatenate([np.zeros((1, 6)), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)])
    bounds = np.arange(n + 1) * CELL_S
    place = np.clip(np.searchsorted(time, bounds, side="right") - 1, 0, max(len(time) - 2, 0))
    past = (bounds - time[place])[:, None]
    slope = (values[place + 1] - values[place]) / np.maximum(steps[place], 1e-9)
    reached = whole[place] + past * (values[place] + 0.5 * past * slope)
    return np.asarray(np.diff(reached, axis=0) / CELL_S)


def _unseen(inertial: Series, first: int, n: int) -> Floats:
    """By how much neighbouring samples of the last two seconds scatter, as noise in a root Hz (n, 6).

    What changes from one sample to the next may have changed in between: few samples a second of a unit that shakes tell
    less than their number.
    """
    begin, over = inertial.between((first - PAST_CELLS) * CELL_NS, (first + n) * CELL_NS)
    at, values = inertial.at[begin:over], inertial.values[begin:over, :6]
    square = np.concatenate([np.zeros((1, 6)), np.cumsum(0.5 * np.diff(values, axis=0) ** 2, axis=0)])
    ends = np.searchsorted(at, (np.arange(first, first + n) + 1) * CELL_NS) - 1
    begins = np.minimum(np.searchsorted(at, (np.arange(first, first + n) - PAST_CELLS) * CELL_NS), ends)
    counts = np.maximum(ends - begins, 1)[:, None]
    length_s = (at[ends] - at[begins])[:, None] / 1e9
    return np.asarray(np.sqrt((square[ends] - square[begins]) / counts * np.maximum(length_s, CELL_S) / counts))


def _last(series: Series, first: int, n: int) -> tuple[Floats, Floats]:
    """The last values of each cell (n, k), and how long before its end, s; NaN = none."""
    values, late = np.full((n, series.values.shape[1]), np.nan), np.full(n, np.nan)
    begin, over = series.between(first * CELL_NS, (first + n) * CELL_NS)
    at = series.at[begin:over]
    cell = at // CELL_NS - first
    values[cell] = series.values[begin:over]
    late[cell] = ((cell + first + 1) * CELL_NS - at) / 1e9
    return values, late


def _held(series: Series, first: int, n: int) -> Floats:
    """What was told last by the ends of cells (n,), and not long ago; NaN = nothing."""
    ends = (np.arange(first, first + n) + 1) * CELL_NS
    last = np.searchsorted(series.at, ends) - 1
    known = last >= 0
    known[known] = ends[known] - series.at[last[known]] <= RESTS_NS
    values = np.full(n, np.nan)
    values[known] = series.values[last[known], 0]
    return values


def _first_of_blocks(series: Series, first: int, n: int) -> tuple[Floats, Floats]:
    """The first values of each block, in their cells (n, k), and how long before the cell's end, s; NaN = none."""
    values, late = np.full((n, PLACE), np.nan), np.full(n, np.nan)
    begin, over = series.between(first * CELL_NS, (first + n) * CELL_NS)
    at = series.at[begin:over]
    block = at // (BLOCK * CELL_NS)
    before = int(series.at[begin - 1]) // (BLOCK * CELL_NS) if begin else -1
    chosen = np.flatnonzero(block != np.concatenate([[before], block[:-1]]))
    cell = at[chosen] // CELL_NS - first
    values[cell] = series.values[begin:over][chosen]
    late[cell] = ((cell + first + 1) * CELL_NS - at[chosen]) / 1e9
    return values, late


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One block of n vehicles: m cells of each (n, m, ...), and what was told in them last, or first, at the block's end."""

    rate: Floats
    force: Floats
    unseen: Floats
    turned: Floats
    attitude: Floats
    airspeed: Floats
    altitude: Floats
    rest: Floats
    place: Floats
    place_late: Floats
    pictured: Floats
    pictured_late: Floats

    @classmethod
    def of(cls, inputs: Sequence[Cells], cell: int) -> Block:
        """Of vehicles that all were told something in the cells from this one on."""
        rows = [slice(cell - one.first, cell - one.first + BLOCK) for one in inputs]

        def column(name: str) -> NDArray[Any]:
            return np.array([getattr(one, name)[row] for one, row in zip(inputs, rows, strict=True)])

        place, late = _told_first(column("place"), column("place_late_s"))
        pictured, pictured_late = _told_first(column("pictured"), column("pictured_late_s"))
        return cls(
            column("rate_radps"),
            column("force_mps2"),
            column("unseen")[:, -1],
            column("turned_radps"),
            column("attitude")[:, -1],
            _told_last(column("airspeed_mps")),
            _told_last(column("altitude_m")),
            column("rest")[:, -1],
            place,
            late,
            pictured,
            pictured_late,
        )


def _told_last(values: Floats) -> Floats:
    """The last of each row's values (n, m) that is a number."""
    known = ~np.isnan(values)
    last = values.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    return np.asarray(values[np.arange(len(values)), last])


def _told_first(values: Floats, late_s: Floats) -> tuple[Floats, Floats]:
    """The first of each row's values (n, m, k) that is told, and how long before the block's end that was, s (n,)."""
    rows, first = np.arange(len(values)), np.argmax(~np.isnan(late_s), axis=1)
    return values[rows, first], late_s[rows, first] + (BLOCK - 1 - first) * CELL_S
