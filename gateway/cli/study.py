"""`talkdown study`: a paper's experiment."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError

_HELP = """
Run a paper's experiment and show its table; its figures go into an .rrd for the viewer.

Example:

  talkdown study fusion --runs 200
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("study", help=_HELP)(study)


def studies() -> list[str]:
    """The names of the studies that there are."""
    found = importlib.util.find_spec("sim.studies")
    folders = list(found.submodule_search_locations or []) if found else []
    return sorted(
        path.stem for folder in folders for path in Path(folder).glob("*.py") if not path.stem.startswith("_")
    )


def study(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Which study, such as fusion.", show_default=False)],
    runs: Annotated[int, typer.Option("--runs", metavar="N", min=1, help="How often each case is drawn.")] = 200,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of the random numbers.")] = 1,
    rrd: Annotated[
        Path | None,
        typer.Option("--rrd", metavar="FILE", help="Where the figures go. [default: NAME.rrd]", show_default=False),
    ] = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Run a paper's experiment."""
    if name not in studies():
        raise UsageError(f"There is no study {name!r}; there are: {', '.join(studies()) or 'none'}.")
    module = importlib.import_module(f"sim.studies.{name}")
    module.run(runs, seed, rrd=rrd or Path(f"{name}.rrd"), quiet=quiet, json=json)
