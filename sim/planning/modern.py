"""The modern planner: the cheapest ways on a grid, each bent to its least J, and the best of them.

Source: 002-3, "the modern planner", the default of `talkdown plan`.
"""

from __future__ import annotations

from dataclasses import replace

from sim.planning.field import measure, resampled
from sim.planning.grid import ways
from sim.planning.spline import bend
from sim.planning.task import PlanError, Route, Task


def plan(task: Task) -> Route:
    """The route of least J that turns no narrower than asked and keeps out of the areas; with the others it came from.

    Raises PlanError, saying what is in the way.
    """
    kept, narrowest = [], 0.0
    for way in ways(task):
        bent = bend(task, way)
        if bent.outside_m < 0.0:
            continue
        narrowest = max(narrowest, bent.turn_radius_m)
        if bent.turn_radius_m >= task.turn_radius_m:
            curve = resampled(bent.curve_m)
            found = replace(measure(curve, task.threats, task.lambda_m4), turn_radius_m=bent.turn_radius_m)
            kept.append(Route("modern", curve, found))
    if not kept:
        raise PlanError(_in_the_way(task, narrowest))
    kept.sort(key=lambda one: one.measures.cost_m)
    return replace(kept[0], candidates=tuple(kept[1:]))


def _in_the_way(task: Task, narrowest_m: float) -> str:
    if narrowest_m == 0.0:
        return "No smooth way was found outside the areas to keep out of; leave more room between them."
    return (
        f"No way turns as wide as {task.turn_radius_m:.0f} m everywhere: the widest found turns with {narrowest_m:.0f} m; "
        "ask for a smaller turn radius, or leave more room."
    )
