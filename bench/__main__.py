"""`make bench`: measures and prints a table; `--json FILE` keeps every sample."""

from __future__ import annotations

import json
import tempfile
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from bench.archive import SECONDS, archive, listing
from bench.clutter import clutter
from bench.estimation import estimation
from bench.foretelling import foretelling
from bench.hundred_hours import HEADINGS, hundred_hours
from bench.live_fleet import live_fleet
from bench.live_rates import live_rates
from bench.lively import core_share, lateness
from bench.measure import Figure, load, machine
from bench.probing import probing
from bench.reckoning import reckoning
from bench.registration import registration
from bench.replays import help_text, ten_hours, ten_minutes
from bench.throughput import throughput
from bench.vehicles import vehicles
from bench.wires import wires

FLEETS = (1, 30)
THROUGHPUT_S = 120.0
RATES_S = 60.0
ARCHIVED = 40  # sessions; `python -m bench.archive --sessions 200` by itself
TRAFFIC_HOURS, MANY_TRAFFIC_HOURS = (
    20,
    100,
)  # with aircraft in the first 50 minutes of every two hours, and in 8.8 of every ten


class Part(StrEnum):
    """What can be measured alone."""

    replay = "replay"
    help = "help"
    live = "live"
    late = "late"
    rates = "rates"
    pipeline = "pipeline"
    wires = "wires"
    estimation = "estimation"
    clutter = "clutter"
    registration = "registration"
    foretelling = "foretelling"
    reckoning = "reckoning"
    probing = "probing"
    fleet = "fleet"
    vehicles = "vehicles"
    memory = "memory"
    hours = "hours"
    archive = "archive"


def bench(
    runs: Annotated[int, typer.Option("--runs", metavar="N", min=1, help="How often what is short is measured.")] = 5,
    seconds: Annotated[float, typer.Option("--seconds", metavar="S", min=5.0, help="How long live runs last.")] = 30.0,
    long: Annotated[
        bool, typer.Option("--long", help="Also ten hours, a hundred of traffic, and forty sessions.")
    ] = False,
    only: Annotated[list[Part] | None, typer.Option("--only", help="Only this; repeatable.")] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write every sample there.", show_default=False)
    ] = None,
) -> None:
    """Measure what Talkdown costs on this machine. Best on a quiet one: figures are medians, ranges stand beside them."""
    wanted = set(only or Part) - (set() if long or only else {Part.hours, Part.archive})
    console = Console(width=max(Console().width, 110))
    console.print(f"{machine()}; {load()}")
    figures = _measure(wanted, runs, seconds, MANY_TRAFFIC_HOURS if long else TRAFFIC_HOURS, Console(stderr=True))
    console.print(_table(figures))
    console.print(load())
    if json_file is not None:
        document = {"machine": machine(), "figures": [figure.document() for figure in figures]}
        json_file.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if any(figure.holds is False for figure in figures):
        raise typer.Exit(1)


def _measure(wanted: set[Part], runs: int, seconds: float, traffic_hours: int, console: Console) -> list[Figure]:
    def say(text: str) -> None:
        console.print(text, style="dim", highlight=False)

    figures: list[Figure] = []
    with tempfile.TemporaryDirectory(prefix="talkdown-bench-") as name:
        folder = Path(name)
        if Part.help in wanted:
            figures += help_text(runs)
        if Part.replay in wanted:
            figures += ten_minutes(folder, runs, say)
        if Part.live in wanted:
            say("one aircraft, live")
            figures += core_share(folder, seconds)
        if Part.late in wanted:
            say("late reports, live")
            figures += lateness(seconds)
        if Part.rates in wanted:
            say("50 000 messages/s and 100 vehicles, live")
            figures += live_rates(RATES_S)
        for aircraft in FLEETS if Part.pipeline in wanted else ():
            say(f"the pipeline with {aircraft} aircraft")
            figures += throughput(aircraft, THROUGHPUT_S, min(runs, 3))
        if Part.wires in wanted:
            say("a million MAVLink messages, beside pymavlink and mavlogfile")
            figures += wires(min(runs, 3))
        if Part.estimation in wanted:
            say("interacting models: ours, a textbook's loop and other libraries'")
            figures += estimation(runs, say)
        if Part.clutter in wanted:
            say("targets in clutter: ours and Stone Soup's trackers")
            figures += clutter(runs, say)
        if Part.vehicles in wanted:
            say("simulated vehicles")
            figures += vehicles(min(runs, 3))
        if Part.registration in wanted:
            say("10 000 pairs of registration, and 1000 a second")
            figures += registration(min(runs, 5))
        if Part.foretelling in wanted:
            say("predictions of 1000 aircraft that have told their plans")
            figures += foretelling(2 * runs)
        if Part.probing in wanted:
            say("the conflict probe of 1000 aircraft")
            figures += probing(2 * runs)
        if Part.reckoning in wanted:
            say("dead reckoning of one vehicle, and of a hundred")
            figures += reckoning(runs)
        if Part.fleet in wanted:
            say("100 vehicles with two radars, and 1000 aircraft, live")
            figures += live_fleet(RATES_S)
        if Part.memory in wanted:
            say(f"what is held after {traffic_hours} hours of traffic that comes and goes\n{HEADINGS}")
            figures += hundred_hours(say, traffic_hours)
        if Part.archive in wanted:
            figures += archive(folder, ARCHIVED, SECONDS, say) + listing(folder, min(runs, 3))
        if Part.hours in wanted:
            figures += ten_hours(folder, say)
    return figures


def _table(figures: list[Figure]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("", "median", "lowest", "highest", "target", ""):
        table.add_column(column, justify="left" if not column else "right", no_wrap=True)
    for figure in figures:
        verdict = {None: "", True: "[green]holds[/]", False: "[red]missed[/]"}[figure.holds]
        spread = (min(figure.samples), max(figure.samples)) if len(figure.samples) > 1 else ()
        table.add_row(
            figure.name,
            f"{_digits(figure.median)} {figure.unit}",
            *([_digits(one) for one in spread] or ["", ""]),
            figure.target,
            verdict,
        )
    return table


def _digits(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.1f}" if value >= 10 else f"{value:.2f}"


if __name__ == "__main__":
    typer.run(bench)
