"""Whether one set of defaults serves every speed: the default modes against the best tuned ones, case by case.

A drone at 15 m/s, 000's case at 118 m/s and 003's approach at 130 m/s. From the defaults on, one setting after another takes
the value with the least RMSE of the position, until none of them gains anything.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gateway.settings import Estimation, Options
from sim.studies import Progress, Study, Table, silent
from sim.studies.consistency import follow, model_of
from sim.studies.ensembles import Ensemble, approach, drone, two_turns

TRIED: dict[str, tuple[float, ...]] = {
    "turn_rate_rps": (math.radians(1.5), math.radians(3.0)),
    "bank_rad": (math.radians(15.0), math.radians(25.0), math.radians(40.0)),
    "turn_acceleration_mps2": (0.3, 0.5, 1.0, 2.0),
    "mode_lasts_s": (4.5, 9.0, 18.0, 36.0),
    "calm_across_acceleration_mps2": (0.3, 1.0, 3.0),
    "calm_acceleration_mps2": (0.05, 0.15, 0.5),
    "lasting_across_acceleration_mps2": (0.3, 1.0, 3.0),
    "lasting_drag_mps2": (0.0, 0.25, 0.5),
    "manoeuvre_acceleration_mps2": (0.7, 1.5, 3.0, 6.0),
    "manoeuvre_share": (2.0, 6.0, 20.0),
}
SWEEPS = 3  # over all settings, at most


def run(runs: int = 20, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """RMSE of the position with the defaults, with the best found, and their ratio; nothing is drawn."""
    rows: list[tuple[str | float, ...]] = []
    notes: list[str] = []
    figures: dict[str, float] = {}
    cases = (drone(runs, seed), two_turns(runs, seed), approach(runs, seed))
    for place, case in enumerate(cases):

        def said(share: float, case: Ensemble = case, place: int = place) -> None:
            progress(case.name, (place + share) / len(cases))

        usual_m = reached_m(case, Estimation())
        best_m, best = tuned(case, usual_m, said)
        rows.append((case.name, usual_m, best_m, usual_m / best_m))
        notes.append(f"{case.name}, best tuned: {_changes(best)}")
        figures[f"ratio {case.name}"] = usual_m / best_m
    columns = ("case", "defaults, RMSE m", "best tuned", "ratio")
    shown = Table(f"one set of defaults, {runs} runs", columns, tuple(rows), tuple(notes))
    return Study("tuning", runs, seed, (shown,), figures)


def reached_m(case: Ensemble, estimation: Estimation) -> float:
    """RMSE of the position of `rmimm` with these settings."""
    return follow(case, model_of(case, Options(estimator="rmimm"), estimation)).rmse_m(case.since_s)


def tuned(case: Ensemble, usual_m: float, said: Callable[[float], None]) -> tuple[float, Estimation]:
    """The least RMSE that is found from the defaults on, and its settings."""
    least, best = usual_m, Estimation()
    for sweep in range(SWEEPS):
        before = best
        for place, (name, values) in enumerate(TRIED.items()):
            said((sweep + place / len(TRIED)) / SWEEPS)
            others = [replace(best, **{name: value}) for value in values if value != getattr(best, name)]
            found = [(reached_m(case, other), other) for other in others]
            least, best = min([(least, best), *found], key=lambda one: one[0])
        if best == before:
            break
    return least, best


def _changes(estimation: Estimation) -> str:
    """The settings that are not the defaults, with their values in what they are named for, angles in degrees."""
    changed = []
    for name in TRIED:
        value = getattr(estimation, name)
        if value != getattr(Estimation(), name):
            angle = name.endswith(("_rps", "_rad"))
            changed.append(f"{name} {math.degrees(value):g} deg" if angle else f"{name} {value:g}")
    return ", ".join(changed) or "nothing"
