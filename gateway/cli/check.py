"""`talkdown check`: what is inside a recording, and what can be made of it."""

from __future__ import annotations

import json as text
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer
from rich.console import Console
from rich.table import Table

from gateway.cli import options as take
from gateway.cli.failures import UsageError
from gateway.cli.progress import progressing
from gateway.cli.replay_options import FilesArgument

if TYPE_CHECKING:
    from gateway.runtime.findings import Finding
    from gateway.runtime.survey import Component, Stream, Survey

_HELP = """
Say what is inside a recording: who speaks and how often, what was lost, how good the clocks are, what Talkdown can make of
it, and what is missing.

Several files are read together, as replay would read them.

Examples:

  talkdown check flight.tlog

  talkdown check flight.BIN radar.pcap --json
"""

_PAPER = 140  # columns where nobody's terminal says how many
_BRIEF_NS = 1_000_000_000  # what came within a second has no rate
_MARKS = {"good": "[green]+[/]", "missing": "[yellow]-[/]", "wrong": "[red]![/]"}


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("check", help=_HELP)(check)


def check(files: FilesArgument, quiet: take.QuietOption = False, json: take.JsonOption = False) -> None:
    """Say what is inside a recording."""
    from adapters.files import FileError
    from gateway.runtime.findings import findings
    from gateway.runtime.folder import FolderError
    from gateway.runtime.playback import open_playback
    from gateway.runtime.survey import survey

    try:
        playback = open_playback(files)
        with progressing("reading", show=not quiet and not json) as tell:
            found = survey(playback, tell)
    except (FileError, FolderError) as error:
        raise UsageError(str(error)) from error
    told = findings(found)
    if json:
        print(text.dumps(document(found, told), allow_nan=False))
    elif not quiet:
        console = Console(highlight=False)
        _show(files, found, told, console if console.is_terminal else Console(highlight=False, width=_PAPER))


def _show(files: Sequence[Path], found: Survey, told: Sequence[Finding], console: Console) -> None:
    """The survey as tables: who, what they send, clocks, losses; then what it means."""
    names = ", ".join(str(file) for file in files)
    console.print(f"{names}: {_utc(found.began)} to {_utc(found.ended)}, {found.duration_s:.1f} s", soft_wrap=True)
    for title, columns, rows in (
        ("\nwho speaks", _WHO, [_who(component) for component in _by_size(found)]),
        ("\nwhat they send", _WHAT, [_what(found, *each) for each in _streams(found)]),
        ("\nradars", _RADARS, [_radar(found, number) for number in sorted(found.radars)]),
        ("\nclocks", _CLOCKS, [_clock(found, name) for name in sorted(found.vehicles)]),
    ):
        if rows:
            console.print(_table(title, columns, rows))
    for name, vehicle in sorted(found.vehicles.items()):
        if vehicle.words:
            said = "; ".join(f"{key}: {value}" for key, value in vehicle.words)
            console.print(f"\n{name} last said: {said}", markup=False, soft_wrap=True)
    counted = [(reason, number) for reason, number in found.counters.items() if number and not _is_plain(reason)]
    if counted:
        console.print(_table("\ncounted", ("", "number"), [(reason, f"{number}") for reason, number in counted]))
    console.print("\nwhat Talkdown can make of it")
    for finding in told:
        console.print(f"  {_MARKS[finding.kind]} ", end="")
        console.print(finding.text, markup=False, soft_wrap=True)


_WHO = ("id", "what", "source", "wire", "frames", "1/s", "lost", "doubled", "late", "longest silence, s")
_WHAT = ("id", "message", "number", "1/s", "longest silence, s", "at, s", "used")
_RADARS = ("radar", "plots", "1/s", "tracks", "partial", "unnumbered", "longest silence, s")
_CLOCKS = ("aircraft", "time from", "sigma, s", "delay, s", "99 %, s")


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), title=title, title_justify="left", title_style="bold")
    for place, heading in enumerate(columns):
        words = all(not row[place][:1].isdigit() for row in rows)
        justify: Literal["left", "right"] = "left" if words or not place else "right"
        table.add_column(heading, justify=justify, overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


def _by_size(found: Survey) -> list[Component]:
    return sorted(found.components.values(), key=lambda component: -component.frames.count)


def _streams(found: Survey) -> list[tuple[Component, int, Stream]]:
    """Every kind of message of every component, the most frequent first."""
    return [
        (component, message, stream)
        for component in _by_size(found)
        for message, stream in sorted(component.streams.items(), key=lambda item: -item[1].count)
    ]


def _who(component: Component) -> tuple[str, ...]:
    versions = " and ".join(str(version) for version in sorted(component.versions))
    wire = f"MAVLink {versions}" + (f", {component.signed} signed" if component.signed else "")
    counted = component.counters
    return (
        component.name,
        component.what,
        component.source.name,
        wire,
        f"{component.frames.count}",
        f"{component.frames.rate_hz:.1f}",
        f"{max(counted['lost'], 0)} ({component.lost_share:.2%})",
        f"{counted['duplicate']}",
        f"{counted['reordered']}",
        f"{component.frames.longest_gap_ns / 1e9:.1f}",
    )


def _what(found: Survey, component: Component, message: int, stream: Stream) -> tuple[str, ...]:
    rate = gap = at = ""
    if stream.last - stream.first >= _BRIEF_NS:
        rate = f"{stream.rate_hz:.2f}"
        gap, at = f"{stream.longest_gap_ns / 1e9:.1f}", f"{(stream.gap_at - found.began) / 1e9:.0f}"
    used = "yes" if message in found.used else ""
    return component.name, stream.name, f"{stream.count}", rate, gap, at, used


def _radar(found: Survey, number: int) -> tuple[str, ...]:
    seen = found.radars[number]
    return (
        str(number),
        f"{seen.plots.count}",
        f"{seen.plots.rate_hz:.2f}",
        f"{len(seen.tracks)}",
        f"{seen.partial}",
        f"{seen.plots.count - seen.numbered}",
        f"{seen.plots.longest_gap_ns / 1e9:.1f}",
    )


def _clock(found: Survey, name: str) -> tuple[str, ...]:
    vehicle = found.vehicles[name]
    times = (_seconds(one) for one in (vehicle.clock_sigma_s, vehicle.delay_s, vehicle.delay_99_s))
    return name, vehicle.clock, *times


def _seconds(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else "not known"


def _utc(stamp: int) -> str:
    return datetime.fromtimestamp(stamp / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _is_plain(reason: str) -> bool:
    """Whether a counter only says how much came, which stands in the tables already."""
    return reason.endswith((" frames", " datagrams"))


def document(found: Survey, told: Sequence[Finding]) -> dict[str, Any]:
    """The survey as plain values: times in s from the first arrival, rates in 1/s, null for what is not known."""
    return {
        "began": _utc(found.began),
        "duration_s": found.duration_s,
        "epoch_offset_s": found.epoch_offset_s,
        "components": [_component_document(found, component) for component in _by_size(found)],
        "aircraft": [
            {
                "name": seen.name,
                "positions": seen.reports.count,
                "rate_hz": seen.reports.rate_hz,
                "longest_gap_s": seen.reports.longest_gap_ns / 1e9,
                "timing": {timing.value: number for timing, number in seen.timings.items()},
                "observations": dict(seen.kinds),
            }
            for _, seen in sorted(found.aircraft.items())
        ],
        "radars": [
            {
                "number": number,
                "plots": seen.plots.count,
                "rate_hz": seen.plots.rate_hz,
                "tracks": len(seen.tracks),
                "partial": seen.partial,
                "unnumbered": seen.plots.count - seen.numbered,
                "longest_gap_s": seen.plots.longest_gap_ns / 1e9,
            }
            for number, seen in sorted(found.radars.items())
        ],
        "clocks": [
            {
                "aircraft": name,
                "time_from": vehicle.clock,
                "sigma_s": _known(vehicle.clock_sigma_s),
                "delay_s": _known(vehicle.delay_s),
                "delay_99_s": _known(vehicle.delay_99_s),
            }
            for name, vehicle in sorted(found.vehicles.items())
        ],
        "counters": found.counters,
        "site": found.place.origin if found.place else None,
        "findings": [{"kind": finding.kind, "text": finding.text} for finding in told],
    }


def _component_document(found: Survey, component: Component) -> dict[str, Any]:
    return {
        "source": component.source.name,
        "system": component.system,
        "component": component.component,
        "what": component.what,
        "frames": component.frames.count,
        "rate_hz": component.frames.rate_hz,
        "longest_gap_s": component.frames.longest_gap_ns / 1e9,
        "versions": sorted(component.versions),
        "signed": component.signed,
        "lost": max(component.counters["lost"], 0),
        "counters": dict(component.counters),
        "messages": {
            stream.name: {
                "number": stream.count,
                "rate_hz": stream.rate_hz,
                "longest_gap_s": stream.longest_gap_ns / 1e9,
                "used": message in found.used,
            }
            for message, stream in sorted(component.streams.items())
        },
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
