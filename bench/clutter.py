"""Targets among twice as many clutter plots a scan: ours and Stone Soup's trackers on the same plots, turn by turn.

First all begin with nothing and find the targets; then all are told where they are, and Stone Soup's find nothing more,
while ours goes on to look for others. 20 x 20 km, detection 0.9, a scan every 6 s, 50 m an axis, 30 m/s. Stone Soup is
left out, and said, where it is not installed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from statistics import fmean
from typing import Any

from bench.measure import Figure, alone

JOINT_RATIO, NEAREST_RATIO = {2: 20.0, 50: 200.0, 200: 200.0}, {50: 50.0, 200: 50.0}
MS_AT_MOST = {200: 10.0}
PAPER_RATIO = 4.0
FOUND, KNOWN, PAPER = "targets in clutter", "known targets in clutter", "targets in 200 clutter plots (002-6)"


def clutter(runs: int, say: Callable[[str], None]) -> list[Figure]:
    """CPU milliseconds a scan by targets and side, the ratios to ours, and how many times the GOSPA of others ours has."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-W", "ignore", "-m", "bench.clutter_race", str(runs)]))
    for sentence in told["left out"]:
        say(sentence)
    figures = []
    for case, size, sides in told["cases"]:
        figures += _figures(case, size, sides)
    return figures


def _figures(case: str, size: int, sides: dict[str, dict[str, list[float]]]) -> list[Figure]:
    """Of one case; others' GOSPA is held against ours where all have to find what is there."""
    figures, others = [], [side for side in sides if side != "ours"]
    for side, found in sides.items():
        most = MS_AT_MOST.get(size) if side == "ours" else None
        figures.append(Figure(f"{size} {case}, a scan: {side}", "ms", tuple(found["ms"]), at_most=most))
    for side in others:
        least = (JOINT_RATIO if side == "JPDA" else NEAREST_RATIO).get(size)
        ratio = tuple(one / ours for one, ours in zip(sides[side]["ms"], sides["ours"]["ms"], strict=True))
        figures.append(Figure(f"… {side} / ours", "", ratio, at_least=PAPER_RATIO if case == PAPER else least))
    ours_m = fmean(sides["ours"]["gospa"])
    for side, found in sides.items():
        least = ours_m if side != "ours" and case == FOUND else None
        figures.append(Figure(f"… GOSPA: {side}", "m", (fmean(found["gospa"]),), at_least=least))
    return figures
