"""`talkdown declare`: tell a running gateway where an aircraft goes, or where weather is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

_HELP = """
Tell a `talkdown live` on this machine where an aircraft goes: what is declared beats what its plan says and what is inferred,
as long as it is flown. With --withdraw that ends. It is recorded with the session, and a replay does the same.

A point is a [\\[waypoint]] of the site, [bold]runway[/], [bold]go-around[/], [bold]home[/], the number of an item of its plan,
or LATITUDE,LONGITUDE[,ALTITUDE] in degrees and metres above mean sea level.

Examples:

  talkdown declare --aircraft mavlink:1 --to IAF

  talkdown declare --aircraft mavlink:1 --to 31.02,103.8,900

  talkdown declare --aircraft mavlink:1 --withdraw

  talkdown declare --file weather.toml
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("declare", help=_HELP)(declare)


def declare(
    aircraft: Annotated[
        str | None, typer.Option("--aircraft", metavar="NAME", help="Which, such as mavlink:1.", show_default=False)
    ] = None,
    to: Annotated[str | None, typer.Option("--to", metavar="POINT", help="Where it goes.", show_default=False)] = None,
    withdraw: Annotated[bool, typer.Option("--withdraw", help="What was declared of it holds no more.")] = False,
    file: Annotated[
        Path | None,
        typer.Option(
            "--file",
            metavar="FILE",
            help="All that a file declares, [\\[declared]] and [\\[weather]].",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            "--port",
            metavar="N",
            min=1,
            max=65535,
            help="As `talkdown live` prints. (default: 30071)",
            show_default=False,
        ),
    ] = None,
    session: Annotated[
        Path | None,
        typer.Option(
            "--session", metavar="DIR", help="The running session's folder, which knows it.", show_default=False
        ),
    ] = None,
    quiet: take.QuietOption = False,
) -> None:
    """Tell a running gateway."""
    from gateway.runtime.declaring import DECLARE_PORT
    from gateway.runtime.declaring import declare as told
    from gateway.runtime.urls import LinkError

    if port is not None and session is not None:
        raise UsageError("Give --port or --session, not both: the session's folder knows its port.")
    lines = _lines(aircraft, to, withdraw, file)
    number = _port_of(session) if session is not None else port or DECLARE_PORT
    for line in lines:
        try:
            ok, said = told(line, number)
        except LinkError as error:
            raise RunError(str(error)) from error
        if not ok:
            raise RunError(said)
        if not quiet:
            print(said)


def _lines(aircraft: str | None, to: str | None, withdraw: bool, file: Path | None) -> list[bytes]:
    from adapters.declared import Goal, encode_intent
    from gateway.runtime.declarable import goal_of

    if file is not None:
        if aircraft is not None or to is not None or withdraw:
            raise UsageError("Give --file alone; it says which aircraft go where.")
        return _in_file(file)
    if aircraft is None or (to is None) == (not withdraw):
        raise UsageError(
            "Say which aircraft goes where: --aircraft mavlink:1 --to IAF; or --aircraft mavlink:1 --withdraw."
        )
    found = Goal() if to is None else goal_of(to)
    if isinstance(found, str):
        raise UsageError(found)
    return [encode_intent(aircraft, found)]


def _in_file(file: Path) -> list[bytes]:
    from gateway.runtime.declarable import lines_of
    from gateway.settings import SiteError
    from gateway.settings.declared import parse_declared

    try:
        return lines_of(parse_declared(file.read_text(encoding="utf-8"), str(file)))
    except SiteError as error:
        raise UsageError(str(error)) from error
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{file} cannot be read.") from error


def _port_of(session: Path) -> int:
    from gateway.runtime.declaring import PORT_FILE

    try:
        return int(json.loads((session / PORT_FILE).read_text(encoding="utf-8"))["port"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(f"{session} is no session that runs: it has no {PORT_FILE}.") from error
