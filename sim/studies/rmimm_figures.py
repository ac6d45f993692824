"""Paper 000's filters drawn into an .rrd: errors over time, modes' probabilities, how late each change is found, a flight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from sim.studies.figures import line, path_of, plot
from sim.studies.rmimm import END_S, LEGS, VARIANTS, Flight, Tracks, delays_s, filtered, flight

Floats = NDArray[np.float64]

TRUE, MEASURED = [150, 150, 150], [255, 140, 0]
COLORS = ([60, 120, 255], [255, 140, 0], [230, 30, 40], [120, 170, 220], [160, 60, 160])
MODES = (("straight", [150, 150, 150]), ("left", [60, 120, 255]), ("right", [40, 170, 90]))
LATEST_S = 20  # of a histogram of delays
ENOUGH_RUNS = 100  # for lines that are means


def draw(path: Path, runs: int, seed: int) -> None:
    """Write the figures of the case with positions alone."""
    flown = flight(min(runs, ENOUGH_RUNS), seed)
    with rr.RecordingStream("talkdown_study", recording_id=f"rmimm-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("000: interacting multiple models")
        _draw_measured(recording, flown)
        for (name, rule, known), color in zip(VARIANTS, COLORS, strict=True):
            tracks = filtered(flown, rule, known_point=known)
            _draw_errors(recording, name, color, flown, tracks)
            _draw_modes(recording, name, tracks)
            _draw_delays(recording, name, color, tracks)
            _flight(recording, name, color, tracks.mean[:, 0, :2])


def _blueprint() -> rrb.Blueprint:
    errors = [
        plot("/errors/position", "position, RMS m", END_S),
        plot("/errors/velocity", "velocity, RMS m/s", END_S),
    ]
    errors.append(plot("/errors/nees", "NEES, mean; 4 = honest", END_S))
    modes = [plot(f"/modes/{path_of(name)}", f"{name}: probabilities, mean", END_S) for name, _, _ in VARIANTS[:3]]
    delays = [
        rrb.Vertical(
            *(rrb.BarChartView(origin=f"/delays/{since}/{path_of(name)}", name=name) for name, _, _ in VARIANTS),
            name=f"change at {since} s",
        )
        for since, _ in LEGS[1:]
    ]
    tabs = rrb.Tabs(
        rrb.Vertical(*errors, name="Errors"),
        rrb.Vertical(*modes, name="Modes"),
        rrb.Horizontal(*delays, name="Delays (updates)"),
        rrb.Spatial2DView(origin="/flight", name="One flight"),
    )
    return rrb.Blueprint(tabs, rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _line(recording: rr.RecordingStream, path: str, values: Floats, color: list[int], name: str) -> None:
    """Values at t = 1, 2, ... s."""
    line(recording, path, np.arange(1.0, len(values) + 1.0), values, color, name)


def _draw_errors(recording: rr.RecordingStream, name: str, color: list[int], flown: Flight, tracks: Tracks) -> None:
    for what, place, true in (("position", slice(0, 2), flown.position), ("velocity", slice(3, 5), flown.velocity)):
        off = tracks.mean[:, :, place] - true[:, None]
        rms = np.sqrt((off**2).sum(axis=2).mean(axis=1))
        _line(recording, f"/errors/{what}/{path_of(name)}", rms, color, name)
    _line(recording, f"/errors/nees/{path_of(name)}", tracks.nees.mean(axis=1), color, name)


def _draw_modes(recording: rr.RecordingStream, name: str, tracks: Tracks) -> None:
    for place, (mode, color) in enumerate(MODES):
        _line(recording, f"/modes/{path_of(name)}/{mode}", tracks.probability[:, :, place].mean(axis=1), color, mode)


def _draw_delays(recording: rr.RecordingStream, name: str, color: list[int], tracks: Tracks) -> None:
    """By change, in how many runs the mode was found after 0, 1, 2 ... updates."""
    for since, mode in LEGS[1:]:
        late = np.minimum(delays_s(tracks, since, mode), LATEST_S).astype(np.int64)
        counts = np.bincount(late, minlength=LATEST_S + 1)
        recording.log(f"/delays/{since}/{path_of(name)}", rr.BarChart(counts, color=color), static=True)


def _draw_measured(recording: rr.RecordingStream, flown: Flight) -> None:
    _flight(recording, "true", TRUE, flown.position)
    seen = flown.measured[:, 0, :2] * [1.0, -1.0]
    recording.log("/flight/measured", rr.Points2D(seen, colors=[MEASURED], radii=-1.0), static=True)


def _flight(recording: rr.RecordingStream, name: str, color: list[int], position: Floats) -> None:
    """North is up, so the second axis is turned: a picture's points downwards. A negative radius is on the screen."""
    strip = rr.LineStrips2D([position * [1.0, -1.0]], colors=[color], radii=-0.75)
    recording.log(f"/flight/{path_of(name)}", strip, static=True)
