"""`talkdown report`: the approaches of archived sessions, judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError, reading, writing
from gateway.cli.many import Crew, SessionsArgument, failures, names_of, sessions_of, tell_failures, wide_console
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.offline.report import Approach
    from gateway.runtime.approaches import Reported
    from gateway.runtime.many import Outcome
    from gateway.sinks.report_index import Entry, Graded

_HELP = """
Judge the approaches of archived sessions: deviations from glide path and centreline with ICAO Annex 10's limits, the gates of
a stabilised approach, touchdown, what each source saw, accuracy against the truth where there is one, and a grade with its
reasons. --html writes one file that needs nothing else and prints well; of many sessions a folder of them, with an index.

Examples:

  talkdown report sessions/20260301T120000Z-demo-field --html report.html

  talkdown report sessions/20260301T120000Z-demo-field --json

  talkdown report sessions --html reports
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report", help=_HELP)(spread(report))


def report(
    sessions: SessionsArgument,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            metavar="FILE|DIR",
            help="Write the approaches with their plots; of many sessions into this folder.",
            show_default=False,
        ),
    ] = None,
    crew: Crew = Crew(),
    telling: take.Telling = take.Telling(),
) -> None:
    """Judge approaches."""
    many = sessions_of(sessions, crew)
    if many is not None:
        _report_many(many, html, crew, telling)
        return
    found = _found(sessions[0])
    if html is not None:
        _write(html, _page(found))
    if telling.json:
        import json as text

        from gateway.runtime.approaches import document

        print(text.dumps(document(found)))
    elif not telling.quiet:
        for number, one in enumerate(found.approaches, 1):
            _show(number, one)
        if not found.approaches:
            print("Nobody was on final long enough: no approach to report.")
        if html is not None:
            print(f"written: {html}")


def _found(session: Path) -> Reported:
    """The approaches of one session, completed first if it was killed. Raises UsageError, RunError."""
    from gateway.runtime.approaches import approaches_of
    from gateway.runtime.sessions import mend

    with reading(session):
        mend(session)
        return approaches_of(session)


def _page(found: Reported) -> str:
    from gateway.sinks.report import page

    name = found.folder.resolve().name
    return page(name, found.site, found.record.summary, found.record.registered, found.approaches)


def _write(path: Path, text: str) -> None:
    with writing(path):
        path.write_text(text, encoding="utf-8")


def _show(number: int, one: Approach) -> None:
    print(f"{number}. {one.aircraft}: {one.grade}")
    for reason in one.reasons:
        print(f"   {reason}")
    for who, seen in (("track", one.touchdown), ("truth", one.true_touchdown)):
        if seen is not None:
            print(
                f"   touchdown by the {who}: {seen.past_threshold_m:.0f} m past the threshold, {seen.left_m:+.1f} m left,"
                f" {seen.speed_mps:.1f} m/s, sinking {seen.sink_mps:.2f} m/s"
            )


def report_one(thing: tuple[Path, Path | None], as_json: bool) -> tuple[str, tuple[Graded, ...], dict[str, Any] | None]:
    """The unit of work on many: (session, page to write or None) -> its site, its approaches, and with `as_json` all of them."""
    from gateway.runtime.approaches import document
    from gateway.sinks.report_index import graded

    session, page = thing
    found = _found(session)
    if page is not None:
        _write(page, _page(found))
    return found.site.name, tuple(map(graded, found.approaches)), document(found) if as_json else None


def _report_many(sessions: list[Path], html: Path | None, crew: Crew, telling: take.Telling) -> None:
    names = names_of(sessions)
    pages: list[Path | None] = [None] * len(sessions)
    if html is not None:
        pages = [html.absolute() / f"{name}.html" for name in names]
        _make(html)
    things = list(zip(sessions, pages, strict=True))
    outcomes = crew.work_on(partial(report_one, as_json=telling.json), things, "reporting", show=not telling.quiet)
    entries = _entries(names, outcomes)
    if html is not None:
        from gateway.sinks.report_index import index

        _write(html / "index.html", index(_title(sessions), entries))
    failed = failures(sessions, outcomes)
    if telling.json:
        import json as text

        documents = [one.result[2] for one in outcomes if one.result is not None]
        print(text.dumps({"sessions": documents, "failed": failed}))
    elif not telling.quiet:
        _show_entries(entries)
        if html is not None:
            print(f"written: {html / 'index.html'}")
    tell_failures(failed, len(sessions))


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{folder} is no folder: of many sessions --html names one, a page each goes there."
        ) from error


def _title(sessions: Sequence[Path]) -> str:
    parents = {one.resolve().parent for one in sessions}
    return parents.pop().name if len(parents) == 1 else f"{len(parents)} archives"


def _entries(
    names: Sequence[str], outcomes: Sequence[Outcome[tuple[str, tuple[Graded, ...], dict[str, Any] | None]]]
) -> list[Entry]:
    from gateway.sinks.report_index import Entry

    return [
        Entry(name, f"{name}.html", failure=outcome.failure)
        if outcome.result is None
        else Entry(name, f"{name}.html", outcome.result[0], outcome.result[1])
        for name, outcome in zip(names, outcomes, strict=True)
    ]


def _show_entries(entries: Sequence[Entry]) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in ("session", "aircraft", "grade", "reasons"):
        table.add_column(column, overflow="fold", no_wrap=column != "reasons")
    for entry in entries:
        for place, one in enumerate(entry.approaches):
            table.add_row("" if place else entry.name, one.aircraft, one.grade, "; ".join(one.reasons))
    console = wide_console()
    if table.row_count:
        console.print(table)
    counts = Counter(one.grade for entry in entries for one in entry.approaches)
    grades = ", ".join(f"{grade} {count}" for grade, count in sorted(counts.items())) or "none"
    read = [entry for entry in entries if entry.failure is None]
    nobody = sum(not entry.approaches for entry in read)
    console.print(f"approaches: {grades}; of {len(read)} sessions {nobody} without one", soft_wrap=True, markup=False)
