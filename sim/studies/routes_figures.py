"""Paper 002-3's figures drawn into an .rrd: scenes with three routes each, and the annealed optima."""

from __future__ import annotations

from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from sim.planning.case import Case
from sim.planning.drawing import CANDIDATE, LITERAL, MODERN, SEED, Line, Sheet, views
from sim.planning.seed import local_optima
from sim.planning.task import Route, Task

_SHOWN = {"threat": (SEED, 2.5), "literal": (LITERAL, 2.0), "modern": (MODERN, 3.5)}
_CANDIDATES = 25


def draw(path: Path, cases: list[Case], tasks: list[Task], routes: dict[str, list[Route]], seed: int) -> None:
    """A tab for each scene: white the modern route, cyan the paper's, pink the literal one, grey the curves it came from."""
    sheets = [Sheet(f"scene_{number}", task.box_m) for number, task in enumerate(tasks, 1)]
    titles = "white: modern; cyan: the paper's; pink: literal; green: optima of triples"
    tabs = [views(sheet, f"{case.name} - {titles}") for sheet, case in zip(sheets, cases, strict=True)]
    for tab, sheet in zip(tabs, sheets, strict=True):
        tab.name = sheet.root.replace("_", " ")
    blueprint = rrb.Blueprint(
        rrb.Tabs(*tabs), rrb.TimePanel(timeline="metres", state="collapsed"), collapse_panels=True
    )
    with rr.RecordingStream("talkdown_study", recording_id=f"routes-{seed}") as recording:
        recording.save(str(path), default_blueprint=blueprint)
        recording.send_recording_name("002-3: routes under threat")
        for number, (sheet, task) in enumerate(zip(sheets, tasks, strict=True)):
            sheet.draw_field(recording, task.threats, task.lambda_m4)
            sheet.draw_threats(recording, task.threats, task.areas)
            sheet.draw_points(recording, "optima", local_optima(task, seed, "threat"))
            for place, other in enumerate(routes["threat"][number].candidates[:_CANDIDATES], 1):
                sheet.draw_line(recording, Line(f"candidate {place}", other.curve_m, CANDIDATE, 0.7))
            for name, (colour, width) in _SHOWN.items():
                line = Line(name, routes[name][number].curve_m, colour, width)
                sheet.draw_line(recording, line)
                if name != "literal":  # its price beside a radar hides the others'
                    sheet.draw_price(recording, line, task.threats, task.lambda_m4)
            sheet.draw_ends(recording, task.start_m, task.goal_m)
