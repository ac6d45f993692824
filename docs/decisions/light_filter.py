"""What the light filter costs and reaches in the gateway, beside the other estimators: the tables of docs/papers/002-1.md.

python docs/decisions/light_filter.py [RUNS] [SEED]     003's approach, 000's case, and a fleet's cost for each row
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway import associate
from gateway.align import SECOND, Fix
from gateway.frames import RunwayFrame
from gateway.fuse.events import Event, Job, Measure, rank
from gateway.fuse.filtering import run
from gateway.fuse.weighting import Model
from gateway.observation import GpsReport, Heard
from gateway.pipeline import initial, step
from gateway.settings import DEMO_SITE, EstimatorName, Options, PositionSource
from sim.cases import Case, case_003
from sim.studies.fusion import BANDS_M, COUNTED_FROM_S, START, association_times, measures_of, positions_at, setting_of
from sim.studies.rmimm import COUNTED_FROM_S as SETTLED_FROM_S
from sim.studies.rmimm import flight

Floats = NDArray[np.float64]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm", "alpha-beta-gamma")


def main() -> None:
    """All tables."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    print(
        f"003, 3-D RMSE m, {runs} runs: whole, 50-25, 25-10, 10-1.2 km; NEES of 3; whole where the source has no error"
    )
    cases = {error: case_003(runs, seed, gps_error=error) for error in (True, False)}
    jobs = {error: _jobs(case) for error, case in cases.items()}
    for name in ESTIMATORS:
        with_error, without = (_approach(cases[error], jobs[error], name) for error in (True, False))
        print(f"{name:28}", *(f"{value:8.2f}" for value in (*with_error, without[0])), flush=True)
    print(f"000, {runs // 4} runs: RMSE of position m, of velocity m/s; the same with velocity measured")
    for name in ESTIMATORS:
        told = (*_turns(runs // 4, seed, name, velocity=False), *_turns(runs // 4, seed, name, velocity=True))
        print(f"{name:28}", *(f"{value:8.2f}" for value in told), flush=True)
    print("CPU microseconds for each report in a fleet, the filter alone: one at a time, 100, 1000 at once")
    for name, costs in _costs((1, 100, 1000)).items():
        print(f"{name:28}", *(f"{value:8.1f}" for value in costs), flush=True)
    print("CPU microseconds for each row of the whole gateway, 1 Hz in ticks of 20 ms: 100 aircraft, 1000")
    for name, costs in _whole((100, 1000)).items():
        print(f"{name:28}", *(f"{value:8.1f}" for value in costs), flush=True)


def _jobs(case: Case) -> list[Job]:
    """Every run's measurements, plots from association on."""
    setting: associate.Setting = setting_of(case, Options())
    jobs = []
    for index in range(case.runs):
        heard = measures_of(case, index)
        times = association_times(heard, setting)
        since = times[1] if times is not None else 1 << 62
        wanted: list[Measure] = [*heard.fixes, *(plot for plot in heard.plots if plot.at >= since)]
        jobs.append(Job(index, None, sorted(wanted, key=rank), lambda fix: None))
    return jobs


def _approach(case: Case, jobs: Sequence[Job], name: EstimatorName) -> tuple[float, ...]:
    """RMSE over the whole approach and by band, and the mean NEES of the position just after each measurement."""
    setting = setting_of(case, Options())
    histories = run(jobs, Model.of(Options(estimator=name), case.site.position, setting.radars))
    off = np.array([positions_at(events, case.plot_s) for events in histories]) - case.true_enu_m
    square, counted = (off**2).sum(axis=-1), case.plot_s >= COUNTED_FROM_S
    bands = [counted & (case.along_m <= far) & (case.along_m > near) for far, near in BANDS_M]
    rmse = [math.sqrt(float(square[:, chosen].mean())) for chosen in (counted, *bands)]
    nees = [
        _nees(case, [event for event in events if event.at >= START + COUNTED_FROM_S * SECOND]) for events in histories
    ]
    return (*rmse, float(np.mean(nees)))


def _nees(case: Case, events: Sequence[Event]) -> float:
    at = np.array([(event.at - START) / SECOND for event in events])
    inside = (at >= case.plot_s[0]) & (at <= case.plot_s[-1])
    true = np.stack([np.interp(at, case.plot_s, case.true_enu_m[:, axis]) for axis in range(3)], axis=1)
    off = np.array([event.mean[:3] for event in events]) - true
    claimed = np.array([event.covariance[:3, :3] for event in events])
    return float((off[:, None] @ np.linalg.inv(claimed) @ off[:, :, None])[inside].mean())


def _turns(runs: int, seed: int, name: EstimatorName, *, velocity: bool) -> tuple[float, float]:
    """RMS errors of position and velocity in 000's case, level; the height is exact."""
    flown = flight(runs, seed, velocity=velocity)
    sigma = np.array([flown.sigma[0], flown.sigma[1], 1.0])
    jobs = []
    for index in range(runs):
        fixes = []
        for second, told in enumerate(flown.measured[:, index]):
            speed = np.append(told[2:], 0.0) if velocity else np.full(3, math.nan)
            at = START + second * SECOND
            fixes.append(Fix(at, second, at, "mavlink:1", np.append(told[:2], 0.0), sigma, speed, 1.0, True))
        jobs.append(Job(index, None, fixes, lambda fix: None))
    model = Model.of(Options(estimator=name, weighting="covariance"), PositionSource(), {})
    mean = np.array([[event.mean for event in events] for events in run(jobs, model)])[:, SETTLED_FROM_S:]
    place, speed = flown.position[SETTLED_FROM_S:], flown.velocity[SETTLED_FROM_S:]
    off, faster = mean[:, :, :2] - place, mean[:, :, 3:5] - speed
    return math.sqrt(float((off**2).sum(axis=-1).mean())), math.sqrt(float((faster**2).sum(axis=-1).mean()))


def _costs(fleets: Sequence[int], rounds: int = 5) -> dict[str, list[float]]:
    """CPU microseconds for each report, the least of some rounds in which the estimators take turns."""
    least = {name: [math.inf] * len(fleets) for name in ESTIMATORS}
    models = {name: Model.of(Options(estimator=name), DEMO_SITE.position, {}) for name in ESTIMATORS}
    for place, fleet in enumerate(fleets):
        warm = {name: [events[-1] for events in run(_fleet(fleet, range(20)), models[name])] for name in ESTIMATORS}
        for _ in range(rounds):
            for name in ESTIMATORS:
                jobs = _fleet(fleet, range(20, 30))
                jobs = [replace(job, base=base) for job, base in zip(jobs, warm[name], strict=True)]
                began = time.process_time_ns()
                run(jobs, models[name])
                spent_us = (time.process_time_ns() - began) / 1000.0 / (10.0 * fleet)
                least[name][place] = min(least[name][place], spent_us)
    return dict(least)


def _fleet(fleet: int, seconds: range) -> list[Job]:
    """Reports with velocity, one a second, of aircraft that fly straight on."""
    random = np.random.default_rng(1)
    velocity = random.normal(0.0, 60.0, (fleet, 3)) * [1.0, 1.0, 0.05]
    sigma = np.full(3, 8.0)
    noise = random.normal(0.0, 8.0, (fleet, 64, 3))
    jobs = []
    for index in range(fleet):
        fixes = []
        for second in seconds:
            at = START + second * SECOND
            place = velocity[index] * second + noise[index, second]
            fixes.append(Fix(at, second, at, f"mavlink:{index}", place, sigma, velocity[index], 1.0, True))
        jobs.append(Job(index, None, fixes, lambda fix: None))
    return jobs


def _whole(fleets: Sequence[int], rounds: int = 3) -> dict[str, list[float]]:
    """The same through every stage: the least of some rounds over the last ten of twenty seconds of reports."""
    least = {name: [math.inf] * len(fleets) for name in ESTIMATORS}
    for place, fleet in enumerate(fleets):
        ticks = _ticks(fleet)
        for _ in range(rounds):
            for name in ESTIMATORS:
                state, rows, spent = initial(DEMO_SITE, Options(estimator=name)), 0, 0
                for tick, heard in enumerate(ticks):
                    began = time.process_time_ns()
                    state, picture = step(state, heard)
                    if tick >= len(ticks) // 2:
                        spent, rows = spent + time.process_time_ns() - began, rows + len(picture.fuse.time)
                least[name][place] = min(least[name][place], spent / 1000.0 / rows)
    return least


def _ticks(fleet: int) -> list[list[Heard]]:
    """Twenty seconds of reports with velocity from all around, in arrivals of their own, by ticks of 20 ms."""
    frame, random = RunwayFrame(DEMO_SITE.runway), np.random.default_rng(1)
    place = random.uniform(-1.0, 1.0, (fleet, 3)) * [4e4, 4e4, 500.0] + [0.0, 0.0, 1500.0]
    velocity = random.normal(0.0, 60.0, (fleet, 3)) * [1.0, 1.0, 0.0]
    phase_s = random.uniform(0.0, 1.0, fleet)
    ticks: list[list[Heard]] = [[] for _ in range(1000)]
    for second in range(20):
        noisy = place + velocity * (second + phase_s)[:, None] + random.normal(0.0, 8.0, (fleet, 3))
        latitude, longitude, height = frame.geodetic_from_enu(noisy)
        for index in np.argsort(phase_s).tolist():
            at = START + round((second + phase_s[index]) * SECOND) // 4000 * 4000
            where = float(latitude[index]), float(longitude[index]), float(height[index])
            report = GpsReport(f"mavlink:{index}", at, at, *where, *velocity[index].tolist())
            ticks[(at - START) // 20_000_000].append(Heard(at, (report,)))
    return [tick for tick in ticks if tick]


if __name__ == "__main__":
    main()
