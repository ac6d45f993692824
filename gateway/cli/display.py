"""What a person at the terminal sees of a session: events as they come, how far it is, the summary at the end."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from gateway.cli.viewing import Viewing

if TYPE_CHECKING:
    from gateway.picture import Picture
    from gateway.runtime.muted import MutedScore
    from gateway.runtime.run import Run
    from gateway.runtime.summary import SmoothedSummary, Summary

_REFRESH_S = 0.2
_WAITING_SAID_AFTER_S = 3.0  # by then most streams have told where they are
_STYLES = {"info": "dim", "warning": "yellow", "error": "bold red"}


class Display:
    """Watches a run: a context around it, and the `watch` that the loop calls."""

    def __init__(
        self,
        viewing: Viewing,
        *,
        quiet: bool = False,
        as_json: bool = False,
        fraction: Callable[[], float] | None = None,
    ) -> None:
        self._viewing = viewing
        self._quiet, self._as_json, self._fraction = quiet, as_json, fraction
        self._console = Console(stderr=True, quiet=quiet, highlight=False)
        bar = [BarColumn(bar_width=30)] if fraction else []
        self._progress = Progress(
            TimeElapsedColumn(), *bar, TextColumn("{task.description}"), console=self._console, transient=True,
            refresh_per_second=5, disable=quiet or not self._console.is_terminal,
        )  # fmt: skip
        self._task: TaskID | None = None
        self._due = 0.0
        self._waiting_said = False

    def __enter__(self) -> Self:
        self._progress.start()
        self._task = self._progress.add_task("waiting for the first message", total=1.0 if self._fraction else None)
        return self

    def __exit__(self, *left: object) -> None:
        self._progress.stop()

    def say(self, text: str, style: str = "") -> None:
        """One line for the person, above the progress."""
        self._console.print(text, style=style, markup=False, soft_wrap=True)

    def watch(self, run: Run, picture: Picture | None) -> None:
        """Show what a step brought."""
        if run.place is None and run.heard_for_s > _WAITING_SAID_AFTER_S and not self._waiting_said:
            self._waiting_said = True
            self.say(
                "Without a site file the picture begins once an aircraft tells its home or a landing in its mission, or "
                "stands still; after a minute its first position must do. --site FILE begins at once."
            )
        if run.outputs is not None and (told := self._viewing.open(run.outputs.address)) is not None:
            self.say(told)
        if picture is not None:
            for event in picture.events:
                self.say(event.text, _STYLES.get(event.level, ""))
        now = time.monotonic()
        if now >= self._due and self._task is not None:
            self._due = now + _REFRESH_S
            completed = self._fraction() if self._fraction else None
            self._progress.update(self._task, description=_line(run, picture), completed=completed)

    def smoothing(self, share: float) -> None:
        """Show how far the smoothing at the end is."""
        now = time.monotonic()
        if self._task is not None and (now >= self._due or share >= 1.0):
            self._due = now + _REFRESH_S
            self._progress.update(self._task, description="smoothing", total=1.0, completed=share)

    def show(self, summary: Summary) -> None:
        """The summary: a table for people, or one JSON object for programs."""
        if self._as_json:
            print(json.dumps(summary.document(), default=str))
        elif not self._quiet:
            show_summary(summary, Console(highlight=False))


def _line(run: Run, picture: Picture | None) -> str:
    """How a session is doing, in one line."""
    if picture is None:
        return "waiting for the first message" if not run.heard_for_s else "looking for the runway in what comes in"
    sources = ", ".join(f"{one.name} {one.rate_hz:.0f}/s" for one in picture.health.sources)
    return f"{sources}; {len(picture.track.active)} radar tracks, {len(picture.associate.pairs)} associated"


def show_summary(summary: Summary, console: Console) -> None:
    """The summary as tables."""
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for name, value in _rows(summary):
        table.add_row(name, value)
    console.print(table)
    if summary.accuracy:
        scores = Table(box=None, padding=(0, 2, 0, 0), title="distance to the truth, m", title_justify="left")
        for column in ("", "RMSE", "median", "95 %", "number"):
            scores.add_column(column, justify="left" if not column else "right")
        for kind, score in summary.accuracy.items():
            numbers = (f"{score.rmse_m:.2f}", f"{score.median_m:.2f}", f"{score.p95_m:.2f}", str(score.count))
            scores.add_row(_WORDS.get(kind, kind), *numbers)
        console.print(scores)
    if summary.muted:
        _show_muted(summary.muted, console)
    if summary.smoothed is not None and summary.smoothed.accuracy:
        _show_smoothed(summary.smoothed, console)
    if summary.archive is not None:
        console.print(f"archived in {summary.archive}", soft_wrap=True)


def _show_muted(scores: Sequence[MutedScore], console: Console) -> None:
    """How far what went on without positions was from those that were muted."""
    marks = sorted({mark for score in scores for mark in score.by_mark_m})
    title = "level distance to the muted GPS, m"
    table = Table(box=None, padding=(0, 2, 0, 0), title=title, title_justify="left")
    for column in ("", "", "for", "median", *(f"at {mark} s" for mark in marks), "end", "largest", "in 3 σ"):
        table.add_column(column, justify="left" if not column else "right", no_wrap=True)
    for score in scores:
        by_mark = (f"{score.by_mark_m[mark]:.1f}" if mark in score.by_mark_m else "" for mark in marks)
        inside = "" if score.inside is None else f"{100.0 * score.inside:.0f} %"
        ends = f"{score.at_end_m:.1f}", f"{score.largest_m:.1f}", inside
        table.add_row(score.aircraft, score.what, f"{score.lasts_s:.0f} s", f"{score.median_m:.1f}", *by_mark, *ends)
    Console(width=max(console.width, 110), highlight=False).print(table)  # what is cut short cannot be read


def _show_smoothed(found: SmoothedSummary, console: Console) -> None:
    """The tracks' last word and what smoothing made of it, row by row the same times."""
    table = Table(box=None, padding=(0, 2, 0, 0), title="distance to the truth, RMSE m", title_justify="left")
    for column in ("", "filtered", "smoothed", "ratio", "number"):
        table.add_column(column, justify="left" if not column else "right")
    for kind, score in found.accuracy.items():
        before, after = score.filtered.rmse_m, score.smoothed.rmse_m
        ratio = f"{after / before:.2f}" if before > 0.0 else ""
        table.add_row(_WORDS.get(kind, kind), f"{before:.2f}", f"{after:.2f}", ratio, str(score.smoothed.count))
    console.print(table)


_WORDS = {
    "gps": "GPS reports",
    "radar": "radar plots",
    "fused": "track, fused",
    "gps only": "track, GPS only",
    "radar only": "track, radar only",
    "coasting": "track, coasting",
    "all": "track, all of it",
}


def _rows(summary: Summary) -> list[tuple[str, str]]:
    counted = ", ".join(f"{number} {kind}" for kind, number in summary.observations.items()) or "none"
    rows: list[tuple[str, str]] = [
        ("session", f"{summary.duration_s:.1f} s in {summary.wall_s:.1f} s, {summary.ended}"),
        ("site", f"{summary.site or 'not known'}" + (f" ({summary.site_origin})" if summary.site_origin else "")),
    ]
    rows += [("source", _source(source)) for source in summary.sources]
    rows += [
        ("observations", counted),
        ("tracks", f"{summary.tracks} ({', '.join(summary.aircraft) or 'no aircraft'}), {summary.track_rows} updates"),
        ("associations", f"{summary.associations}, {summary.associations_lost} lost again"),
    ]
    if summary.smoothed is not None:
        rows.append(("smoothed", f"{summary.smoothed.rows} updates"))
    if summary.epoch_offset_s:
        rows.append(("epoch offset", f"{summary.epoch_offset_s} s: the sources' date is not ours"))
    rows += [("counted", f"{number} {reason}") for reason, number in summary.counters.items() if _is_news(reason)]
    return rows


def _is_news(reason: str) -> bool:
    """Whether a counter says more than how much came, which stands beside its source already."""
    return not reason.endswith((" frames", " datagrams"))


def _source(source: dict[str, Any]) -> str:
    return f"{source['name']}: {source['arrivals']} from {source['origin']}"
