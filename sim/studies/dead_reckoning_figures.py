"""Paper 002-4's figures 2 and 3 drawn into an .rrd: the distance to the truth over the time without GPS."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from sim.studies.dead_reckoning import Outcome

COLORS = ([150, 150, 150], [255, 140, 0], [190, 120, 255], [60, 120, 255], [70, 200, 120], [230, 30, 40])


def draw(path: Path, found: dict[str, dict[str, Outcome]]) -> None:
    """The median run of each method, on a logarithmic scale."""
    with rr.RecordingStream("talkdown_study", recording_id="dead-reckoning") as recording:
        ends = (rrb.TimeRangeBoundary.cursor_relative(seconds=span) for span in (-200.0, 200.0))
        axis = rrb.TimeAxis(view_range=rrb.TimeRange(*ends))
        views = [
            rrb.TimeSeriesView(origin=f"/{name}", name=f"{name}: log10 of the distance to the truth, m", axis_x=axis)
            for name in found
        ]
        blueprint = rrb.Blueprint(
            rrb.Vertical(*views), rrb.TimePanel(timeline="without GPS", state="collapsed"), collapse_panels=True
        )
        recording.save(str(path), default_blueprint=blueprint)
        recording.send_recording_name("002-4: dead reckoning without GPS")
        for name, methods in found.items():
            for color, (method, outcome) in zip(COLORS, methods.items(), strict=False):
                entity = f"/{name}/{method.replace(', ', '_').replace(' ', '_')}"
                recording.log(entity, rr.SeriesLines(colors=color, names=method), static=True)
                middle = np.log10(np.maximum(np.median(outcome.error_m, axis=0), 0.1))
                when = rr.TimeColumn("without GPS", duration=np.arange(len(middle), dtype=np.float64))
                recording.send_columns(entity, [when], rr.Scalars.columns(scalars=middle))
