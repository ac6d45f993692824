"""Paper 002-2's figures drawn into an .rrd: the path open, closed and true, in space and over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.estimators import flight_path as paths
from sim.studies.reconstruction import flight, recorded, through_air

Floats = NDArray[np.float64]

TRUE, OPEN, CLOSED = [150, 150, 150], [255, 140, 0], [230, 30, 40]


def draw(path: Path, seed: int) -> None:
    """One flight with a recorder's steps and noise."""
    flown = flight(seed)
    said = recorded(flown, seed)
    open_m = through_air(flown, said)[:, :2]
    closed_m, _ = paths.closed(flown.time_s, open_m, flown.place_m[-1, :2])
    height = paths.pressure_height(said.pressure_pa, float(said.pressure_pa[0]))
    with rr.RecordingStream("talkdown_study", recording_id=f"reconstruction-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint(float(flown.time_s[-1])))
        recording.send_recording_name("002-2: a flight rebuilt from flight parameters")
        recording.log("/flight", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        when = rr.TimeColumn("time", duration=flown.time_s)
        for name, level, color in (
            ("true", flown.place_m[:, :2], TRUE),
            ("open", open_m, OPEN),
            ("closed", closed_m, CLOSED),
        ):
            high = flown.place_m[:, 2] if name == "true" else height
            line = np.concatenate([level, high[:, None]], axis=1)
            recording.log(
                f"/flight/{name}", rr.LineStrips3D([line], colors=color, radii=-1.5, labels=name), static=True
            )
            recording.log(f"/flight/{name}/here", rr.Points3D.from_fields(colors=color, radii=-5.0), static=True)
            recording.send_columns(f"/flight/{name}/here", [when], rr.Points3D.columns(positions=line))
            if name != "true":
                off = np.linalg.norm(level - flown.place_m[:, :2], axis=1)
                recording.log(f"/off/{name}", rr.SeriesLines(colors=color, names=f"{name} (m)"), static=True)
                recording.send_columns(f"/off/{name}", [when], rr.Scalars.columns(scalars=off))


def _blueprint(length_s: float) -> rrb.Blueprint:
    ends = (rrb.TimeRangeBoundary.cursor_relative(seconds=span) for span in (-length_s, length_s))
    axis = rrb.TimeAxis(view_range=rrb.TimeRange(*ends))
    views = rrb.Vertical(
        rrb.Spatial3DView(origin="/flight", name="Figure 1: true (grey), through the air (orange), closed (red)"),
        rrb.TimeSeriesView(origin="/off", name="distance to the truth, m", axis_x=axis),
        row_shares=[3, 1],
    )
    return rrb.Blueprint(views, rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)
