"""`talkdown columns`: the messages of a recording as Parquet tables."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError, writing

_HELP = """
Write the messages of a .tlog as Parquet tables, one file a kind of message, to be read by pandas, Polars, DuckDB and the
like. Every checksum is checked; columns carry the message's own names and units.

Examples:

  talkdown columns flight.tlog --out flight-columns

  talkdown columns flight.tlog --out positions --message GLOBAL_POSITION_INT --message GPS_RAW_INT
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("columns", help=_HELP)(columns)


def columns(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .tlog.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the tables go; made if it is not there.")],
    message: Annotated[
        list[str] | None,
        typer.Option("--message", metavar="NAME", help="Only this kind of message; repeatable.", show_default=False),
    ] = None,
    quiet: take.QuietOption = False,
) -> None:
    """Write the messages of a .tlog as Parquet tables."""
    from adapters.files import FileError, kind_of
    from gateway.cli.progress import progressing
    from gateway.runtime.tables import write_tables

    counters: Counter[str] = Counter()
    try:
        if (kind := kind_of(file)) != "tlog":
            raise UsageError(
                f"{file} is a .{kind}, and columns reads .tlog files: a session's are in its folder inputs."
            )
        with writing(out), progressing("writing tables", show=not quiet) as tell:
            out.mkdir(parents=True, exist_ok=True)
            rows = write_tables(file, out, message, counters=counters, tell=tell)
    except FileError as error:
        raise UsageError(str(error)) from error
    except KeyError as error:
        raise UsageError(
            f"There is no MAVLink message {error.args[0]!r}; names are written as GLOBAL_POSITION_INT."
        ) from error
    if not quiet:
        for name, number in rows.items():
            print(f"{number:>10} {name}")
        for reason, number in sorted(counters.items()):
            print(f"{number:>10} {reason}")
        print(f"{len(rows)} tables in {out}" if rows else f"{file} holds none of these messages; no table was written.")
