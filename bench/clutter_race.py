"""What `bench.clutter` measures, in a process of its own.

python -m bench.clutter_race RUNS      prints, as JSON, CPU milliseconds a scan and GOSPA of every side in every case

All is in 20 x 20 km, detection 0.9, a scan every 6 s, 50 m an axis, 30 m/s, and begins with nothing or with known targets.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.clutter import FOUND, KNOWN, PAPER
from bench.clutter_sides import SIDES
from gateway.estimators.track_splitting import Plots
from sim.studies.clutter import DENSITY, PERIOD_S, SIDE_M, SPEED_MPS, gospa, plots_of, targets

Floats = NDArray[np.float64]
Drawn = tuple[Floats, list[Plots]]  # true positions (targets, 2, scans), and the plots of each scan

SIZES = {2: (30, 9), 10: (30, 9), 50: (25, 3), 200: (15, 1)}  # targets: scans of a run, and runs at most
KNOWN_SIZES = {2: (30, 15), 10: (30, 9), 50: (15, 5), 200: (6, 1)}
PAPER_SCANS = 40


def measure(runs: int) -> dict[str, Any]:
    """Everything in this process, side after side, run after run."""
    there = importlib.util.find_spec("stonesoup") is not None
    left_out = [] if there else ["Stone Soup is not installed, its trackers are left out: pip install stonesoup"]
    sides = [name for name in SIDES if there or name == "ours"]
    cases: list[tuple[str, int, Any]] = []
    for case, sizes, told in ((FOUND, SIZES, []), (KNOWN, KNOWN_SIZES, sides)):
        for size, (scans, most) in sizes.items():
            drawn = [_drawn(size, scans, turn) for turn in range(min(runs, most))]
            cases.append((case, size, _raced(drawn, 2.0 * size / SIDE_M**2, sides, told)))
    drawn = [_plotted(targets(PAPER_SCANS), DENSITY, np.random.default_rng([turn, 0])) for turn in range(runs)]
    cases.append((PAPER, 2, _raced(drawn, DENSITY, sides[:2], ["JPDA"])))
    return {"cases": cases, "left out": left_out}


def _raced(drawn: Sequence[Drawn], density: float, sides: Sequence[str], told: Sequence[str]) -> dict[str, Any]:
    """Milliseconds a scan and GOSPA of each run by side, turn by turn on the same plots.

    Those that are `told` where the targets are at the first scan begin with the second.
    """
    found: dict[str, Any] = {name: {"ms": [], "gospa": []} for name in sides}
    for true_m, scans in drawn:
        rate = np.gradient(true_m, PERIOD_S, axis=2)
        known = np.concatenate([true_m[:, :, 0].T, rate[:, :, 0].T]), 0
        for name in sides:
            tracker, spent_s, apart = SIDES[name](density, known if name in told else None), 0.0, []
            for place in range(int(name in told), len(scans)):
                position, one_s = tracker(scans[place], round(place * PERIOD_S * 1e9))
                spent_s += one_s
                apart.append(gospa(np.linalg.norm(true_m[:, :, None, place] - position[None], axis=1)))
            found[name]["ms"].append(1e3 * spent_s / len(apart))
            found[name]["gospa"].append(float(np.mean(apart)))
    return found


def _drawn(targets: int, scans: int, turn: int) -> Drawn:
    """Straight targets among twice as many clutter plots: the true positions, and the plots of each scan."""
    random = np.random.default_rng([turn, targets])
    return _plotted(_straight(targets, scans, random), 2.0 * targets / SIDE_M**2, random)


def _plotted(true_m: Floats, density: float, random: np.random.Generator) -> Drawn:
    return true_m, list(plots_of(true_m, random, density))


def _straight(targets: int, scans: int, random: np.random.Generator) -> Floats:
    """True positions (targets, 2, scans) of targets that fly straight and stay in the square."""
    elapsed_s, edge_m = PERIOD_S * np.arange(scans), 0.475 * SIDE_M
    paths: list[Floats] = []
    while len(paths) < targets:
        begin, course = random.uniform(-edge_m, edge_m, 2), random.uniform(0.0, 2.0 * np.pi)
        path = begin[:, None] + SPEED_MPS * elapsed_s * np.array([[np.cos(course)], [np.sin(course)]])
        if np.abs(path).max() < edge_m:
            paths.append(path)
    return np.array(paths)


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]))))
