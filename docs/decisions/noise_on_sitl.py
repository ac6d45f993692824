"""Whether the program says that a noise is stated wrongly, on a flight that SITL flew: a table of docs/honesty.md.

python docs/decisions/noise_on_sitl.py SESSION [RUNS]     SESSION: an archived replay of the recording, for its truth.parquet

Reports and plots are made of the truth with noise of their own: SITL's own reports have next to none.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

from gateway.align import SECOND, Fix, Plot
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.fuse.events import Job, Measure
from gateway.fuse.filtering import run
from gateway.fuse.weighting import Model
from gateway.settings import DEMO_SITE, EstimatorName, Options, PositionSource, Runway
from sim.studies.noise import WRONG, listened

STATED = {"position": 5.0, "velocity": 0.5, "range": 15.0, "azimuth": 1e-3, "elevation": 1e-3}
ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "rmimm", "alpha-beta-gamma")
RATES_HZ = (0.2, 1.0, 5.0)
SCAN_S = 0.4


def main() -> None:
    """The table: said in so many of the runs, and after how long."""
    truth = parquet.read_table(Path(sys.argv[1]) / "truth.parquet")
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    names = ("latitude_deg", "longitude_deg", "height_m", *(f"velocity_{way}_mps" for way in ("east", "north", "up")))
    known = np.array([truth[name].to_numpy() for name in names], dtype=np.float64)
    flying = np.hypot(known[3], known[4]) > 5.0  # one of two messages of the truth has no velocity
    time = truth["time"].to_numpy().astype(np.int64)[flying]
    known, at_s = known[:, flying], (time - time[0]) / SECOND
    angles, height, speed = np.radians(known[:2]), known[2], np.ascontiguousarray(known[3:].T)
    runway = Runway(float(angles[0][0]), float(angles[1][0]), float(height[0]), 0.0)
    frame = RunwayFrame(runway)
    radar = replace(DEMO_SITE.radars[0], azimuth_sigma_rad=1e-3, elevation_sigma_rad=1e-3)
    enu = frame.enu_from_geodetic(angles[0], angles[1], height)
    polar = polar_from_xyz(RadarFrame.of(radar, frame).from_enu(enu))
    position = PositionSource(STATED["position"], 10.0, STATED["velocity"])
    print(f"{'noise':12}{'Hz':>6}{'times':>7}" + "".join(f"{name + ': said, after s':>36}" for name in ESTIMATORS))
    for part, rate, wrong in [
        *(("", rate, 1.0) for rate in RATES_HZ),
        *itertools.product(("position", "velocity"), RATES_HZ, (WRONG, 1.0 / WRONG)),
        *itertools.product(("range", "azimuth", "elevation"), (1.0,), (WRONG, 1.0 / WRONG)),
    ]:
        cells = []
        for name in ESTIMATORS:
            model = Model.of(Options(estimator=name), position, {radar.number: RadarFrame.of(radar, frame)})
            found: list[float] = []
            others = 0
            for seed in range(runs):
                noise = {key: sigma * (wrong if key == part else 1.0) for key, sigma in STATED.items()}
                measures = _measured(at_s, time, enu, speed, polar, noise, rate, seed)
                (events,) = run([Job(0, None, measures, lambda fix: None)], model)
                heard = listened([events], position, {radar.number: radar})
                found += [heard.found_s[part]] if part in heard.found_s else []
                others += len(set(heard.found_s) - {part})
            after = f"{np.median(found):.0f}" if found else "-"
            cells.append(f"{len(found)}/{runs}, {after}, others {others}")
        print(f"{part or 'as stated':12}{rate:6g}{wrong:7.2f}" + "".join(f"{cell:>36}" for cell in cells), flush=True)


def _measured(
    at_s: np.ndarray,
    time: np.ndarray,
    enu: np.ndarray,
    speed: np.ndarray,
    polar: np.ndarray,
    noise: dict[str, float],
    rate_hz: float,
    seed: int,
) -> list[Measure]:
    random = np.random.default_rng(seed)
    sigma_m, found = np.full(3, STATED["position"]), list[Measure]()
    for place in np.unique(np.searchsorted(at_s, np.arange(0.03, at_s[-1], 1.0 / rate_hz))).tolist():
        at = int(time[place])
        where = enu[place] + random.normal(0.0, noise["position"], 3)
        fast = speed[place] + random.normal(0.0, noise["velocity"], 3)
        found.append(Fix(at, 0, at, "mavlink:1", where, sigma_m, fast, STATED["velocity"], True))
    sigmas = tuple(noise[part] for part in ("range", "azimuth", "elevation"))
    for place in np.unique(np.searchsorted(at_s, np.arange(10.0, at_s[-1], SCAN_S))).tolist():
        at = int(time[place])
        distance, azimuth, elevation = (polar[place] + random.normal(0.0, sigmas)).tolist()
        stated = (STATED["range"], STATED["azimuth"], STATED["elevation"])
        found.append(Plot(at, 0, at, 1, 1, (distance, azimuth, elevation), stated))
    return sorted(found, key=lambda one: one.at)


if __name__ == "__main__":
    main()
