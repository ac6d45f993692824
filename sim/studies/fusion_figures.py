"""Paper 003's figures 4 to 6, drawn into an .rrd: association while two tracks approach, the filter after it, the approach.

Figure 4: the position source starts 500 m off and closes in within a minute, part of the plots lack range: gates,
differences, hits, and the counter. Figure 5: deviations from the truth of GPS, radar and fused track. Figure 6: the three
tracks over the airfield, orange, blue and red, and the point at which they become one.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway import associate
from gateway.align import SECOND
from gateway.frames import RadarFrame, RunwayFrame, turn, xyz_from_polar
from gateway.fuse.filtering import Event, Job, Measure, rank
from gateway.fuse.filtering import run as run_filter
from gateway.fuse.weighting import Model
from gateway.settings import Options
from sim.cases import Case, case_003
from sim.sensors import RadarParameters
from sim.studies import fusion
from sim.studies.figures import plot

Floats = NDArray[np.float64]

ORANGE, BLUE, RED, GREY = [255, 140, 0], [60, 120, 255], [230, 30, 40], [150, 150, 150]
CLOSING_S, START_OFF_M = 60.0, 500.0  # figure 4: how fast the position source closes in, and from where
FOUR_S, FIVE_S = 1.5 * CLOSING_S, 460.0  # the figures' spans; the viewer can hold a range only about its cursor
COMPONENTS = (("range", "m", 1.0), ("azimuth", "deg", 180.0 / math.pi), ("elevation", "deg", 180.0 / math.pi))


def draw(path: Path, seed: int) -> None:
    """Write figures 4 to 6 of one run."""
    with rr.RecordingStream("talkdown_study", recording_id=f"fusion-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("003: fusion of landing radar and GPS")
        _draw_association(recording, seed)
        case = case_003(1, seed)
        since, events = _fused(case)
        _draw_deviations(recording, case, events)
        _draw_approach(recording, case, since, events)


def _blueprint() -> rrb.Blueprint:
    four = [plot(f"/figure_4/{name}", f"radar less GPS, {name} ({unit})", FOUR_S) for name, unit, _ in COMPONENTS]
    counter = plot("/figure_4/counter", "counter, associated at 3", FOUR_S)
    axes = ("along", "left", "up")
    five = [plot(f"/figure_5/{axis}", f"deviation from the truth, {axis} (m)", FIVE_S) for axis in axes]
    tabs = rrb.Tabs(
        rrb.Vertical(*four, counter, name="Figure 4: association"),
        rrb.Vertical(*five, name="Figure 5: after association"),
        rrb.Spatial3DView(origin="/figure_6", name="Figure 6: the approach"),
    )
    return rrb.Blueprint(tabs, rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _series(
    recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, color: list[int], name: str
) -> None:
    recording.log(path, rr.SeriesLines(colors=[color], names=[name]), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def _points(
    recording: rr.RecordingStream, path: str, time_s: Floats, values: Floats, color: list[int], name: str
) -> None:
    recording.log(path, rr.SeriesPoints(colors=[color], names=[name], marker_sizes=[4.0]), static=True)
    recording.send_columns(path, [rr.TimeColumn("time", duration=time_s)], rr.Scalars.columns(scalars=values))


def _draw_association(recording: rr.RecordingStream, seed: int) -> None:
    """Figure 4."""
    case = case_003(1, seed, radar=replace(RadarParameters(), missing_range=0.3))
    heard = fusion.measures_of(case, 0)
    setting = fusion.setting_of(case, Options())
    closing = [max(1.0 - (fix.at - fusion.START) / SECOND / CLOSING_S, 0.0) * START_OFF_M for fix in heard.fixes]
    off = [np.array([0.0, metres, 0.0]) for metres in closing]
    fixes = [replace(fix, enu_m=fix.enu_m + away) for fix, away in zip(heard.fixes, off, strict=True)]
    state, time_s, shown = associate.Association(), [], []
    for state, fix in fusion.checks(replace(heard, fixes=tuple(fixes)), setting, 1.5 * CLOSING_S):
        check = next(check for check in state.checks if check.fix is fix)
        found = next((c for c in check.comparisons if c.key == fusion.TARGET), None)
        if found is not None:
            time_s.append((fix.at - fusion.START) / SECOND)
            count = check.after.counts.get(fusion.AIRCRAFT, {}).get(fusion.TARGET)
            shown.append((found, 0 if count is None else count.value))
    times = np.array(time_s)
    hit = np.array([found.hit for found, _ in shown], dtype=np.bool_)
    for component, (name, _, scale) in enumerate(COMPONENTS):
        value = np.array([found.difference[component] for found, _ in shown]) * scale
        gate = np.array([found.gate[component] for found, _ in shown]) * scale
        there = ~np.isnan(value)
        origin = f"/figure_4/{name}"
        _series(recording, f"{origin}/gate_above", times[there], gate[there], GREY, "gate")
        _series(recording, f"{origin}/gate_below", times[there], -gate[there], GREY, "gate, below")
        _points(recording, f"{origin}/hit", times[there & hit], value[there & hit], RED, "hit")
        _points(recording, f"{origin}/miss", times[there & ~hit], value[there & ~hit], BLUE, "miss")
    _series(recording, "/figure_4/counter/value", times, np.array([float(c) for _, c in shown]), RED, "counter")
    _series(recording, "/figure_4/counter/full", times, np.full(len(times), 3.0), GREY, "associated at 3")


def _fused(case: Case) -> tuple[int, list[Event]]:
    """When one run's tracks became one, and the fused track's states."""
    heard, setting = fusion.measures_of(case, 0), fusion.setting_of(case, Options())
    found = fusion.association_times(heard, setting)
    since = found[1] if found is not None else 1 << 62
    model = Model.of(Options(), case.site.position, setting.radars)
    measures: list[Measure] = [*heard.fixes, *(plot for plot in heard.plots if plot.at >= since)]
    measures.sort(key=rank)
    return since, run_filter([Job(0, None, measures, lambda fix: None)], model)[0]


def _seen(case: Case) -> tuple[Floats, Floats, Floats, Floats]:
    """GPS times and positions, complete plots' times and positions, in the runway frame."""
    frame = RunwayFrame(case.site.runway)
    radar = RadarFrame.of(case.site.radars[0], frame)
    heard = fusion.measures_of(case, 0)
    gps_s = np.array([(fix.at - fusion.START) / SECOND for fix in heard.fixes])
    gps = turn(frame.runway_from_enu, np.array([fix.enu_m for fix in heard.fixes]))
    polar = np.array([plot.polar for plot in heard.plots])
    whole = ~np.isnan(polar).any(axis=1)
    plot_s = np.array([(plot.at - fusion.START) / SECOND for plot in heard.plots])[whole]
    return gps_s, gps, plot_s, turn(frame.runway_from_enu, radar.to_enu(xyz_from_polar(polar[whole])))


def _draw_deviations(recording: rr.RecordingStream, case: Case, events: list[Event]) -> None:
    """Figure 5."""
    frame = RunwayFrame(case.site.runway)
    truth = turn(frame.runway_from_enu, case.true_enu_m)
    gps_s, gps, plot_s, plots = _seen(case)
    fused = turn(frame.runway_from_enu, fusion.positions_at(events, case.plot_s))
    for axis, name in enumerate(("along", "left", "up")):
        for label, time_s, seen, color in (
            ("radar", plot_s, plots, BLUE),
            ("GPS", gps_s, gps, ORANGE),
            ("fused", case.plot_s, fused, RED),
        ):
            off = seen[:, axis] - np.interp(time_s, case.plot_s, truth[:, axis])
            there = ~np.isnan(off)
            draw_it = _series if label == "fused" else _points
            draw_it(recording, f"/figure_5/{name}/{label}", time_s[there], off[there], color, label)


def _draw_approach(recording: rr.RecordingStream, case: Case, since: int, events: list[Event]) -> None:
    """Figure 6."""
    frame, runway = RunwayFrame(case.site.runway), case.site.runway
    _, gps, _, plots = _seen(case)
    after = np.array([event.mean[:3] for event in events if event.at >= since])
    fused = turn(frame.runway_from_enu, after)
    half, wide = 0.5 * runway.length_m, 0.5 * runway.width_m
    edge = [[-half, -wide, 0], [half, -wide, 0], [half, wide, 0], [-half, wide, 0], [-half, -wide, 0]]
    recording.log("/figure_6", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log("/figure_6/runway", rr.LineStrips3D([edge], colors=[GREY], radii=rr.Radius.ui_points(2)), static=True)
    for name, line, color in (("GPS", gps, ORANGE), ("radar", plots, BLUE), ("fused", fused, RED)):
        width = rr.Radius.ui_points(2.5 if name == "fused" else 1.2)
        recording.log(f"/figure_6/{name}", rr.LineStrips3D([line], colors=[color], radii=width), static=True)
    here = fused[:1]
    recording.log(
        "/figure_6/associated",
        rr.Points3D(here, colors=[RED], radii=rr.Radius.ui_points(8), labels=["associated"]),
        static=True,
    )
