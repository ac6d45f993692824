"""`talkdown sessions`: what is archived in a folder: found, mended, compacted and pruned."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from adapters.reasons import reason_of
from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
from gateway.cli.many import Crew, failures, tell_failures, wide_console
from gateway.cli.session_filters import Filters, read_length
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.runtime.listing import Listed

_HELP = """
List the sessions that are archived in DIR: when, where, who, how long, how large, how they ended, and what is wrong with them.
A session that was killed is completed first: its tables become Parquet. Options choose among them; all that is given holds.

--repair mends what is broken, from the recorded inputs. --compact rewrites drawings that were never put in order, with Rerun's
own tools. --keep 30d removes those that are older; it asks first. All three do so among the sessions that are listed.

Examples:

  talkdown sessions sessions --since 7d --vehicle mavlink:1

  talkdown sessions sessions --broken --repair

  talkdown sessions sessions --site "Demo field" --keep 30d --dry-run
"""
_NAMED = 3  # vehicles in a row of the table


@dataclass(frozen=True, slots=True)
class Order:
    """What is done to the sessions that are listed."""

    repair: Annotated[bool, typer.Option("--repair", help="Mend those that are broken.")] = False
    compact: Annotated[
        bool, typer.Option("--compact", help="Rewrite drawings without an index, smaller, with Rerun's tools.")
    ] = False
    keep: Annotated[
        str | None,
        typer.Option("--keep", metavar="AGE", help="Remove those older than 30d, 12h, 1y.", show_default=False),
    ] = None
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Remove without asking.")] = False
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only tell what --keep would remove.")] = False


@dataclass(slots=True)
class Row:
    """A session and what was done to it."""

    session: Listed
    done: list[str] = field(default_factory=list)
    was_bytes: int | None = None  # before it was compacted
    is_old: bool = False
    removed: bool = False


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("sessions", help=_HELP)(spread(sessions))


def sessions(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder that --archive was given.", show_default=False)
    ],
    filters: Filters = Filters(),
    order: Order = Order(),
    crew: Crew = Crew(),
    telling: take.Telling = take.Telling(),
) -> None:
    """List what is archived."""
    from gateway.cli.progress import progressing
    from gateway.runtime.folder import FolderError
    from gateway.runtime.listing import listed

    now = datetime.now(UTC)
    parent = folder if crew.scheduler is None else folder.absolute()
    oldest_s = None if order.keep is None else now.timestamp() - read_length(order.keep, "--keep")
    try:
        with progressing("reading", show=not telling.quiet) as tell:
            rows = [Row(one) for one in filters.chosen(listed(parent, tell), now)]
    except FolderError as error:
        raise UsageError(str(error)) from error
    failed = _repair(rows, crew, telling) if order.repair else []
    failed += _compact(rows, crew, telling) if order.compact else []
    failed += _prune(rows, round(oldest_s * 1e9), order, telling) if oldest_s is not None else []
    if telling.json:
        import json

        print(json.dumps([_document(row) for row in rows]))
    elif not telling.quiet:
        _show(rows, folder)
    tell_failures(failed, len(rows))


def repair_one(session: Listed) -> Listed:
    """The unit of work of --repair. Raises RunError."""
    from gateway.runtime.folder import FolderError
    from gateway.runtime.repairing import repair

    try:
        mended = repair(session)
    except FolderError as error:
        raise RunError(str(error)) from error
    except OSError as error:
        raise RunError(f"{session.folder}: {reason_of(error)}.") from error
    if mended.faults:
        raise RunError(
            f"{session.folder}: {'; '.join(fault.what for fault in mended.faults)}; it cannot be made again."
        )
    return mended


def compact_one(session: Listed) -> Listed | None:
    """The unit of work of --compact: the session as it is afterwards, None where there was nothing to do. Raises RunError."""
    from gateway.runtime.listing import look
    from gateway.runtime.outputs import RRD_FILE
    from gateway.sinks.hold import is_held
    from gateway.sinks.recording import compact

    path = session.folder / RRD_FILE
    try:
        if session.running or not path.exists() or is_held(path, path):
            return None
        done = compact(path)
    except OSError as error:
        raise RunError(f"{path}: {reason_of(error)}.") from error
    if done is False:
        raise RunError(
            f"{path} could not be compacted: Rerun cannot make sense of it, or the disk is full; it is as it was."
        )
    return look(session.folder) if done else None


def _repair(rows: Sequence[Row], crew: Crew, telling: take.Telling) -> list[dict[str, str]]:
    broken = [row for row in rows if row.session.faults]
    if not broken:
        return []
    outcomes = crew.work_on(repair_one, [row.session for row in broken], "mending", show=not telling.quiet)
    for row, outcome in zip(broken, outcomes, strict=True):
        if outcome.result is not None:
            row.session = outcome.result
    return failures([row.session.folder for row in broken], outcomes)


def _compact(rows: Sequence[Row], crew: Crew, telling: take.Telling) -> list[dict[str, str]]:
    if not rows:
        return []
    outcomes = crew.work_on(compact_one, [row.session for row in rows], "compacting", show=not telling.quiet)
    for row, outcome in zip(rows, outcomes, strict=True):
        if outcome.result is not None:
            row.was_bytes = row.session.size_bytes
            row.done.append(f"compacted, {_size(row.was_bytes)} before")
            row.session = replace(outcome.result, mended=row.session.mended)
    return failures([row.session.folder for row in rows], outcomes)


def _prune(rows: Sequence[Row], oldest: int, order: Order, telling: take.Telling) -> list[dict[str, str]]:
    from gateway.runtime.folder import FolderError
    from gateway.runtime.pruning import is_older, remove

    old = [row for row in rows if is_older(row.session, oldest)]
    size = _size(sum(row.session.size_bytes for row in old))
    for row in old:
        row.is_old = True
    if order.dry_run or not old:
        _tell(f"{len(old)} of {len(rows)} sessions are older than {order.keep}: {size}.", telling)
        return []
    if not order.yes:
        if telling.json or not sys.stdin.isatty():
            raise UsageError(f"--keep would remove {len(old)} sessions, {size}: say --yes, or --dry-run to see which.")
        if not typer.confirm(f"Remove {len(old)} sessions older than {order.keep}, {size}?", err=True):
            return []
    failed: list[dict[str, str]] = []
    for row in old:
        try:
            remove(row.session.folder)
            row.removed = True
        except FolderError as error:
            failed.append({"session": str(row.session.folder), "reason": str(error)})
        except OSError as error:
            told = f"could not be removed: {reason_of(error)}."
            failed.append({"session": str(row.session.folder), "reason": told})
    freed = [row.session.size_bytes for row in old if row.removed]
    _tell(f"{len(freed)} sessions removed, {_size(sum(freed))} freed.", telling)
    return failed


def _tell(sentence: str, telling: take.Telling) -> None:
    if not telling.quiet:
        print(sentence, file=sys.stderr)


def _document(row: Row) -> dict[str, Any]:
    one = row.session
    record = one.record
    return {
        "folder": str(one.folder),
        "started_at": one.started_at,
        "watermark": None if record is None else record.watermark,
        "site": one.site,
        "site_origin": "" if record is None else record.site_origin,
        "vehicles": list(one.vehicles),
        "sources": [] if record is None else [source.name for source in record.sources],
        "length_s": one.length_s,
        "ended": None if one.running else one.ended,
        "running": one.running,
        "size_bytes": one.size_bytes,
        "wrong": [fault.what for fault in one.faults],
        "mended": one.mended,
        "compacted_from_bytes": row.was_bytes,
        "old": row.is_old,
        "removed": row.removed,
    }


def _show(rows: Sequence[Row], folder: Path) -> None:
    from rich.table import Table

    if not rows:
        print(f"No sessions in {folder}.")
        return
    columns: dict[str, Callable[[Row], str]] = {
        "session": lambda row: row.session.folder.name,
        "begun, UTC": lambda row: f"{datetime.fromtimestamp(row.session.started_at / 1e9, UTC):%Y-%m-%d %H:%M}",
        "site": lambda row: row.session.site,
        "vehicles": lambda row: _vehicles(row.session.vehicles),
        "length": lambda row: "" if row.session.length_s is None else _length(row.session.length_s),
        "size": lambda row: _size(row.session.size_bytes),
        "ended": lambda row: row.session.ended,
        "": _note,
    }
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        right = column in ("length", "size")
        whole = column not in ("", "vehicles", "ended", "site")
        table.add_column(column, justify="right" if right else "left", overflow="fold", no_wrap=whole)
    for row in rows:
        table.add_row(*(cell(row) for cell in columns.values()))
    console = wide_console()
    console.print(table, markup=False)
    left = [row.session for row in rows if not row.removed]
    broken = sum(bool(one.faults) for one in left)
    more = f"; {broken} broken, --repair mends what can be" if broken else ""
    size = _size(sum(one.size_bytes for one in left))
    console.print(f"{len(left)} sessions, {size}{more}", soft_wrap=True, markup=False)


def _note(row: Row) -> str:
    notes = (
        [fault.what for fault in row.session.faults] + ([row.session.mended] if row.session.mended else []) + row.done
    )
    if row.is_old:
        notes.append("removed" if row.removed else "old")
    return "; ".join(notes)


def _vehicles(names: Sequence[str]) -> str:
    if len(names) <= _NAMED:
        return ", ".join(names)
    return f"{len(names)}: {', '.join(names[: _NAMED - 1])}, …"


def _length(length_s: float) -> str:
    minutes, seconds = divmod(round(length_s), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"


def _size(size: int) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.1f} MB"
