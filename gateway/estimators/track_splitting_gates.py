"""Which plots lie near which predictions: a grid over the first two components, so that cost follows what is near."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

VERY_FEW = 64  # predictions times plots: up to here looking which are near takes longer than taking all of them
FEW = 4096  # up to here comparing all with all is quicker than a grid
CELLS_PER_PLOT = 16.0  # of the grid, at most
WIDER = 1.0 + 1e-9  # what lies on a box's edge is not lost to rounding


def near(
    expected: Floats, reach: Floats, value: Floats, spread: Floats, turn: float | None = None
) -> tuple[Ints, Ints]:
    """Pairs (prediction, plot), in this order: all whose difference, squared, is in no component more than reach + spread.

    Others may be among them. expected (k, n), value (k, m); reach (k, n) and spread (k, m) are squares, as variances are. NaN =
    not measured, which is near everything. `turn`: after how much the second component is the same again, None = never.
    """
    n, m = expected.shape[1], value.shape[1]
    if n * m <= VERY_FEW:
        return _all(n, m)
    if turn is not None:
        return _all_around(expected, reach, value, spread, turn)
    if n * m <= FEW:
        return _all_with_all(expected, reach, value, spread)
    partial = np.isnan(value[:2]).any(axis=0)
    if not partial.any():
        return _by_grid(expected, reach, value, spread)
    whole, rest = np.flatnonzero(~partial), np.flatnonzero(partial)
    row, plot = _by_grid(expected, reach, value[:, whole], spread[:, whole])
    other_row, other_plot = _all_with_all(expected, reach, value[:, rest], spread[:, rest])
    return _in_order(np.concatenate([row, other_row]), np.concatenate([whole.take(plot), rest.take(other_plot)]), m)


def _all_around(expected: Floats, reach: Floats, value: Floats, spread: Floats, turn: float) -> tuple[Ints, Ints]:
    """The same where the second component is an angle: plots near its ends are looked at from both."""
    m = value.shape[1]
    margin = float(np.sqrt(reach[1].max() + np.fmax.reduce(spread[1], initial=0.0)))
    low, high = float(expected[1].min()) - margin, float(expected[1].max()) + margin
    again = [(value[1] + way >= low) & (value[1] + way <= high) for way in (-turn, turn)]
    if not (again[0].any() or again[1].any()):
        return near(expected, reach, value, spread)
    before, after = (np.flatnonzero(one) for one in again)
    which = np.concatenate([np.arange(m), before, after])
    shifted = value[:, which]
    shifted[1, m : m + len(before)] -= turn
    shifted[1, m + len(before) :] += turn
    row, plot = near(expected, reach, shifted, spread[:, which])
    return _in_order(row, which.take(plot), m)


def _in_order(row: Ints, plot: Ints, plots: int) -> tuple[Ints, Ints]:
    """Pairs in order, each once."""
    key = np.unique(row * plots + plot)
    return np.divmod(key, plots)


@lru_cache(maxsize=256)
def _all(n: int, m: int) -> tuple[Ints, Ints]:
    row, plot = np.divmod(np.arange(n * m), max(m, 1))
    row.flags.writeable = plot.flags.writeable = False
    return row, plot


def _all_with_all(expected: Floats, reach: Floats, value: Floats, spread: Floats) -> tuple[Ints, Ints]:
    gap = expected[:, :, None] - value[:, None, :]
    apart = gap * gap > reach[:, :, None] + spread[:, None, :]
    row, plot = np.logical_not(apart.any(axis=0)).nonzero()
    return row, plot


def _by_grid(expected: Floats, reach: Floats, value: Floats, spread: Floats) -> tuple[Ints, Ints]:
    """Plots sorted into narrow cells of the first component in wide bands of the second; what a prediction's box covers of
    a band is one run of plots."""
    m = value.shape[1]
    if not m:
        return _all(len(expected[0]), 0)
    box = WIDER * np.sqrt(reach[:2] + spread[:2].max(axis=1)[:, None])
    origin = value[:2].min(axis=1)[:, None]
    extent = value[:2].max(axis=1)[:, None] - origin
    least = extent / np.sqrt(CELLS_PER_PLOT * m)
    width = np.maximum(np.median(box, axis=1)[:, None] * [[0.5], [2.0]], np.maximum(least, 1e-12))
    cell_of = ((value[:2] - origin) / width).astype(np.int64)
    columns, bands = (cell_of.max(axis=1) + 1).tolist()
    cell = cell_of[1] * columns + cell_of[0]
    order = cell.argsort(kind="stable")
    start = np.concatenate([[0], np.bincount(cell, minlength=columns * bands).cumsum()])
    ends = np.array([[columns], [bands]])
    first = np.floor((expected[:2] - box - origin) / width).clip(0, ends).astype(np.int64)
    after = np.floor((expected[:2] + box - origin) / width).clip(-1, ends - 1).astype(np.int64) + 1
    row, band = _ranges(first[1], after[1])
    base = band * columns
    which, place = _ranges(start.take(base + first[0].take(row)), start.take(base + after[0].take(row)))
    row, plot = row.take(which), order.take(place)
    gap = expected.take(row, axis=1) - value.take(plot, axis=1)
    apart = gap * gap > reach.take(row, axis=1) + spread.take(plot, axis=1)
    key = (row * m + plot)[np.logical_not(apart.any(axis=0))]
    key.sort()
    return np.divmod(key, m)


def _ranges(start: Ints, end: Ints) -> tuple[Ints, Ints]:
    """All whole numbers from start up to end of each row, with the row's place."""
    count = np.maximum(end - start, 0)
    row = np.arange(len(count)).repeat(count)
    before = count.cumsum() - count
    return row, np.arange(len(row)) + (start - before).take(row)
