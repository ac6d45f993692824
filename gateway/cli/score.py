"""`talkdown score`: every prediction of an archived session against what came."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.offline.score import Score

_HELP = """
Hold every prediction of an archived session against what came: the simulator's truth where the session has it, else the
track itself, later. By horizon: how far off, along and across, beside flying on at constant velocity, and how often it was
within one and two sigmas; 68 and 95 % are honest.

Example:

  talkdown score sessions/20260301T120000Z-demo-field
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("score", help=_HELP)(score)


def score(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="An archived session.", show_default=False)],
    json: take.JsonOption = False,
) -> None:
    """Hold predictions against what came."""
    from gateway.offline.score import joined, scores
    from gateway.runtime.folder import FolderError
    from gateway.runtime.foretold import errors_of
    from gateway.runtime.sessions import mend

    try:
        mend(session)
        parts, against = errors_of(session)
    except FolderError as error:
        raise UsageError(str(error)) from error
    except OSError as error:
        raise RunError(f"{session} could not be read: {(error.strerror or str(error)).lower()}.") from error
    found = scores(joined(parts))
    if json:
        import json as text

        print(text.dumps({"against": against, "scores": [_document(one) for one in found]}))
    elif not found:
        print("No prediction of this session has come to its time: nothing to score.")
    else:
        _show(found, against)


def _document(one: Score) -> dict[str, Any]:
    plain = asdict(one)
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in plain.items()}


def _show(found: list[Score], against: dict[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    errors = ("RMS m", "straight on m", "along m", "across m", "height m")
    columns = ("horizon s", "points", *errors, "along within 1, 2 sigma %", "across %")
    console, group = Console(highlight=False), ""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for place, heading in enumerate(("predictions", *columns)):
        table.add_column(heading, justify="right" if place else "left")
    for one in found:
        numbers = (one.rms_m, one.straight_on_rms_m, one.along_rms_m, one.across_rms_m, one.height_rms_m)
        name, group = ("" if one.group == group else one.group), one.group
        shares = [f"{100 * first:.0f}  {100 * second:.0f}" for first, second in (one.along_within, one.across_within)]
        cells = ["-" if math.isnan(value) else f"{value:.1f}" for value in numbers]
        table.add_row(name, f"{one.horizon_s:g}", str(one.count), *cells, *shares)
    console.print(table)
    for what, who in against.items():
        console.print(f"{what}: {who}", soft_wrap=True, markup=False)
