"""`talkdown study`: a paper's experiment."""

from __future__ import annotations

import importlib
import json as text
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError
from gateway.cli.many import wide_console
from gateway.cli.progress import progressing
from sim.studies import STUDIES, Study

_LONGEST = 1000  # characters of a table's line

_HELP = """
Run a paper's experiment and show its table; the figures of most go into an .rrd for the viewer (conflicts, live-registration,
noise, sigmas and tuning only show tables). With their usual --runs many take minutes; fewer runs are quicker. Where numba is
installed (pip install 'talkdown[fast]') rmimm, consistency and tuning follow their draws with a compiled filter.

Example:

  talkdown study fusion --runs 200
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("study", help=_HELP)(study)


def study(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help=f"Which study: {', '.join(STUDIES)}.", show_default=False)
    ],
    runs: Annotated[int, typer.Option("--runs", metavar="N", min=1, help="How often each case is drawn.")] = 200,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of the random numbers.")] = 1,
    rrd: Annotated[
        Path | None,
        typer.Option("--rrd", metavar="FILE", help="Where the figures go. (default: NAME.rrd)", show_default=False),
    ] = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Run a paper's experiment."""
    if name not in STUDIES:
        raise UsageError(f"There is no study {name!r}; there are: {', '.join(STUDIES)}.")

    module = importlib.import_module(f"sim.studies.{name.replace('-', '_')}")
    batches = sys.modules.get("gateway.estimators.batch.tracks")  # of the studies that follow many draws in step
    if batches is not None and not batches.is_prepared() and not quiet:
        typer.echo("The filter is compiled first, once after an installation: half a minute or more.", err=True)
    with progressing(name, show=not quiet) as tell:
        found: Study = module.run(
            runs,
            seed,
            rrd=rrd or Path(f"{name}.rrd"),
            progress=lambda what, share: tell(share, what),
        )
    if json:
        print(text.dumps(_plain(asdict(found))))
    elif not quiet:
        _show(found)


def _show(found: Study) -> None:
    from rich.console import Console
    from rich.table import Table

    console = wide_console()
    for each in found.tables:
        table = Table(box=None, padding=(0, 2, 0, 0), title=each.title, title_justify="left")
        for place, heading in enumerate(each.columns):
            table.add_column(heading, justify="right" if place else "left")
        for row in each.rows:
            table.add_row(*(_cell(cell) for cell in row))
        least = table.__rich_measure__(console, console.options.update(width=_LONGEST)).minimum
        Console(highlight=False, width=max(console.width, least)).print(table)  # words that are cut cannot be read
        for note in each.notes:
            console.print(note, markup=False)
    if found.recording:
        console.print(f"figures: rerun {found.recording}", soft_wrap=True)


def _cell(value: str | float) -> str:
    if isinstance(value, str):
        return value
    return "-" if math.isnan(value) else f"{value:.2f}"


def _plain(value: Any) -> Any:
    """The same with null for NaN, which JSON does not know."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and math.isnan(value) else value
