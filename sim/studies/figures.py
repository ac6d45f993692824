"""What the studies' figures are drawn with: lines over time, and views that show all of it."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def plot(origin: str, name: str, span_s: float) -> rrb.TimeSeriesView:
    """A view of lines over their first so many seconds, wherever the cursor is."""
    ends = (rrb.TimeRangeBoundary.absolute(seconds=end_s) for end_s in (0.0, span_s))
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(*ends)))


def line(
    recording: rr.RecordingStream,
    path: str,
    time_s: Floats,
    values: Floats,
    color: list[int],
    name: str,
    width: float | None = None,
) -> None:
    """Draw values at times."""
    widths = None if width is None else [width]
    recording.log(path, rr.SeriesLines(colors=[color], names=[name], widths=widths), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def path_of(name: str) -> str:
    """A name as a part of an entity's path."""
    return name.lower().replace(",", "").replace(" ", "-")
