"""Whether the program says by itself that a noise is stated wrongly, after how long, and how near it comes to it when none is.

Sensors are simulated with one noise 1.5 times as large or as small as the settings state, and the gateway's own filter and
test (`gateway.fuse.consistency`) hear them second by second, as in a session: 003's approach, one aircraft and one radar,
and scene `traffic`, twelve aircraft, whose reports are judged together. A second table has velocities that are not those of
their positions: of another unit, sign or axis, or none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.frames import RadarFrame, RunwayFrame
from gateway.fuse.consistency import Consistency
from gateway.fuse.displacement import EVIDENCE
from gateway.fuse.events import Event, Job, Measure
from gateway.fuse.evidence import REPORT
from gateway.fuse.filtering import run as filtered
from gateway.fuse.weighting import Model
from gateway.settings import EstimatorName, Options, PositionSource, RadarSite
from sim.radars import RadarSight
from sim.scene import Aircraft, Scene, SceneRadar
from sim.scenes import build_scene
from sim.sensors import gps_phases, gps_times, measure_gps, measure_radar, scan_times, stream
from sim.studies import Progress, Study, Table, silent

Floats = NDArray[np.float64]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm", "alpha-beta-gamma")
WRONG = 1.5
RATES_HZ = (0.2, 1.0, 5.0)
ASSOCIATED_S = 10.0  # a radar's plots count from here on: the gateway has joined them to the aircraft by then
AT_ONCE = 24  # tracks that are filtered together
CROWD = 5  # a run of `traffic` is this many of the approach: it has twelve aircraft
# The simulator's name of each noise; a report's are measured at every rate, a plot's at the scene's own.
SIMULATED = {
    "position": "gps.sigma_m",
    "velocity": "gps.velocity_sigma_mps",
    "range": "radar.range_sigma_m",
    "azimuth": "radar.azimuth_sigma_rad",
    "elevation": "radar.elevation_sigma_rad",
}
# What velocities are multiplied by, by what is wrong with them.
VELOCITIES: dict[str, Floats] = {
    "always 0": np.zeros((3, 3)),
    "wrong sign": -np.eye(3),
    "cm/s": 100.0 * np.eye(3),
    "m/s as cm/s": 0.01 * np.eye(3),
    "km/h": 3.6 * np.eye(3),
    "knots": 1.9438 * np.eye(3),
    "m/s as knots": 0.5144 * np.eye(3),
    "feet a second": 3.2808 * np.eye(3),
    "north, east, down": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]),
    "down for up": np.diag([1.0, 1.0, -1.0]),
}
SLOWEST_HZ = 0.1
MISMATCHES = ("velocity and positions", "climb rate and positions")
OF_REPORTS = tuple(part.name for part in REPORT)


@dataclass(frozen=True, slots=True)
class Heard:
    """What came of one session: when each part was found wrong, s after its start, and how near sums came to saying so."""

    found_s: dict[str, float]  # also of `MISMATCHES`
    nearest: float  # the greatest level over the level at which something is said


def run(runs: int = 20, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """In what share of the sessions each wrong noise is said, after how long (median), and what else is said."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    cases = [(name, part, rate, wrong) for name in ("approach", "traffic") for part, rate, wrong in _settings(name)]
    for place, (name, part, rate_hz, wrong) in enumerate(cases):
        progress(f"{name}, {part}", place / len(cases))
        count = max(runs // CROWD, 1) if name == "traffic" else runs
        cells, others, nearest = [], 0, 0.0
        for estimator in ESTIMATORS:
            heard = list(sessions(name, part, rate_hz, wrong, estimator, count, seed))
            times = [one.found_s[part] for one in heard if part in one.found_s]
            others += sum(len(set(one.found_s) - {part}) for one in heard)
            nearest = max(nearest, *(one.nearest for one in heard))
            cells += [100.0 * len(times) / count, float(np.median(times)) if times else math.nan]
            key = f"{name}, {part} x{wrong:.2f} at {rate_hz:g} Hz, {estimator}"
            figures |= {f"said {key}": cells[-2], f"after {key}": cells[-1]}
        figures[f"others {name}, {part} x{wrong:.2f} at {rate_hz:g} Hz"] = others
        what = (name, part or "all as stated", rate_hz, wrong)
        rows.append((*what, *(cells if part else [math.nan] * len(cells)), others, math.nan if part else nearest))
    each = tuple(text for name in ESTIMATORS for text in (f"{name}: said %", "after s"))
    columns = ("case", "noise", "reports, Hz", "times stated", *each, "else said", "nearest")
    table = Table(f"a noise that is not as stated, {runs} runs", columns, tuple(rows), NOTES)
    wrong_velocities, more = _wrong_velocities(max(runs // CROWD, 1), seed)
    return Study("noise", runs, seed, (table, wrong_velocities), figures | more)


def _wrong_velocities(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """In what share of the sessions it is said that velocities are not those of the positions, and after how long."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for wrong, rate_hz in itertools.product(VELOCITIES, (SLOWEST_HZ, *RATES_HZ)):
        heard = list(sessions("approach", wrong, rate_hz, 1.0, ESTIMATORS[0], runs, seed))
        cells: list[float] = []
        for what in MISMATCHES:
            times = [one.found_s[what] for one in heard if what in one.found_s]
            cells += [100.0 * len(times) / runs, float(np.median(times)) if times else math.nan]
        others = sum(len(set(one.found_s) - set(MISMATCHES)) for one in heard)
        figures |= {f"said {wrong} at {rate_hz:g} Hz": max(cells[0], cells[2])}
        rows.append((wrong, rate_hz, *cells, others))
    columns = ("velocities are", "reports, Hz", "said %", "after s", "climb: said %", "after s", "else said")
    return Table(f"velocities that are not those of their positions, {runs} runs", columns, tuple(rows)), figures


NOTES = (
    f"scene traffic: a run for {CROWD} of the approach; its twelve aircraft are judged together",
    "after: median of those in which it is said; else said: of other noises, in all runs",
    "nearest: the greatest evidence of any noise that is as stated, by what is needed to say something",
)


def _settings(name: str) -> Iterator[tuple[str, float, float]]:
    """What is wrong, at how many reports a second, and how many times what is stated; nothing wrong first."""
    usual = 0.2 if name == "approach" else 1.0
    for rate_hz in RATES_HZ:
        yield "", rate_hz, 1.0
    for part in SIMULATED:
        for rate_hz in RATES_HZ if part in OF_REPORTS else (usual,):
            for wrong in (WRONG, 1.0 / WRONG):
                yield part, rate_hz, wrong


def sessions(
    name: str, part: str, rate_hz: float, wrong: float, estimator: EstimatorName, runs: int, seed: int
) -> Iterator[Heard]:
    """Sessions of a scene in which the noise of a part ("" = none) is so many times what is stated, or velocities are wrong."""
    stated = build_scene(name, start_ns=0, seed=seed, changes=[f"gps.period_s={1.0 / rate_hz}"])
    simulated = _changed(stated, part, wrong) if part in SIMULATED else stated
    turned = VELOCITIES.get(part)
    frame = RunwayFrame(stated.site.runway)
    radars = {one.site.number: _as_simulated(one) for one in stated.radars}
    gps = stated.gps
    allowed_m = math.sqrt(3.0) * max(gps.error_sigma_m, abs(gps.error_east_m), abs(gps.error_north_m))
    position = PositionSource(gps.sigma_m, allowed_m, gps.velocity_sigma_mps)
    frames = {number: RadarFrame.of(radar, frame) for number, radar in radars.items()}
    model = Model.of(Options(estimator=estimator), position, frames)
    together = max(AT_ONCE // len(simulated.aircraft), 1)  # the filter is fast over many tracks
    for first in range(seed * 1000, seed * 1000 + runs, together):
        drawn = range(first, min(first + together, seed * 1000 + runs))
        tracks = [
            [
                one
                for aircraft in simulated.aircraft
                if (one := _turned(_measured(simulated, aircraft, position, radars, frame, draw), turned))
            ]
            for draw in drawn
        ]
        events = iter(filtered([Job(0, None, one, lambda fix: None) for each in tracks for one in each], model))
        for each in tracks:
            yield listened(list(itertools.islice(events, len(each))), position, radars)


def _changed(scene: Scene, part: str, times: float) -> Scene:
    """A scene with the noise of one part so many times as large."""
    group, field = SIMULATED[part].split(".")
    if group == "gps":
        return replace(scene, gps=replace(scene.gps, **{field: times * getattr(scene.gps, field)}))
    changed = [replace(one.parameters, **{field: times * getattr(one.parameters, field)}) for one in scene.radars]
    radars = tuple(replace(one, parameters=new) for one, new in zip(scene.radars, changed, strict=True))
    return replace(scene, radars=radars)


def _turned(measures: list[Measure], by: Floats | None) -> list[Measure]:
    """The same with reports' velocities multiplied by a matrix, where there is one."""
    if by is None:
        return measures
    return [replace(one, velocity_mps=by @ one.velocity_mps) if isinstance(one, Fix) else one for one in measures]


def _as_simulated(radar: SceneRadar) -> RadarSite:
    """A radar whose site file states what it is simulated with."""
    noise = radar.parameters
    return replace(
        radar.site,
        range_sigma_m=noise.range_sigma_m,
        azimuth_sigma_rad=noise.azimuth_sigma_rad,
        elevation_sigma_rad=noise.elevation_sigma_rad,
    )


def _measured(
    scene: Scene,
    aircraft: Aircraft,
    position: PositionSource,
    radars: dict[int, RadarSite],
    frame: RunwayFrame,
    seed: int,
) -> list[Measure]:
    """What is heard of one aircraft, in order of time, with the noise that is stated of it."""
    start_s, end_s = scene.present(aircraft)
    draws = stream(seed, "noise", aircraft.system)
    valid_s = gps_times(scene.gps, start_s, end_s, gps_phases(scene.gps, draws))
    if not len(valid_s):
        return []
    flown = scene.flown(aircraft, valid_s)
    said = measure_gps(scene.gps, valid_s, flown, draws)
    enu_m = frame.enu_from_geodetic(said.latitude_rad, said.longitude_rad, said.height_m)
    axes = frame.local_from_enu(flown.latitude_rad, flown.longitude_rad)
    velocity_mps = np.einsum("nji,nj->ni", axes, said.velocity_mps)
    sigma_m, speed_sigma_mps = np.full(3, position.sigma_m), position.velocity_sigma_mps
    found: list[Measure] = []
    for i, at_s in enumerate(valid_s.tolist()):
        at = round(at_s * SECOND)
        found.append(Fix(at, 0, at, aircraft.name, enu_m[i], sigma_m, velocity_mps[i], speed_sigma_mps, True))
    for radar in scene.radars:
        known = radars[radar.site.number]
        scans_s = scan_times(radar.parameters, 0.0, scene.duration_s)
        scans_s = scans_s[(scans_s >= valid_s[0] + ASSOCIATED_S) & (scans_s < end_s)]
        seen, speed = RadarSight(scene.site, radar.site).see(scene.flown(aircraft, scans_s))
        plots = measure_radar(radar.parameters, scans_s, seen, speed, stream(seed, radar.name, aircraft.system))
        sigma = (known.range_sigma_m, known.azimuth_sigma_rad, known.elevation_sigma_rad)
        for i in np.flatnonzero(plots.seen).tolist():
            at, (distance, azimuth, elevation) = round(float(scans_s[i]) * SECOND), plots.polar[i].tolist()
            found.append(Plot(at, 0, at, known.number, aircraft.system, (distance, azimuth, elevation), sigma))
    return sorted(found, key=lambda one: one.at)


def listened(tracks: Sequence[list[Event]], position: PositionSource, radars: dict[int, RadarSite]) -> Heard:
    """What comes of the events of some tracks, heard second by second."""
    told = sorted(((place, event) for place, one in enumerate(tracks) for event in one), key=lambda one: one[1].at)
    known, found, nearest = Consistency(), dict[str, float](), 0.0
    by_second = {second: list(some) for second, some in itertools.groupby(told, key=lambda one: one[1].at // SECOND)}
    for second in range(min(by_second, default=0), max(by_second, default=-1) + 1):
        known, findings = (
            known.hearing(by_second.get(second, ()))
            .planning((second + 1) * SECOND)
            .judged(position, radars, (second + 2) * SECOND)
        )
        for one in findings:
            part = one.topic.removeprefix("scatter of ").split(",")[0]
            found.setdefault(part, second + 1.0 - told[0][1].at / SECOND)
        against = known.displacements.sums[:, :, EVIDENCE].max(initial=0.0)
        nearest = max(nearest, max(float(known.levels.max(initial=0.0)), float(against)) / known.sure)
    return Heard(found, nearest)
