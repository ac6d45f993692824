"""Paper 004's figures drawn into an .rrd: the tracks before and after (figure 2), what is left by rounds (figure 3)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.estimators.registration import Errors
from gateway.estimators.registration_frames import SYSTEMS, System, difference
from sim.studies.registration import RADAR, RADAR_ERROR, SOURCE_ERROR, of_system, straight

Floats = NDArray[np.float64]

TRUE, SOURCE, RADAR_COLOR = [150, 150, 150], [255, 140, 0], [60, 120, 255]
COLORS = {"ecef": [60, 120, 255], "geodetic": [255, 140, 0], "polar": [40, 170, 90]}
ROUNDS = range(6)
ENLARGED = 10.0  # of the errors beside the track, which is 200 km long
LEAST_M = 1e-10  # of a logarithm


def draw(path: Path) -> None:
    """Write the figures; all of them are without noise."""
    with rr.RecordingStream("talkdown_study", recording_id="registration") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("004: registration")
        _tracks(recording, "before", None)
        for system in SYSTEMS:
            _tracks(recording, system, of_system(system, 1))
            _rounds(recording, system)


def _blueprint() -> rrb.Blueprint:
    names = {"before": "not registered"} | {system: f"registered, {system}, one round" for system in SYSTEMS}
    views = [rrb.Spatial2DView(origin=f"/tracks/{part}", name=name) for part, name in names.items()]
    rounds = [
        rrb.TimeSeriesView(origin=f"/rounds/{part}", name=f"{part}'s track: log10 of what is left, m")
        for part in ("source", "radar")
    ]
    tabs = rrb.Tabs(
        rrb.Grid(*views, name="Tracks (figure 2), errors ten times as large"),
        rrb.Vertical(*rounds, name="Rounds (figure 3)"),
    )
    return rrb.Blueprint(tabs, rrb.TimePanel(timeline="round", state="collapsed"), collapse_panels=True)


def _tracks(recording: rr.RecordingStream, part: str, errors: Errors | None) -> None:
    """The equatorial plane, as in print: from above the pole, kilometres from the middle of the true track."""
    case = straight(10)
    geodetic, polar = case.geodetic - SOURCE_ERROR, case.polar - RADAR_ERROR
    if errors is not None:
        geodetic, polar = geodetic + errors.source, polar + errors.radar[0]
    place = np.repeat(RADAR, len(polar), axis=0)
    true = difference("ecef", place, case.polar, case.geodetic)
    step = _equator_km(case.geodetic)
    off_source = difference("ecef", place, case.polar, geodetic).off - true.off
    off_radar = true.off - difference("ecef", place, polar, case.geodetic).off
    for name, off, color, labelled in (
        ("true", np.zeros_like(off_source), TRUE, 1),
        ("source", off_source, SOURCE, 4),
        ("radar", off_radar, RADAR_COLOR, 7),
    ):
        points = step + 1e-3 * ENLARGED * off[:, :2] * [1.0, -1.0]  # y points down in a 2D view
        radii = rr.Radius.ui_points(4.0 if name != "true" else 2.5)
        labels = [name if place == labelled else "" for place in range(len(points))]
        drawn = rr.Points2D(points, labels=labels, show_labels=True, colors=color, radii=radii)
        recording.log(f"/tracks/{part}/{name}", drawn, static=True)


def _equator_km(geodetic: Floats) -> Floats:
    radius_km = 6378.137 * np.cos(geodetic[:, 1])
    xy = np.stack([radius_km * np.cos(geodetic[:, 0]), -radius_km * np.sin(geodetic[:, 0])], axis=-1)
    return np.asarray(xy - xy.mean(axis=0))


def _rounds(recording: rr.RecordingStream, system: System) -> None:
    case = straight(10)
    for rounds in ROUNDS:
        left = case.remaining_m(of_system(system, rounds) if rounds else None)
        recording.set_time("round", sequence=rounds)
        for part, value in zip(("source", "radar"), left, strict=True):
            path = f"/rounds/{part}/{system}"
            if not rounds:
                recording.log(path, rr.SeriesLines(colors=COLORS[system], names=system), static=True)
                recording.log(path, rr.SeriesPoints(colors=COLORS[system], marker_sizes=4), static=True)
            recording.log(path, rr.Scalars(math.log10(max(float(value), LEAST_M))))
