"""Paper 000's figures 4 to 10 drawn into an .rrd: the flight and what was foretold of it, errors by axis, modes' probabilities.

Figures 5 and 6 are the improved method's, 7 and 8 those of the filter alone, 9 and 10 the modes as either sees them.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from sim.studies.figures import line, path_of, plot
from sim.studies.intents import FIRST_S, Followed, Method, Points, predicted
from sim.studies.rmimm import END_S, Flight

Floats = NDArray[np.float64]

AHEAD_S = 10  # of the predictions whose errors are drawn
IMPROVED: tuple[tuple[str, Method, list[int]], ...] = (
    ("literal", "inferred, literal", [255, 140, 0]),
    ("default", "inferred", [230, 30, 40]),
    ("known point", "known point", [60, 120, 255]),
)
ALONE: tuple[tuple[str, Method, list[int]], ...] = (("RMIMM", "likeliest mode", [190, 110, 230]),)
MODES = (("straight", [150, 150, 150]), ("left", [60, 120, 255]), ("right", [40, 170, 90]))
TRUE, MEASURED, POINT, DECOY = [150, 150, 150], [255, 190, 90], [40, 170, 90], [120, 120, 120]


def draw(path: Path, flown: Flight, points: Points, found: Mapping[str, Followed]) -> None:
    """Write the figures."""
    with rr.RecordingStream("talkdown_study", recording_id="prediction") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("000: intent and prediction")
        _draw_flight(recording, flown, points, found)
        for position, velocity, shown in (("figure-5", "figure-6", IMPROVED), ("figure-7", "figure-8", ALONE)):
            for name, method, color in shown:
                _draw_errors(recording, (position, velocity), (name, method, color), flown, points, found[name])
        for figure, name in (("figure-9", "RMIMM"), ("figure-10", "default"), ("figure-10-known-point", "known point")):
            for place, (mode, color) in enumerate(MODES):
                _line(
                    recording,
                    f"/{figure}/{mode}",
                    1,
                    found[name].tracks.probability[:, :, place].mean(axis=1),
                    color,
                    mode,
                )


def _blueprint() -> rrb.Blueprint:
    tabs = rrb.Tabs(
        rrb.Spatial2DView(origin="/figure-4", name="4: the flight, and where it was foretold 10 s before"),
        rrb.Vertical(
            plot("/figure-5", "5: position foretold 10 s before, with intent: RMS by axis, m", END_S),
            plot("/figure-7", "7: the same by the filter alone", END_S),
            name="5, 7: position",
        ),
        rrb.Vertical(
            plot("/figure-6", "6: velocity foretold 10 s before, with intent: RMS by axis, m/s", END_S),
            plot("/figure-8", "8: the same by the filter alone", END_S),
            name="6, 8: velocity",
        ),
        rrb.Vertical(
            plot("/figure-9", "9: modes' probabilities, the filter alone", END_S),
            plot("/figure-10", "10: with the inferred intent fed back", END_S),
            plot("/figure-10-known-point", "10: with the point known", END_S),
            name="9, 10: modes",
        ),
    )
    return rrb.Blueprint(tabs, rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _line(recording: rr.RecordingStream, path: str, first_s: int, values: Floats, color: list[int], name: str) -> None:
    """Values at first_s, first_s + 1, ... s."""
    line(recording, path, np.arange(float(first_s), first_s + len(values)), values, color, name)


def _draw_errors(
    recording: rr.RecordingStream,
    figures: tuple[str, str],
    shown: tuple[str, Method, list[int]],
    flown: Flight,
    points: Points,
    one: Followed,
) -> None:
    """RMS errors on x and y of what was foretold 10 s before, at each second."""
    name, method, color = shown
    off_m, off_mps = [], []
    for step in range(FIRST_S, END_S - AHEAD_S):
        ahead = predicted(one, points, step, np.array([float(AHEAD_S)]), method)
        velocity = one.tracks.mean[step, :, 3:5]
        speed = np.sqrt((velocity * velocity).sum(axis=1))[:, None]
        then = speed * np.stack([np.cos(ahead.course[:, 0]), np.sin(ahead.course[:, 0])], axis=1)
        off_m.append(((ahead.position[:, 0] - flown.position[step + AHEAD_S]) ** 2).mean(axis=0))
        off_mps.append(((then - flown.velocity[step + AHEAD_S]) ** 2).mean(axis=0))
    for figure, off in zip(figures, (off_m, off_mps), strict=True):
        for axis, rms in zip("xy", np.sqrt(np.array(off)).T, strict=True):
            shade = color if axis == "x" else [value * 2 // 3 for value in color]
            _line(recording, f"/{figure}/{path_of(name)}/{axis}", FIRST_S + AHEAD_S + 1, rms, shade, f"{name}, {axis}")


def _draw_flight(recording: rr.RecordingStream, flown: Flight, points: Points, found: Mapping[str, Followed]) -> None:
    """North is up, so the second axis is turned: a picture's points downwards. A negative radius is on the screen."""
    up = np.array([1.0, -1.0])
    recording.log("/figure-4/true", rr.LineStrips2D([flown.position * up], colors=[TRUE], radii=-0.75), static=True)
    measured = rr.Points2D(flown.measured[:, 0, :2] * up, colors=[MEASURED], radii=-1.0)
    recording.log("/figure-4/measured", measured, static=True)
    names = ["TCP-1", "TCP", "TCP+1"] + ["decoy"] * (len(points.place) - 3)
    colors = [POINT if name != "decoy" else DECOY for name in names]
    recording.log(
        "/figure-4/points", rr.Points2D(points.place * up, colors=colors, radii=-4.0, labels=names), static=True
    )
    for name, method, color in (*ALONE, *IMPROVED):
        ahead = [
            predicted(found[name], points, step, np.array([float(AHEAD_S)]), method).position[0, 0]
            for step in range(FIRST_S, END_S - AHEAD_S)
        ]
        dots = rr.Points2D(np.array(ahead) * up, colors=[color], radii=-1.25)
        recording.log(f"/figure-4/foretold/{path_of(name)}", dots, static=True)
    shown = [("flown", TRUE), ("measured", MEASURED), *((name, color) for name, _, color in (*ALONE, *IMPROVED))]
    least, span = points.place.min(axis=0), float(np.ptp(points.place[:, 1]))
    places = least + np.array([[-0.4, 0.1 * (len(shown) - place)] for place in range(len(shown))]) * span
    key = rr.Points2D(places * up, colors=[one for _, one in shown], radii=-4.0, labels=[one for one, _ in shown])
    recording.log("/figure-4/key", key, static=True)
