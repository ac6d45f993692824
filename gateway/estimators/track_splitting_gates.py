"""Which plots lie near which predictions: a grid over the first two components, so that cost follows what is near."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FEW = 4096  # predictions times plots: up to here comparing all with all is quicker than a grid
CELLS_AT_MOST = 1 << 20  # of the grid, along one axis


def near(
    expected: Floats, reach: Floats, value: Floats, spread: Floats, turn: float | None = None
) -> tuple[Ints, Ints]:
    """Pairs (prediction, plot), in this order: no component further apart than reach + spread.

    expected, reach (k, n); value, spread (k, m), NaN = not measured, which is near everything. `turn`: after how much the second
    component is the same again, None = never.
    """
    if turn is not None:
        return _all_around(expected, reach, value, spread, turn)
    n, m = expected.shape[1], value.shape[1]
    if n * m <= FEW:
        return _all_with_all(expected, reach, value, spread)
    partial = np.isnan(value[:2]).any(axis=0)
    if not partial.any():
        return _by_grid(expected, reach, value, spread)
    whole, rest = np.flatnonzero(~partial), np.flatnonzero(partial)
    row, plot = _by_grid(expected, reach, value[:, whole], spread[:, whole])
    other_row, other_plot = _all_with_all(expected, reach, value[:, rest], spread[:, rest])
    row, plot = np.concatenate([row, other_row]), np.concatenate([whole[plot], rest[other_plot]])
    order = np.lexsort((plot, row))
    return row[order], plot[order]


def _all_around(expected: Floats, reach: Floats, value: Floats, spread: Floats, turn: float) -> tuple[Ints, Ints]:
    """The same where the second component is an angle: plots near its ends are looked at from both."""
    m = value.shape[1]
    margin = reach[1].max(initial=0.0) + spread[1].max(initial=0.0)
    low, high = expected[1].min(initial=0.0) - margin, expected[1].max(initial=0.0) + margin
    again = [np.flatnonzero((value[1] + way >= low) & (value[1] + way <= high)) for way in (-turn, turn)]
    which = np.concatenate([np.arange(m), *again])
    shifted, wide = value[:, which], spread[:, which]
    shifted[1, m : m + len(again[0])] -= turn
    shifted[1, m + len(again[0]) :] += turn
    row, plot = near(expected, reach, shifted, wide)
    plot = which[plot]
    if not (len(again[0]) or len(again[1])):
        return row, plot
    key = np.unique(row * max(m, 1) + plot)
    return np.divmod(key, max(m, 1))


def _all_with_all(expected: Floats, reach: Floats, value: Floats, spread: Floats) -> tuple[Ints, Ints]:
    apart = np.abs(expected[:, :, None] - value[:, None, :]) > reach[:, :, None] + spread[:, None, :]
    row, plot = np.nonzero(~apart.any(axis=0))
    return row, plot


def _by_grid(expected: Floats, reach: Floats, value: Floats, spread: Floats) -> tuple[Ints, Ints]:
    """Plots sorted by bands of the second component, and by the first in each; a prediction looks into bands it touches."""
    if not value.shape[1] or not expected.shape[1]:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    margin = spread.max(axis=1)
    low, high = expected - reach - margin[:, None], expected + reach + margin[:, None]
    origin, width = value[1].min(), 2.0 * float(np.median(high[1] - low[1]))
    width = max(width, float(np.ptp(value[1])) / CELLS_AT_MOST, 1e-12)
    band = np.floor((value[1] - origin) / width).astype(np.int64)
    bands = int(band.max()) + 1
    order = np.lexsort((value[0], band))
    # One sorted number for band and place within: bands lie a stride apart that exceeds every place.
    least, stride = value[0].min(), np.ptp(value[0]) + 1.0
    sorted_key = band[order] * (2.0 * stride) + (value[0][order] - least)
    first = np.clip(np.floor((low[1] - origin) / width), 0, bands).astype(np.int64)
    last = np.clip(np.floor((high[1] - origin) / width), -1, bands - 1).astype(np.int64)
    row, band_of = _ranges(first, last + 1)
    base = band_of * (2.0 * stride)
    start = np.searchsorted(sorted_key, base + np.clip(low[0][row] - least, -0.5 * stride, 1.5 * stride), "left")
    end = np.searchsorted(sorted_key, base + np.clip(high[0][row] - least, -0.5 * stride, 1.5 * stride), "right")
    which, place = _ranges(start, end)
    row, plot = row[which], order[place]
    apart = np.abs(expected[:, row] - value[:, plot]) > reach[:, row] + spread[:, plot]
    close = ~apart.any(axis=0)
    row, plot = row[close], plot[close]
    order = np.lexsort((plot, row))
    return row[order], plot[order]


def _ranges(start: Ints, end: Ints) -> tuple[Ints, Ints]:
    """All whole numbers from start up to end of each row, with the row's place."""
    count = np.maximum(end - start, 0)
    row = np.repeat(np.arange(len(count)), count)
    before = np.cumsum(count) - count
    return row, np.arange(len(row)) - before[row] + start[row]
