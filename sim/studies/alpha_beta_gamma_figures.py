"""Paper 002-1's figures 3, 4 and 5, and a manoeuvre with a fixed and an adapted gain, drawn into an .rrd.

Figure 3 a to d: track, velocity, acceleration and squared error without noise. Figure 4: the same with q too small. Figure 5:
measured, filtered and true track of a sine, with gains and p. The manoeuvre: errors, gains, p.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.estimators.alpha_beta_gamma import Tuning
from gateway.estimators.steady_gains import gains
from sim.studies.alpha_beta_gamma import ENOUGH, TOO_SMALL, Run, manoeuvre, noise_free, sine

Floats = NDArray[np.float64]

TRUE, MEASURED, FILTERED, OTHER = [150, 150, 150], [255, 140, 0], [230, 30, 40], [60, 120, 255]
GREEN = [40, 170, 90]
# origin, what its plots show and their heading
MOTION = (
    ("track", "a  track (m)"),
    ("velocity", "b  velocity (m/s)"),
    ("acceleration", "c  acceleration (m/s2)"),
    ("error", "d  squared error (m2)"),
)
NOISY = (
    ("track", "track (m)"),
    ("error", "error of the position (m)"),
    ("gains", "alpha, beta, gamma"),
    ("p", "p"),
)
FIGURES = (
    ("figure_3", "Figure 3: gamma 0.5", MOTION, 200.0),
    ("figure_4", "Figure 4: q too small", MOTION, 200.0),
    ("figure_5", "Figure 5: sine", NOISY, 400.0),
    ("manoeuvre", "Manoeuvre", NOISY, 180.0),
)


def draw(path: Path, seed: int) -> None:
    """Write the figures of one run."""
    with rr.RecordingStream("talkdown_study", recording_id=f"alpha-beta-gamma-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("002-1: the adaptive alpha-beta-gamma filter")
        for name, gamma in (("figure_3", ENOUGH), ("figure_4", TOO_SMALL)):
            _draw_motion(recording, name, noise_free(gamma))
        _draw_noisy(recording, "figure_5", {"adaptive": sine(Tuning(), 1, seed)})
        fixed = Tuning(q=TOO_SMALL, least_p=1.0, greatest_p=1.0, follows_covariance=False)
        adaptive = Tuning(q=TOO_SMALL, follows_covariance=False)
        runs = {"q 0.001, adaptive": manoeuvre(adaptive, 1, seed), "q 0.001, fixed": manoeuvre(fixed, 1, seed)}
        _draw_noisy(recording, "manoeuvre", runs | {"default": manoeuvre(Tuning(), 1, seed)})


def _blueprint() -> rrb.Blueprint:
    tabs = []
    for figure, title, plots, span_s in FIGURES:
        views = [_plot(f"/{figure}/{name}", heading, span_s) for name, heading in plots]
        tabs.append(rrb.Vertical(*views, name=title))
    return rrb.Blueprint(rrb.Tabs(*tabs), rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _plot(origin: str, name: str, span_s: float) -> rrb.TimeSeriesView:
    ends = (rrb.TimeRangeBoundary.cursor_relative(seconds=span) for span in (-span_s, span_s))
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=rrb.TimeAxis(view_range=rrb.TimeRange(*ends)))


def _line(
    recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, color: list[int], name: str
) -> None:
    recording.log(path, rr.SeriesLines(colors=[color], names=[name]), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def _dots(
    recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, color: list[int], name: str
) -> None:
    recording.log(path, rr.SeriesPoints(colors=[color], names=[name], marker_sizes=[2.5]), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def _draw_motion(recording: rr.RecordingStream, figure: str, run: Run) -> None:
    """Figures 3 and 4: estimate on truth, and the squared error."""
    for place, (name, _) in enumerate(MOTION[:3]):
        _line(recording, f"/{figure}/{name}/true", run.time_s, run.truth[:, place], TRUE, "true")
        _line(recording, f"/{figure}/{name}/filtered", run.time_s, run.estimate[:, 0, place], FILTERED, "filtered")
    _line(recording, f"/{figure}/error/squared", run.time_s, np.square(run.error_m[:, 0]), FILTERED, "squared error")


def _draw_noisy(recording: rr.RecordingStream, figure: str, runs: dict[str, Run]) -> None:
    """Figure 5 and the manoeuvre: tracks, errors, gains of the first run, p of all."""
    first = next(iter(runs.values()))
    time_s = first.time_s
    _dots(recording, f"/{figure}/track/measured", time_s, first.measured_m[:, 0], MEASURED, "measured")
    _line(recording, f"/{figure}/track/true", time_s, first.truth[:, 0], TRUE, "true")
    noise = first.measured_m[:, 0] - first.truth[:, 0]
    _dots(recording, f"/{figure}/error/measured", time_s, noise, MEASURED, "measured")
    for (name, run), color in zip(runs.items(), (FILTERED, OTHER, GREEN), strict=False):
        key = name.replace(" ", "_").replace(",", "").replace(".", "_")
        _line(recording, f"/{figure}/track/{key}", time_s, run.estimate[:, 0, 0], color, name)
        _line(recording, f"/{figure}/error/{key}", time_s, run.error_m[:, 0], color, name)
        _line(recording, f"/{figure}/p/{key}", time_s, run.p[:, 0], color, name)
    used = gains(first.gamma[:, 0], np.ones(len(time_s)))
    for name, values, color in zip(
        ("alpha", "beta", "gamma"), (*used[:2], 2.0 * used[2]), (FILTERED, OTHER, GREEN), strict=True
    ):
        _line(recording, f"/{figure}/gains/{name}", time_s, values, color, name)
