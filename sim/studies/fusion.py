"""Paper 003's experiment: a landing radar and a late, biased GPS on one approach, by every weighting.

The gateway's own stages run over arrays of Monte Carlo runs: `associate` decides when radar track and aircraft become one,
`fuse`'s filter works each run's measurements in order of validity, all runs as one batch. Errors are taken at the radar's
times from t = 20 s, in three dimensions. Source: 003, 3.1 and 3.2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway import associate
from gateway.align import SECOND, Fix, Plot, bracket
from gateway.frames import RadarFrame, RunwayFrame
from gateway.fuse.filtering import Event, Job, Near, Neighbour, rank
from gateway.fuse.filtering import run as run_filter
from gateway.fuse.placing import begin
from gateway.fuse.weighting import Model
from gateway.settings import EstimatorName, Options, Weighting
from gateway.track import Key, Place, RadarTracks
from sim.cases import Case, case_003
from sim.sensors import PlotsMeasured
from sim.studies import Progress, Study, Table, silent

Floats = NDArray[np.float64]

START = 1_790_000_000 * SECOND  # of the simulated approach; any will do
AIRCRAFT, TARGET, BESIDE = "mavlink:1", (1, 3, 0), (1, 4, 0)
BANDS_M = ((50_000.0, 25_000.0), (25_000.0, 10_000.0), (10_000.0, 1_200.0))
COUNTED_FROM_S = 20.0
WEIGHTINGS: tuple[Weighting, ...] = ("bias", "covariance", "innovation", "literal")
LIGHT = "bias, alpha-beta-gamma"  # in place of the Kalman filter


@dataclass(frozen=True, slots=True)
class Accuracy:
    """3-D RMSE in metres over the whole approach and by distance: 50-25, 25-10, 10-1.2 km."""

    overall_m: float
    bands_m: tuple[float, float, float]
    error_found_m: float = math.nan  # RMS an axis of the position source's estimated error at the end


@dataclass(frozen=True, slots=True)
class Measures:
    """What one run of a case heard, as the gateway's stages take it."""

    fixes: tuple[Fix, ...]
    plots: tuple[Plot, ...]
    beside: tuple[Plot, ...] = ()


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """003's table (every weighting, with and without GPS error, each component missing) and the association's times.

    `rrd`: where figures 4, 5 and 6 are drawn, or None.
    """
    figures: dict[str, float] = {}
    rows: list[tuple[str | float, ...]] = []
    cases = {"with": case_003(runs, seed), "without": case_003(runs, seed, gps_error=False)}
    plan = [("radar alone", "with"), ("GPS alone", "with"), ("GPS alone", "without")]
    plan += [(weighting, error) for weighting in WEIGHTINGS for error in ("with", "without")]
    plan += [(LIGHT, error) for error in ("with", "without")]
    for place, (method, error) in enumerate(plan):
        progress(f"{method}, {error} GPS error", place / (len(plan) + 5))
        light = method == LIGHT
        accuracy = measure_accuracy(
            cases[error], "bias" if light else method, "alpha-beta-gamma" if light else "kalman"
        )
        rows.append((method, error, accuracy.overall_m, *accuracy.bands_m, accuracy.error_found_m))
        figures[f"{method} {error}"] = accuracy.overall_m
    for place, component in enumerate(("azimuth", "elevation", "range")):
        progress(f"{component} always missing", (len(plan) + place) / (len(plan) + 5))
        accuracy = measure_accuracy(case_003(runs, seed, missing=component), "bias")
        rows.append((f"bias, no {component}", "with", accuracy.overall_m, *accuracy.bands_m, accuracy.error_found_m))
        figures[f"no {component}"] = accuracy.overall_m
    progress("association", (len(plan) + 3) / (len(plan) + 5))
    association, found = _association_table(runs, seed)
    figures |= found
    if rrd is not None:
        from sim.studies.fusion_figures import draw

        progress("figures 4 to 6", (len(plan) + 4) / (len(plan) + 5))
        draw(rrd, seed)
    columns = ("method", "GPS error", "RMSE m", "50-25 km", "25-10 km", "10-1.2 km", "error found to m")
    table = Table(f"003: 3-D RMSE over {runs} approaches, from t = 20 s", columns, tuple(rows))
    return Study("fusion", runs, seed, (table, association), figures, str(rrd) if rrd else None)


def measures_of(case: Case, index: int) -> Measures:
    """One run's GPS reports (in order of validity) and plots as fixes and plots."""
    frame, gps = RunwayFrame(case.site.runway), case.gps
    enu = frame.enu_from_geodetic(gps.latitude_rad[index], gps.longitude_rad[index], gps.height_m[index])
    sigma, nowhere = np.full(3, case.site.position.sigma_m), np.full(3, math.nan)
    valid, heard = np.broadcast_to(gps.valid_s, gps.received_s.shape)[index], gps.received_s[index]
    fixes = tuple(
        Fix(_instant(valid[i]), i, _instant(heard[i]), AIRCRAFT, enu[i], sigma, nowhere, 1.0, True)
        for i in range(len(valid))
        if gps.heard[index, i]
    )
    beside = () if case.abeam is None else _plots(case, case.abeam, index, BESIDE[1])
    return Measures(fixes, _plots(case, case.plots, index, TARGET[1]), beside)


def measure_accuracy(case: Case, method: str, estimator: EstimatorName = "kalman") -> Accuracy:
    """RMSE of one method over all runs of a case; a method is a weighting, "radar alone" or "GPS alone"."""
    histories, _ = filtered(case, method, estimator, range(case.runs))
    estimated = np.array([positions_at(events, case.plot_s) for events in histories])
    found = np.array([events[-1].mean[6:] for events in histories])
    true_error = np.array(
        [case.gps_parameters.error_east_m, case.gps_parameters.error_north_m, case.gps_parameters.error_up_m]
    )
    error_found = float(np.sqrt(((found - true_error) ** 2).mean())) if method == "bias" else math.nan
    return accuracy_of(case, estimated, error_found)


def accuracy_of(case: Case, estimated: Floats, error_found_m: float = math.nan) -> Accuracy:
    """RMSE of positions (runs, t, 3) at the radar's times."""
    square = ((estimated - case.true_enu_m) ** 2).sum(axis=-1)
    counted = case.plot_s >= COUNTED_FROM_S

    def rmse(chosen: NDArray[np.bool_]) -> float:
        return float(np.sqrt(square[:, chosen].mean()))

    first, second, third = (rmse(counted & (case.along_m <= far) & (case.along_m > near)) for far, near in BANDS_M)
    return Accuracy(rmse(counted), (first, second, third), error_found_m)


def filtered(case: Case, method: str, estimator: EstimatorName, runs: Iterable[int]) -> tuple[list[list[Event]], Model]:
    """The states that a method's filter goes through in some runs of a case, and its model."""
    weighting: Weighting = method if method in WEIGHTINGS else "covariance"
    options = Options(estimator=estimator, weighting=weighting)
    frame = RunwayFrame(case.site.runway)
    radars = {radar.number: RadarFrame.of(radar, frame) for radar in case.site.radars}
    model = Model.of(options, case.site.position, radars)
    setting = associate.Setting(case.site, options, frame, radars)
    jobs = []
    for index in runs:
        heard = measures_of(case, index)
        wanted: list[Fix | Plot] = [] if method == "radar alone" else list(heard.fixes)
        if method == "radar alone":
            wanted = begin(heard.plots)
        elif method != "GPS alone":
            times = association_times(heard, setting)
            since = times[1] if times is not None else None
            wanted += [plot for plot in heard.plots if since is not None and plot.at >= since]
        jobs.append(Job(index, None, sorted(wanted, key=rank), _neighbour(heard, options)))
    return run_filter(jobs, model), model


def positions_at(events: Sequence[Event], time_s: Floats) -> Floats:
    """A track's ENU positions (t, 3) at times (t,), carried on from its latest state; NaN before the first."""
    at = np.array([(event.at - START) / SECOND for event in events])
    mean = np.array([event.mean for event in events])
    # Times are whole nanoseconds on one side and seconds on the other: a state of this very instant counts.
    latest = np.searchsorted(at, time_s + 1e-6, side="right") - 1
    ahead = np.maximum(time_s - at[latest], 0.0)[:, None]
    return np.where((latest >= 0)[:, None], mean[latest, :3] + ahead * mean[latest, 3:6], math.nan)


def association_times(heard: Measures, setting: associate.Setting, until_s: float = math.inf) -> tuple[int, int] | None:
    """When the target's plots became the aircraft: (heard at, valid since) in ns, or None if never before `until_s`."""
    for state, fix in checks(heard, setting, until_s):
        if state.ledger.pairs.get(TARGET) == AIRCRAFT:
            wait = int(setting.options.association_wait_s * SECOND)
            return max(fix.received_at, fix.at + wait), fix.at
    return None


def associated_ranges(heard: Measures, setting: associate.Setting) -> list[float]:
    """How far (m) the aircraft was from the radar at each check at which the aircraft beside it was taken for it."""
    found = []
    for state, fix in checks(heard, setting, math.inf):
        if state.ledger.pairs.get(BESIDE) == AIRCRAFT:
            radar = setting.radars[BESIDE[0]]
            found.append(float(np.linalg.norm(radar.from_enu(fix.enu_m))))
    return found


def checks(heard: Measures, setting: associate.Setting, until_s: float) -> Iterator[tuple[associate.Association, Fix]]:
    """Each report checked in turn against the plots about its time; yields the state after it and the report."""
    state = associate.Association()
    margin = 5 * SECOND
    sets = {TARGET: heard.plots, BESIDE: heard.beside}
    times = {key: np.array([plot.at for plot in plots], dtype=np.int64) for key, plots in sets.items()}
    for fix in heard.fixes:
        if fix.at > START + until_s * SECOND:
            return
        near = {}
        for key, plots in sets.items():
            first, last = np.searchsorted(times[key], (fix.at - margin, fix.at + margin))
            if first < last:
                near[key] = plots[first:last]
        tracks = RadarTracks(near, _places(near))
        state, _ = associate.check_due(associate.await_plots(state, fix), fix.at, associate.Nearby(tracks), setting)
        state = associate.pruned(state, fix.at - 10 * SECOND)
        yield state, fix


def _places(near: Mapping[Key, Sequence[Plot]]) -> dict[Key, Place]:
    """Where each radar track was lately, as `track` would know it."""
    places = {}
    for key, plots in near.items():
        places[key] = Place(plots[0].at, math.nan, math.nan, *plots[0].sigma[:2])
        for plot in plots:
            places[key] = places[key].then(plot)
    return places


def _association_table(runs: int, seed: int) -> tuple[Table, dict[str, float]]:
    """When radar and aircraft are one: mean and 95 % of the time heard, in the cases of the paper's page."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for title, case in {
        "fixes valid at 0.8, 5.8, ... s": case_003(runs, seed, first_fix_s=0.8),
        "the same, no azimuth": case_003(runs, seed, first_fix_s=0.8, missing="azimuth"),
        "the same, no elevation": case_003(runs, seed, first_fix_s=0.8, missing="elevation"),
        "the same, no range": case_003(runs, seed, first_fix_s=0.8, missing="range"),
        "random phase": case_003(runs, seed, random_phase=True),
    }.items():
        times_s = association_heard_s(case)
        mean, late = float(times_s.mean()), float(np.quantile(times_s, 0.95))
        rows.append((title, mean, late, float(np.isinf(times_s).sum())))
        figures |= {f"associated {title}": mean, f"associated 95 % {title}": late}
    beside = case_003(runs, seed, abeam_deg=3.0)
    for title, alone in {"only an aircraft 3 degrees abeam": True, "both aircraft": False}.items():
        for rule in ("default", "literal"):
            setting = setting_of(beside, Options(association=rule))
            farthest = [max(associated_ranges(_beside(beside, i, alone), setting), default=0.0) for i in range(runs)]
            share = sum(distance > 5000.0 for distance in farthest) / runs
            rows.append((f"{title}, {rule}: taken beyond 5 km in % of runs", 100.0 * share, math.nan, math.nan))
            figures[f"abeam {title}, {rule}"] = share
            figures[f"abeam ever {title}, {rule}"] = sum(distance > 0.0 for distance in farthest) / runs
    columns = ("association", "mean s (or %)", "95 % s", "never")
    return Table(f"003: when radar and aircraft are one, time heard, {runs} runs", columns, tuple(rows)), figures


def association_heard_s(case: Case) -> Floats:
    """When each run's target was associated, in seconds heard after the first plot; inf = not within a minute."""
    setting = setting_of(case, Options())
    times = [association_times(measures_of(case, index), setting, 60.0) for index in range(case.runs)]
    return np.array([math.inf if found is None else (found[0] - START) / SECOND for found in times])


def setting_of(case: Case, options: Options) -> associate.Setting:
    """The place and options that `associate` needs."""
    frame = RunwayFrame(case.site.runway)
    radars = {radar.number: RadarFrame.of(radar, frame) for radar in case.site.radars}
    return associate.Setting(case.site, options, frame, radars)


def _beside(case: Case, index: int, alone: bool) -> Measures:
    heard = measures_of(case, index)
    return replace(heard, plots=()) if alone else heard


def _neighbour(heard: Measures, options: Options) -> Neighbour:
    """The target's plots interpolated at a report's time, for the literal weighting."""
    times = np.array([plot.at for plot in heard.plots], dtype=np.int64)

    def at_time_of(fix: Fix) -> Near | None:
        first, last = np.searchsorted(times, (fix.at - 5 * SECOND, fix.at + 5 * SECOND))
        value, sigma = bracket(heard.plots[first:last], fix.at, options.association_wait_s)
        return None if all(map(math.isnan, value)) else (TARGET[0], value, sigma)

    return at_time_of


def _plots(case: Case, measured: PlotsMeasured, index: int, number: int) -> tuple[Plot, ...]:
    antenna = case.site.radars[0]
    sigma = (antenna.range_sigma_m, antenna.azimuth_sigma_rad, antenna.elevation_sigma_rad)
    at = [_instant(second) for second in case.plot_s]
    seen = measured.seen[index]
    polar = [(row[0], row[1], row[2]) for row in measured.polar[index].tolist()]
    return tuple(Plot(at[i], i, at[i], 1, number, polar[i], sigma) for i in range(len(at)) if seen[i])


def _instant(seconds: float) -> int:
    return START + round(float(seconds) * SECOND)
