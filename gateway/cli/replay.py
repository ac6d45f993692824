"""`talkdown replay`: run recordings or an archived session again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

_HELP = """
Run recordings, or an archived session, again: the same path as live, as fast as it goes or at its own pace.

Files are told by what is in them: .tlog, .pcap, .pcapng. Several are merged by their time stamps. A session's folder
brings its site and options along and gives the same numbers, bit for bit.

Examples:

  talkdown replay flight.tlog

  talkdown replay flight.tlog radar.pcap --site field.toml --speed max --archive sessions

  talkdown replay sessions/20260301T120000Z-demo-field --viewer none --json
"""

FilesArgument = Annotated[
    list[Path],
    typer.Argument(metavar="FILE|SESSION...", help="Recordings, or one archived session.", show_default=False),
]


SpeedOption = Annotated[
    str | None,
    typer.Option(
        "--speed",
        metavar="max|N",
        help="N times its own pace. (default: 1 with a viewer, max without)",
        show_default=False,
    ),
]
WeightingOption = Annotated[
    take.Weighting | None,
    typer.Option(
        "--weighting", help="How GPS and radar are weighed. (default: the session's, else bias)", show_default=False
    ),
]
AssociationOption = Annotated[
    take.Association | None,
    typer.Option("--association", help="When two are one. (default: the session's, else default)", show_default=False),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replay", help=_HELP)(replay)


def read_speed(text: str | None, default: float | None) -> float | None:
    """How fast: a factor, or None for as fast as it goes. Raises UsageError."""
    if text is None:
        return default
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = float("nan")
    if not 0.0 < speed <= 1e6:
        raise UsageError(f"--speed {text!r} is neither a number above 0, such as 1 or 10, nor max.")
    return speed


def replay(
    files: FilesArgument,
    site: take.SiteOption = None,
    speed: SpeedOption = None,
    viewer: take.ViewerOption = None,
    serve: take.ServeOption = None,
    archive: take.ArchiveOption = None,
    weighting: WeightingOption = None,
    association: AssociationOption = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Run recordings again."""
    from adapters.files import FileError
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_replay
    from gateway.runtime.playback import open_playback
    from gateway.runtime.setup import RunFailure, Setup
    from gateway.runtime.signals import StopSignals

    place = take.read_place(site)
    looks = chosen(viewer)
    pace = read_speed(speed, None if looks is take.Viewer.none else 1.0)
    try:
        playback = open_playback(files)
        setup = Setup(
            place=place or playback.place or playback.find_place(),
            options=take.change(playback.options, weighting, association),
            archive=archive,
            serve=take.read_serve(serve, looks),
            keys=take.read_keys(place, site),
            is_watched=pace is not None or looks is not take.Viewer.none,
            name=files[0].stem if place is None and playback.place is None else "",
            command=tuple(sys.argv[1:]),
        )
        with (
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=quiet, as_json=json, fraction=playback.fraction) as display,
        ):
            summary = run_replay(playback, setup, speed=pace, watch=display.watch, asked_to_stop=stop)
        display.show(summary)
    except (FileError, FolderError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
