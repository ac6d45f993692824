"""What the scripts beside this one share: 003's approach, measured with any model of motion and error."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway import associate
from gateway.estimators.kalman import Motion
from gateway.frames import RadarFrame, RunwayFrame
from gateway.fuse.filtering import Job, Measure, rank
from gateway.fuse.filtering import run as run_filter
from gateway.fuse.weighting import Model
from gateway.settings import Options
from sim.cases import Case, case_003
from sim.studies.fusion import COUNTED_FROM_S, association_times, measures_of, positions_at

Floats = NDArray[np.float64]

RUNS, SEED = 60, 1


def cases() -> dict[str, Case]:
    """The cases that a choice is judged by."""
    found = {"with error": case_003(RUNS, SEED), "without": case_003(RUNS, SEED, gps_error=False)}
    for name in ("azimuth", "elevation", "range"):
        found[f"no {name}"] = case_003(RUNS, SEED, missing=name)
    return found


def rmse_m(case: Case, motion: Motion | None = None, options: Options = Options()) -> float:
    """3-D RMSE over all runs of a case from t = 20 s, by the default weighting."""
    return math.sqrt(float((errors_m(case, motion, options) ** 2).sum(axis=-1).mean()))


def errors_m(case: Case, motion: Motion | None = None, options: Options = Options()) -> Floats:
    """Errors east, north, up (runs, times, 3) from t = 20 s, by the default weighting."""
    frame = RunwayFrame(case.site.runway)
    radars = {radar.number: RadarFrame.of(radar, frame) for radar in case.site.radars}
    model = Model.of(options, case.site.position, radars)
    if motion is not None:
        model = replace(model, motion=motion)
    setting = associate.Setting(case.site, options, frame, radars)
    jobs = []
    for index in range(case.runs):
        heard = measures_of(case, index)
        times = association_times(heard, setting, 60.0)
        since = times[1] if times is not None else 1 << 62
        wanted: list[Measure] = [*heard.fixes, *(plot for plot in heard.plots if plot.at >= since)]
        jobs.append(Job(index, None, sorted(wanted, key=rank), lambda fix: None))
    estimated = np.array([positions_at(events, case.plot_s) for events in run_filter(jobs, model)])
    return np.asarray((estimated - case.true_enu_m)[:, case.plot_s >= COUNTED_FROM_S])


def usual_motion() -> Motion:
    """The model of motion and error that the gateway uses by default at the demo's site."""
    case = case_003(1, SEED)
    return Model.of(Options(), case.site.position, {}).motion


def heading(first: str) -> str:
    """The first line of a table over all cases."""
    return f"{first:<28}" + "".join(
        f"{name:>14}" for name in ("with error", "without", "no azimuth", "no elevation", "no range")
    )


def line(name: str, values: list[float]) -> str:
    """One line of that table."""
    return f"{name:<28}" + "".join(f"{value:14.2f}" for value in values)
