"""003's approach filtered and smoothed, drawn into an .rrd: RMS errors over the flight, and one flight's errors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from sim.cases import Case
from sim.studies.figures import line, plot
from sim.studies.fusion import COUNTED_FROM_S

if TYPE_CHECKING:
    from sim.studies.smoothing import Pair

Floats = NDArray[np.float64]

COLOURS = {"kalman": [60, 120, 255], "imm": [255, 140, 0], "rmimm": [230, 30, 40]}
PALER = 0.45  # the filtered lines, beside the smoothed ones
SPAN_S = 460.0


def draw(path: Path, case: Case, pairs: Mapping[str, Pair], seed: int) -> None:
    """Write the figures; `pairs` by estimator."""
    with rr.RecordingStream("talkdown_study", recording_id=f"smoothing-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("003: filtered and smoothed")
        counted = case.plot_s >= COUNTED_FROM_S
        for name, pair in pairs.items():
            for state, place in (("filtered", pair.filtered_m), ("smoothed", pair.smoothed_m)):
                off = (place - case.true_enu_m)[:, counted]
                rms = np.sqrt((off**2).sum(axis=2).mean(axis=0))
                title = f"{name}, {state}"
                _line(recording, f"/rms/{name}/{state}", case.plot_s[counted], rms, title)
                one = np.sqrt((off[0] ** 2).sum(axis=1))
                _line(recording, f"/one/{name}/{state}", case.plot_s[counted], one, title)
        for name, pair in pairs.items():
            for state, nees in (("filtered", pair.filtered_nees), ("smoothed", pair.smoothed_nees)):
                known = counted & (~np.isnan(nees)).any(axis=0)
                mean = np.nanmean(nees[:, known], axis=0)
                _line(recording, f"/nees/{name}/{state}", case.plot_s[known], mean, f"{name}, {state}")


def _blueprint() -> rrb.Blueprint:
    views = (
        ("/rms", "error, RMS over the runs, m"),
        ("/one", "error of the first run, m"),
        ("/nees", "NEES; 3 = honest"),
    )
    return rrb.Blueprint(
        rrb.Vertical(*(plot(origin, name, SPAN_S) for origin, name in views)),
        rrb.TimePanel(timeline="time", state="collapsed"),
        collapse_panels=True,
    )


def _line(recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, name: str) -> None:
    """Values at times; the filtered lines are paler."""
    colour = np.array(COLOURS[name.partition(",")[0]])
    shown = colour if name.endswith("smoothed") else PALER * colour
    line(recording, path, time_s, values, shown.astype(int).tolist(), name)
