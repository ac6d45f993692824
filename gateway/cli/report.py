"""`talkdown report`: the approaches of an archived session, judged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.offline.report import Approach
    from gateway.runtime.approaches import Reported

_HELP = """
Judge the approaches of an archived session: deviations from glide path and centreline with ICAO Annex 10's limits, the gates of
a stabilised approach, touchdown, what each source saw, accuracy against the truth where there is one, and a grade with its
reasons. --html writes one file that needs nothing else and prints well.

Examples:

  talkdown report sessions/20260301T120000Z-demo-field --html report.html

  talkdown report sessions/20260301T120000Z-demo-field --json
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("report", help=_HELP)(report)


def report(
    session: Annotated[Path, typer.Argument(metavar="SESSION", help="An archived session.", show_default=False)],
    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", help="Write the approaches with their plots.", show_default=False),
    ] = None,
    json: take.JsonOption = False,
) -> None:
    """Judge approaches."""
    from gateway.runtime.approaches import approaches_of, document
    from gateway.runtime.folder import FolderError
    from gateway.runtime.sessions import mend

    try:
        mend(session)
        found = approaches_of(session)
    except FolderError as error:
        raise UsageError(str(error)) from error
    except OSError as error:
        raise RunError(f"{session} could not be read: {(error.strerror or str(error)).lower()}.") from error
    if html is not None:
        _write(html, found)
    if json:
        import json as text

        print(text.dumps(document(found)))
        return
    for number, one in enumerate(found.approaches, 1):
        _show(number, one)
    if not found.approaches:
        print("Nobody was on final long enough: no approach to report.")
    if html is not None:
        print(f"written: {html}")


def _write(path: Path, found: Reported) -> None:
    from gateway.sinks.report import page

    text = page(
        found.folder.resolve().name, found.site, found.record.summary, found.record.registered, found.approaches
    )
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunError(f"{path} could not be written: {(error.strerror or str(error)).lower()}.") from error


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
