"""Targets among twice as many clutter plots a scan: ours and Stone Soup's trackers on the same plots, turn by turn.

python -m bench.clutter RUNS       prints, as JSON, CPU milliseconds a scan and GOSPA of every side

All begin with nothing and find the targets; 20 x 20 km, detection 0.9, a scan every 6 s, 50 m an axis, 30 m/s. Stone Soup is
left out, and said, where it is not installed.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable
from typing import Any

from bench.measure import Figure, alone

SIZES = {2: (30, 9), 10: (30, 9), 50: (25, 3), 200: (15, 1)}  # targets: scans of a run, and runs at most
JOINT_RATIO, NEAREST_RATIO = {2: 20.0, 50: 200.0, 200: 200.0}, {50: 50.0, 200: 50.0}
MS_AT_MOST = {200: 10.0}
PAPER_SCANS, PAPER_RATIO = 40, 4.0


def clutter(runs: int, say: Callable[[str], None]) -> list[Figure]:
    """CPU milliseconds a scan by targets and side, the ratios to ours, and how many times the GOSPA of others ours has."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-W", "ignore", "-m", "bench.clutter", str(runs)]))
    for sentence in told["left out"]:
        say(sentence)
    figures = []
    for size, sides in told["sides"].items():
        targets = int(size)
        for side, found in sides.items():
            most = MS_AT_MOST.get(targets) if side == "ours" else None
            figures.append(Figure(f"{size} targets in clutter, a scan: {side}", "ms", tuple(found["ms"]), at_most=most))
        for side, found in sides.items():
            if side != "ours":
                least = (JOINT_RATIO if side == "JPDA" else NEAREST_RATIO).get(targets)
                ratio = tuple(theirs / ours for theirs, ours in zip(found["ms"], sides["ours"]["ms"], strict=True))
                figures.append(Figure(f"… {side} / ours", "", ratio, at_least=least))
        for side, found in sides.items():
            mean_m = sum(found["gospa"]) / len(found["gospa"])
            ours_m = sum(sides["ours"]["gospa"]) / len(found["gospa"])
            figures.append(Figure(f"… GOSPA: {side}", "m", (mean_m,), at_least=None if side == "ours" else ours_m))
    if told["paper"] is not None:
        ours, theirs = told["paper"]["ours"], told["paper"]["JPDA"]
        figures.append(Figure("paper 002-6's case, a scan: ours finds both", "ms", tuple(ours)))
        ratio = tuple(one / other for one, other in zip(theirs, ours, strict=True))
        figures.append(Figure("… JPDA, which knows both / ours", "", ratio, at_least=PAPER_RATIO))
    return figures


def measure(runs: int) -> dict[str, Any]:
    """Everything in this process, side after side, run after run."""
    import numpy as np

    from bench.clutter_sides import SIDES
    from sim.studies.clutter import PERIOD_S, SIDE_M, gospa, plots_of

    there = importlib.util.find_spec("stonesoup") is not None
    left_out = [] if there else ["Stone Soup is not installed, its trackers are left out: pip install stonesoup"]
    sides = {name: side for name, side in SIDES.items() if there or name == "ours"}
    told: dict[str, Any] = {}
    for targets, (scans, most) in SIZES.items():
        found = told[str(targets)] = {name: {"ms": [], "gospa": []} for name in sides}
        density = 2.0 * targets / SIDE_M**2
        for turn in range(min(runs, most)):
            random = np.random.default_rng([turn, targets])
            true_m = _straight(targets, scans, random)
            drawn = list(plots_of(true_m, random, density))
            for name, made in sides.items():
                tracker, spent_s, apart = made(density), 0.0, []
                for place, plots in enumerate(drawn):
                    position, one_s = tracker(plots, round(place * PERIOD_S * 1e9))
                    spent_s += one_s
                    apart.append(gospa(np.linalg.norm(true_m[:, :, None, place] - position[None], axis=1)))
                found[name]["ms"].append(1e3 * spent_s / scans)
                found[name]["gospa"].append(float(np.mean(apart)))
    return {"sides": told, "left out": left_out, "paper": _paper(runs) if there else None}


def _paper(runs: int) -> dict[str, list[float]]:
    """Milliseconds a scan in the paper's case: ours, which finds both targets among 200 plots, and JPDA, which knows them."""
    import numpy as np

    from bench.clutter_sides import joint_of_known, ours
    from sim.studies.clutter import DENSITY, PERIOD_S, plots_of, targets

    true_m = targets(PAPER_SCANS)
    rate = np.gradient(true_m, PERIOD_S, axis=2)
    spent: dict[str, list[float]] = {"ours": [], "JPDA": []}
    for turn in range(runs):
        drawn = list(plots_of(true_m, np.random.default_rng([turn, 0])))
        known = np.concatenate([true_m[:, :, 0].T, rate[:, :, 0].T])
        for name, tracker in (("ours", ours(DENSITY)), ("JPDA", joint_of_known(DENSITY, known, 0))):
            some = drawn if name == "ours" else drawn[1:]
            first = len(drawn) - len(some)
            each = [tracker(plots, round((first + k) * PERIOD_S * 1e9))[1] for k, plots in enumerate(some)]
            spent[name].append(1e3 * float(np.mean(each)))
    return spent


def _straight(targets: int, scans: int, random: Any) -> Any:
    """True positions (targets, 2, scans) of targets that fly straight and stay in the square."""
    import numpy as np

    from sim.studies.clutter import PERIOD_S, SIDE_M, SPEED_MPS

    elapsed_s, edge_m = PERIOD_S * np.arange(scans), 0.475 * SIDE_M
    paths: list[Any] = []
    while len(paths) < targets:
        begin, course = random.uniform(-edge_m, edge_m, 2), random.uniform(0.0, 2.0 * np.pi)
        path = begin[:, None] + SPEED_MPS * elapsed_s * np.array([[np.cos(course)], [np.sin(course)]])
        if np.abs(path).max() < edge_m:
            paths.append(path)
    return np.array(paths)


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]))))
