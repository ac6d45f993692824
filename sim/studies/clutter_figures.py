"""Paper 002-6's figures 3 and 4 and GOSPA drawn into an .rrd, and one run: truth, plots' tracks and what each tracker tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from sim.studies.figures import path_of

if TYPE_CHECKING:
    from sim.studies.clutter import Followed

Floats = NDArray[np.float64]

TRUE = [150, 150, 150]
COLORS = ([230, 30, 40], [255, 140, 0], [60, 120, 255])


def draw(path: Path, found: Mapping[str, Sequence[Followed]], true_m: Floats) -> None:
    """Write the figures of all runs by tracker; true_m (targets, 2, scans)."""
    with rr.RecordingStream("talkdown_study", recording_id="clutter") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("002-6: many targets in clutter")
        _flight(recording, "true", TRUE, [one.T for one in true_m])
        for (name, runs), color in zip(found.items(), COLORS, strict=True):
            held = np.mean([[seen.tracks for seen in one.seen] for one in runs], axis=0)
            _line(recording, f"/gospa/{path_of(name)}", np.mean([one.gospa_m for one in runs], axis=0), color, name)
            _line(recording, f"/tracks/{path_of(name)}", held, color, name)
            _line(recording, f"/false/{path_of(name)}", np.mean([one.false for one in runs], axis=0), color, name)
            _likelihoods(recording, name, runs[0])
            told: dict[int, list[Floats]] = {}
            for seen in runs[0].seen:
                for number, position in zip(seen.number.tolist(), seen.position.T, strict=True):
                    told.setdefault(number, []).append(position)
            _flight(recording, name, color, [np.array(points) for points in told.values()])


def _blueprint() -> rrb.Blueprint:
    lines = (
        ("/tracks", "tracks held (figure 3)"),
        ("/likelihood", "likelihood of what is told, one run (figure 4)"),
        ("/gospa", "GOSPA, mean m"),
        ("/false", "false tracks, mean"),
    )
    plots = rrb.Grid(*(rrb.TimeSeriesView(origin=origin, name=name) for origin, name in lines), name="Figures")
    tabs = rrb.Tabs(plots, rrb.Spatial2DView(origin="/flight", name="One run"))
    return rrb.Blueprint(tabs, rrb.TimePanel(timeline="scan", state="collapsed"), collapse_panels=True)


def _line(recording: rr.RecordingStream, path: str, values: Floats, color: list[int], name: str) -> None:
    recording.log(path, rr.SeriesLines(colors=[color], names=[name]), static=True)
    scans = rr.TimeColumn("scan", sequence=np.arange(len(values)))
    recording.send_columns(path, [scans], rr.Scalars.columns(scalars=values))


def _likelihoods(recording: rr.RecordingStream, name: str, one: Followed) -> None:
    """Of each track that is told, by its number; scans in which it is not told are left out."""
    by_number: dict[int, list[tuple[int, float]]] = {}
    for scan, seen in enumerate(one.seen):
        for number, likelihood in zip(seen.number.tolist(), seen.likelihood.tolist(), strict=True):
            by_number.setdefault(number, []).append((scan, likelihood))
    for number, points in by_number.items():
        path = f"/likelihood/{path_of(name)}/{number}"
        recording.log(path, rr.SeriesLines(names=[f"{name}, {number}"]), static=True)
        scans = rr.TimeColumn("scan", sequence=[scan for scan, _ in points])
        recording.send_columns(path, [scans], rr.Scalars.columns(scalars=[value for _, value in points]))


def _flight(recording: rr.RecordingStream, name: str, color: list[int], lines: Sequence[Floats]) -> None:
    """North is up, so the second axis is turned: a picture's points downwards. A negative radius is on the screen."""
    strips = rr.LineStrips2D([line * [1.0, -1.0] for line in lines if len(line) > 1], colors=[color], radii=-0.75)
    recording.log(f"/flight/{path_of(name)}", strips, static=True)
