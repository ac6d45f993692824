"""`talkdown score`: every prediction of archived sessions against what came."""

from __future__ import annotations

import json as text
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import reading
from gateway.cli.many import Crew, SessionsArgument, failures, names_of, sessions_of, tell_failures, wide_console
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.offline.score import Score

_HELP = """
Hold every prediction of archived sessions against what came: the simulator's truth where the session has it, else the
track itself, later. By horizon: how far off, along and across, beside flying on at constant velocity, and how often it was
within one and two sigmas; 68 and 95 % are honest. Of many sessions a row each, and all of them together.

Examples:

  talkdown score sessions/20260301T120000Z-demo-field

  talkdown score sessions --json
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("score", help=_HELP)(spread(score))


@dataclass(frozen=True, slots=True)
class Scored:
    """The scores of one session, and which predictions were held against what."""

    rows: list[Score]
    against: dict[str, str]

    def document(self) -> dict[str, Any]:
        """The same as plain values for JSON."""
        return {"against": self.against, "scores": list(map(_document, self.rows))}


def score(sessions: SessionsArgument, crew: Crew = Crew(), telling: take.Telling = take.Telling()) -> None:
    """Hold predictions against what came."""
    many = sessions_of(sessions, crew)
    if many is not None:
        _score_many(many, crew, telling)
        return
    found = score_one(sessions[0])
    if telling.json:
        print(text.dumps(found.document()))
    elif telling.quiet:
        return
    elif not found.rows:
        print("No prediction of this session has come to its time: nothing to score.")
    else:
        _show(found.rows, found.against)


def score_one(session: Path) -> Scored:
    """The scores of one session, completed first if it was killed. Raises UsageError, RunError."""
    from gateway.offline.score import joined, scores
    from gateway.runtime.foretold import errors_of
    from gateway.runtime.sessions import mend

    with reading(session):
        mend(session)
        parts, against = errors_of(session)
    return Scored(scores(joined(parts)), against)


def _score_many(sessions: Sequence[Path], crew: Crew, telling: take.Telling) -> None:
    from gateway.offline.pooled import pooled

    outcomes = crew.work_on(score_one, sessions, "scoring", show=not telling.quiet)
    pairs = zip(sessions, outcomes, strict=True)
    scored = {session: one.result for session, one in pairs if one.result is not None}
    together = pooled(one.rows for one in scored.values())
    failed = failures(sessions, outcomes)
    if telling.json:
        documents = [{"session": str(session), **one.document()} for session, one in scored.items()]
        pool = list(map(_document, together))
        print(text.dumps({"sessions": documents, "pooled": pool, "failed": failed}))
    elif together and not telling.quiet:
        _show_each(names_of(list(scored)), [one.rows for one in scored.values()], together)
        _show(together, {})
    tell_failures(failed, len(sessions))


def _document(one: Score) -> dict[str, Any]:
    plain = asdict(one)
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in plain.items()}


def _show(found: Sequence[Score], against: dict[str, str]) -> None:
    from rich.table import Table

    errors = ("RMS m", "straight on m", "along m", "across m", "height m")
    columns = ("horizon s", "points", *errors, "along within 1, 2 sigma %", "across %")
    console, group = wide_console(), ""
    table = Table(box=None, padding=(0, 2, 0, 0))
    for place, heading in enumerate(("predictions", *columns)):
        table.add_column(heading, justify="right" if place else "left")
    for one in found:
        numbers = (one.rms_m, one.straight_on_rms_m, one.along_rms_m, one.across_rms_m, one.height_rms_m)
        name, group = ("" if one.group == group else one.group), one.group
        shares = [_share(one.along_within, one.along_independent), _share(one.across_within, one.across_independent)]
        cells = ["-" if math.isnan(value) else f"{value:.1f}" for value in numbers]
        table.add_row(name, f"{one.horizon_s:g}", str(one.count), *cells, *shares)
    console.print(table)
    console.print(_HONEST, soft_wrap=True, markup=False)
    for what, who in against.items():
        console.print(f"{what}: {who}", soft_wrap=True, markup=False)


_HONEST = (
    "68 and 95 % are honest. ± is one standard error of 68 % found in so many predictions as differ from each other: "
    "those a second apart are nearly the same."
)


def _share(within: tuple[float, float], independent: float) -> str:
    """Of those within one sigma how far an honest share may be off by chance, and those within two."""
    from gateway.offline.score import standard_error

    return f"{100 * within[0]:.0f} ±{100 * standard_error(0.68, independent):.0f}  {100 * within[1]:.0f}"


def _show_each(names: Sequence[str], sessions: Sequence[Sequence[Score]], together: Sequence[Score]) -> None:
    """A row a session: of all its predictions the RMS by horizon, beside that of constant velocity."""
    from rich.table import Table

    whole = together[:1]
    horizons = [one.horizon_s for one in together if whole and one.group == whole[0].group]
    table = Table(box=None, padding=(0, 2, 0, 0), caption="RMS m, and of constant velocity", caption_justify="left")
    table.add_column("session", no_wrap=True, overflow="fold")
    table.add_column("points", justify="right")
    for horizon_s in horizons:
        table.add_column(f"{horizon_s:g} s", justify="right", no_wrap=True)
    for name, rows in zip(names, sessions, strict=True):
        by_horizon = {one.horizon_s: one for one in rows if one.group == whole[0].group} if whole else {}
        cells = [
            f"{by_horizon[one].rms_m:.1f} / {by_horizon[one].straight_on_rms_m:.1f}" if one in by_horizon else "-"
            for one in horizons
        ]
        table.add_row(name, str(sum(one.count for one in by_horizon.values())), *cells)
    wide_console().print(table)
