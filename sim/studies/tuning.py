"""Whether one set of defaults serves every speed: the default modes against the best tuned ones, case by case.

A drone at 15 m/s, 000's case at 118 m/s and 003's approach at 130 m/s. Tuned are the accelerations of calm and manoeuvring
flight, and how fast turns are; the best of the grid has the least RMSE of the position.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

from gateway.settings import Estimation, Options
from sim.studies import Progress, Study, Table, silent
from sim.studies.consistency import follow, model_of
from sim.studies.ensembles import approach, drone, two_turns

CALM, MANOEUVRE, TURN_DEGPS, BANK_DEG = (0.05, 0.15, 0.5), (0.7, 2.0, 5.0), (1.5, 3.0), (15.0, 25.0, 40.0)


def run(runs: int = 20, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """RMSE of the position with the defaults, of the best of the grid, and their ratio; nothing is drawn."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    cases = (drone(runs, seed), two_turns(runs, seed), approach(runs, seed))
    grid = list(itertools.product(CALM, MANOEUVRE, TURN_DEGPS, BANK_DEG))
    options = Options(estimator="rmimm")
    for place, case in enumerate(cases):
        usual = follow(case, model_of(case, options)).rmse_m(case.since_s)
        found: list[tuple[float, str]] = []
        for turn, (calm, manoeuvre, rate, bank) in enumerate(grid):
            progress(case.name, (place + turn / len(grid)) / len(cases))
            tuned = replace(
                Estimation(),
                calm_acceleration_mps2=calm,
                manoeuvre_acceleration_mps2=manoeuvre,
                turn_rate_rps=math.radians(rate),
                bank_rad=math.radians(bank),
            )
            rmse_m = follow(case, model_of(case, options, tuned)).rmse_m(case.since_s)
            found.append((rmse_m, f"{calm:g}, {manoeuvre:g} m/s2, {rate:g} deg/s, {bank:g} deg"))
        best_m, how = min(found)
        rows.append((case.name, usual, best_m, usual / best_m, how))
        figures[f"ratio {case.name}"] = usual / best_m
    columns = ("case", "defaults, RMSE m", "best tuned", "ratio", "tuned: calm, manoeuvre, turn rate, bank")
    return Study("tuning", runs, seed, (Table(f"one set of defaults, {runs} runs", columns, tuple(rows)),), figures)
