"""`talkdown sessions`: what is archived in a folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.runtime.sessions import Listed

_HELP = """
List the sessions that are archived in DIR. A session that was killed is completed first: its tables become Parquet.

Example:

  talkdown sessions sessions
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("sessions", help=_HELP)(sessions)


def sessions(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder that --archive was given.", show_default=False)
    ],
    json: take.JsonOption = False,
) -> None:
    """List what is archived."""
    from gateway.runtime.folder import FolderError
    from gateway.runtime.sessions import sessions as found

    try:
        listed = list(found(folder))
    except FolderError as error:
        raise UsageError(str(error)) from error
    except OSError as error:
        raise RunError(
            f"A session in {folder} could not be completed: {(error.strerror or str(error)).lower()}."
        ) from error
    if json:
        import json as text

        print(text.dumps([_document(one) for one in listed]))
    elif not listed:
        print(f"No sessions in {folder}.")
    else:
        _show(listed)


def _document(one: Listed) -> dict[str, Any]:
    record = one.record
    return {
        "folder": str(one.folder),
        "started_at": record.started_at,
        "watermark": record.watermark,
        "site_origin": record.site_origin,
        "sources": [source.name for source in record.sources],
        "ended": record.ended,
        "running": one.running,
        "size_bytes": one.size_bytes,
        "mended": one.mended,
    }


def _show(listed: list[Listed]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("session", "length", "sources", "size", "ended"):
        table.add_column(column, justify="right" if column in ("length", "size") else "left", overflow="fold")
    for one in listed:
        record = one.record
        length_s = 0.0 if record.watermark is None else (record.watermark - record.started_at) / 1e9
        ended = "running" if one.running else (record.ended or "") + (f" ({one.mended})" if one.mended else "")
        size = f"{one.size_bytes / 1e6:.1f} MB"
        table.add_row(one.folder.name, f"{length_s:.0f} s", str(len(record.sources)), size, ended)
    Console(highlight=False).print(table)
