"""Paper 002-3's experiment: routes under threat, by the paper's method literally and read well, and by the modern planner."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.planning import modern
from sim.planning import seed as paper
from sim.planning.case import Case, drawn_case
from sim.planning.field import Threats
from sim.planning.fixtures import SCENES, fixture
from sim.planning.seed import LITERAL, Seed
from sim.planning.task import Route, Task
from sim.planning.triples import OBJECTIVES, Objective, anneal, exact, triples
from sim.studies import Progress, Study, Table, silent
from sim.studies.routes_bound import best_known, fine_grid

Floats = NDArray[np.float64]

READINGS = {
    "modern": None,
    "threat": Seed(),
    "clearance": Seed("clearance"),
    "literal triples": Seed("literal"),
    "literal fit": Seed(fit="literal"),
    "literal choice": Seed(choice="literal"),
    "literal": LITERAL,
}  # what of the paper's method is literal, one thing at a time, and all of it
LAMBDAS_KM = (1.5, 2.0, 2.5, 3.0)  # where a metre counts as two
ON_A_RADAR_M = 50.0
HIT_M = 20.0


def task_of(case: Case, lambda_km: float = 2.0) -> Task:
    """A drawn case as one leg on the level, as in the paper; `lambda_km`: where a metre counts as two."""
    if isinstance(case.start, str) or isinstance(case.goal, str):
        raise ValueError("the paper's routes have places as ends")
    box = case.box(case.start, case.goal)
    return Task(case.start, case.goal, Threats.level(case.threat_m), box, lambda_m4=(1e3 * lambda_km) ** 4)


def scene(number: int) -> Case:
    """The shipped scenes, and after those what further seeds draw."""
    return fixture(number) if number in SCENES else drawn_case(number)


def route_of(task: Task, how: Seed | None, seed: int) -> tuple[Route, float]:
    """The route by a reading of the paper, None for the modern planner; and the seconds that it took."""
    begun = time.perf_counter()
    route = modern.plan(task) if how is None else paper.plan(task, seed, how)
    return route, time.perf_counter() - begun


def errors_m(case: Case, objective: Objective, seed: int) -> Floats:
    """How far the annealed optimum of each triple is from the exact one (k,), m."""
    found = triples(case.threat_m)
    aside = anneal(found, objective, np.random.default_rng(seed)) - exact(found, objective)
    return np.asarray(np.hypot(*aside.T))


def run(runs: int = 10, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """`runs` scenes: the ten that are shipped, then drawn ones. `rrd`: where the first scenes are drawn, or None."""
    cases = [scene(number) for number in range(1, runs + 1)]
    tasks = [task_of(case) for case in cases]
    best, grids = [], []
    routes: dict[str, list[Route]] = {name: [] for name in READINGS}
    took: dict[str, list[float]] = {name: [] for name in READINGS}
    for number, task in enumerate(tasks):
        progress(f"scene {number + 1}", 0.7 * number / runs)
        found, _ = best_known(task, seed + number)
        for name, how in READINGS.items():
            route, seconds = route_of(task, how, seed)
            routes[name].append(route)
            took[name].append(seconds)
        best.append(min(found, *(one[-1].measures.cost_m for one in routes.values())))
        grids.append(fine_grid(task) / best[-1])
    figures: dict[str, float] = {"fine grid, least": min(grids), "fine grid, most": max(grids)}
    tables = (
        _readings(routes, took, np.array(best), figures),
        _triples(cases, seed, figures),
        _lambdas(tasks[: SCENES[-1]], seed, figures, progress),
    )
    if rrd is not None:
        from sim.studies.routes_figures import draw

        draw(rrd, cases[:4], tasks[:4], {name: kept[:4] for name, kept in routes.items()}, seed)
    return Study("routes", runs, seed, tables, figures, str(rrd) if rrd else None)


def _readings(
    routes: dict[str, list[Route]], took: dict[str, list[float]], best: Floats, figures: dict[str, float]
) -> Table:
    clear = {name: np.array([route.measures.clearance_m for route in kept]) for name, kept in routes.items()}
    rows = []
    for name, kept in routes.items():
        ratio = np.array([route.measures.cost_m for route in kept]) / best
        length = np.mean([route.measures.length_m for route in kept]) / 1e3
        radius = min(route.measures.turn_radius_m for route in kept)
        seconds = float(np.median(took[name]))
        figures |= {f"{name}, J most": float(ratio.max()), f"{name}, J median": float(np.median(ratio))}
        figures |= {f"{name}, clearance least": float(clear[name].min()), f"{name}, s": seconds}
        beside = (float(np.median(ratio)), float(ratio.max()), float(length))
        rows.append(
            (name, *beside, float(np.median(clear[name])) / 1e3, float(clear[name].min()) / 1e3, radius, seconds)
        )
    figures["modern, as clear as threat"] = float((clear["modern"] >= clear["threat"]).sum())
    columns = ("method", "J/best median", "most", "length km", "clearance km", "least", "turn radius m", "s")
    title = f"002-3: {len(best)} scenes, lambda 16 km4; J against the best known"
    grid = f"A grid four times as fine comes to {figures['fine grid, least']:.4f} to {figures['fine grid, most']:.4f} of it."
    clearer = (
        f"The modern route is as clear of threats as the threat route in {figures['modern, as clear as threat']:.0f}."
    )
    return Table(title, columns, tuple(rows), (grid, clearer))


def _triples(cases: list[Case], seed: int, figures: dict[str, float]) -> Table:
    rows = []
    for objective in OBJECTIVES:
        errors = np.concatenate([errors_m(case, objective, seed) for case in cases])
        on_radar = _on_radar(cases, objective)
        figures |= {f"{objective}, annealing most": float(errors.max()), f"{objective}, on a radar": on_radar}
        rows.append(
            (
                objective,
                float(np.median(errors)),
                float(errors.max()),
                100.0 * float((errors <= HIT_M).mean()),
                on_radar,
            )
        )
    columns = ("objective", "median m", "most m", f"within {HIT_M:g} m %", "optimum on a radar %")
    return Table("Annealed optima of the triples against the exact ones", columns, tuple(rows))


def _on_radar(cases: list[Case], objective: Objective) -> float:
    """The share of exact optima that lie on one of their radars, %."""
    found = np.concatenate([triples(case.threat_m) for case in cases])
    apart = found - exact(found, objective)[:, None]
    return 100.0 * float((np.hypot(apart[..., 0], apart[..., 1]).min(axis=1) < ON_A_RADAR_M).mean())


def _lambdas(tasks: list[Task], seed: int, figures: dict[str, float], progress: Progress) -> Table:
    """How the paper's route does as threat counts more."""
    rows = []
    for place, at_km in enumerate(LAMBDAS_KM):
        progress(f"lambda {at_km**4:.0f} km4", 0.7 + 0.3 * place / len(LAMBDAS_KM))
        priced = [replace(task, lambda_m4=(1e3 * at_km) ** 4) for task in tasks]
        ours = [modern.plan(task).measures for task in priced]
        theirs = [paper.plan(task, seed).measures for task in priced]
        ratio = np.array([one.cost_m / other.cost_m for one, other in zip(theirs, ours, strict=True)])
        clearer = sum(other.clearance_m >= one.clearance_m for one, other in zip(theirs, ours, strict=True))
        length = float(np.mean([one.length_m for one in ours])) / 1e3
        figures[f"lambda {at_km**4:.0f}, J most"] = float(ratio.max())
        rows.append((f"{at_km**4:.0f}", at_km, length, float(np.median(ratio)), float(ratio.max()), float(clearer)))
    columns = ("lambda km4", "a metre is two at km", "modern, km", "threat/modern median", "most", "modern as clear")
    return Table(
        "As threat counts more, the best ways leave the corridor that the paper looks in", columns, tuple(rows)
    )
