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
from sim.studies.figures import line, plot

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
GAINS = (("gains", "alpha, beta, gamma"), ("p", "p"))
SINE = (
    ("measured", "a  measured and filtered (m)"),
    ("true", "b  true and filtered (m)"),
    ("error", "error (m)"),
    *GAINS,
)
HARD = (("error", "error (m)"), ("small", "error, the adaptive ones alone (m)"), *GAINS)
FIGURES = (
    ("figure_3", "Figure 3: gamma 0.5", MOTION, 200.0),
    ("figure_4", "Figure 4: q too small", MOTION, 200.0),
    ("figure_5", "Figure 5: sine", SINE, 400.0),
    ("manoeuvre", "Manoeuvre", HARD, 180.0),
)


def draw(path: Path, seed: int) -> None:
    """Write the figures of one run."""
    with rr.RecordingStream("talkdown_study", recording_id=f"alpha-beta-gamma-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("002-1: the adaptive alpha-beta-gamma filter")
        for name, gamma in (("figure_3", ENOUGH), ("figure_4", TOO_SMALL)):
            _draw_motion(recording, name, noise_free(gamma))
        _draw_sine(recording, sine(Tuning(), 1, seed))
        _draw_manoeuvre(recording, seed)


def _blueprint() -> rrb.Blueprint:
    tabs = []
    for figure, title, plots, span_s in FIGURES:
        views = [plot(f"/{figure}/{name}", heading, span_s) for name, heading in plots]
        tabs.append(rrb.Vertical(*views, name=title))
    return rrb.Blueprint(rrb.Tabs(*tabs), rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _dots(
    recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, color: list[int], name: str
) -> None:
    recording.log(path, rr.SeriesPoints(colors=[color], names=[name], marker_sizes=[2.0]), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def _draw_motion(recording: rr.RecordingStream, figure: str, run: Run) -> None:
    """Figures 3 and 4: estimate on truth, and the squared error."""
    for place, (name, _) in enumerate(MOTION[:3]):
        line(recording, f"/{figure}/{name}/filtered", run.time_s, run.estimate[:, 0, place], FILTERED, "filtered", 4.0)
        line(recording, f"/{figure}/{name}/true", run.time_s, run.truth[:, place], TRUE, "true")
    line(recording, f"/{figure}/error/squared", run.time_s, np.square(run.error_m[:, 0]), FILTERED, "squared error")


def _draw_sine(recording: rr.RecordingStream, run: Run) -> None:
    """Figure 5: the filtered track beside what was measured, and on the truth."""
    filtered = run.estimate[:, 0, 0]
    _dots(recording, "/figure_5/measured/measured", run.time_s, run.measured_m[:, 0], MEASURED, "measured")
    line(recording, "/figure_5/measured/filtered", run.time_s, filtered, FILTERED, "filtered")
    line(recording, "/figure_5/true/filtered", run.time_s, filtered, FILTERED, "filtered", 4.0)
    line(recording, "/figure_5/true/true", run.time_s, run.truth[:, 0], TRUE, "true")
    _dots(recording, "/figure_5/error/measured", run.time_s, _noise(run), MEASURED, "measured")
    line(recording, "/figure_5/error/filtered", run.time_s, run.error_m[:, 0], FILTERED, "filtered")
    line(recording, "/figure_5/p/p", run.time_s, run.p[:, 0], FILTERED, "p")
    _draw_gains(recording, "figure_5", run)


def _draw_manoeuvre(recording: rr.RecordingStream, seed: int) -> None:
    """Errors and p of a fixed gain, an adapted one and the defaults; the gains of the adapted one."""
    fixed = Tuning(q=TOO_SMALL, least_p=1.0, greatest_p=1.0, follows_covariance=False)
    adaptive = manoeuvre(Tuning(q=TOO_SMALL, follows_covariance=False), 1, seed)
    shown = (
        ("fixed", "q 0.001, fixed", manoeuvre(fixed, 1, seed), OTHER),
        ("adaptive", "q 0.001, adaptive", adaptive, FILTERED),
        ("default", "default", manoeuvre(Tuning(), 1, seed), GREEN),
    )
    _dots(recording, "/manoeuvre/small/measured", adaptive.time_s, _noise(adaptive), MEASURED, "measured")
    for key, name, run, color in shown:
        line(recording, f"/manoeuvre/error/{key}", run.time_s, run.error_m[:, 0], color, name)
        line(recording, f"/manoeuvre/p/{key}", run.time_s, run.p[:, 0], color, name)
        if key != "fixed":
            line(recording, f"/manoeuvre/small/{key}", run.time_s, run.error_m[:, 0], color, name)
    _draw_gains(recording, "manoeuvre", adaptive)


def _draw_gains(recording: rr.RecordingStream, figure: str, run: Run) -> None:
    alpha, beta, half_gamma = gains(run.gamma[:, 0], np.ones(len(run.time_s)))
    for name, values, color in (("alpha", alpha, FILTERED), ("beta", beta, OTHER), ("gamma", 2.0 * half_gamma, GREEN)):
        line(recording, f"/{figure}/gains/{name}", run.time_s, values, color, name)


def _noise(run: Run) -> Floats:
    """The measurements' errors (t,) of the first run."""
    return np.asarray(run.measured_m[:, 0] - run.truth[:, 0])
