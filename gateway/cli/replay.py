"""`talkdown replay`: run recordings or an archived session again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.again import Wanted, replay_many, wanted
from gateway.cli.failures import RunError, UsageError
from gateway.cli.many import Crew, sessions_of
from gateway.cli.replay_options import (
    Methods,
    PlanOption,
    Section,
    SmoothOption,
    SpeedOption,
    read_plans,
    read_speed,
)
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.runtime.playback import Playback
    from gateway.runtime.told_plans import Missions

_HELP = """
Run recordings, or an archived session, again: the same path as live, as fast as it goes or at its own pace.

Files are told by what is in them: .tlog, .BIN, .ulg, .pcap, .pcapng. Several are merged by their time stamps. A session's
folder brings its site and options along and gives the same numbers, bit for bit. Of a folder of sessions each is run again,
as many at once as there are cores. A mission file (.plan, QGC WPL 110) is
told to the gateway as the flight plan of the vehicle.

Examples:

  talkdown replay flight.tlog

  talkdown replay flight.BIN --from 10:50 --to 13:00

  talkdown replay flight.tlog radar.pcap --site field.toml --speed max --archive sessions

  talkdown replay flight.tlog radar.pcap --mute gps:60:90 --mute radar:1:100:120

  talkdown replay flight.tlog --estimator alpha-beta-gamma

  talkdown replay flight.tlog radar.pcap --smooth --archive sessions

  talkdown replay three-planes.tlog --plan mavlink:2=circuit.plan

  talkdown replay sessions/20260301T120000Z-demo-field --viewer none --json

  talkdown replay sessions --estimator imm --archive with-imm
"""

_SMOOTHED_IN_PASSING = """The smoothed tracks are compared with the truth and drawn, where there is one; \
to keep them, name a folder with --archive."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replay", help=_HELP)(spread(replay))


def replay(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE|SESSION|DIR...", help="Recordings; archived sessions, or folders of them.", show_default=False
        ),
    ],
    section: Section = Section(),
    plan: PlanOption = None,
    site: take.SiteOption = None,
    speed: SpeedOption = None,
    seen: take.Seen = take.Seen(),
    methods: Methods = Methods(),
    smooth: SmoothOption = False,
    key: take.KeyOption = None,
    crew: Crew = Crew(),
    telling: take.Telling = take.Telling(),
) -> None:
    """Run recordings again."""
    what = wanted(section, methods, site, key, smooth=smooth)
    many = sessions_of(files, crew) if all(path.is_dir() for path in files) else None
    if many is None:
        _replay(files, what, read_plans(plan), speed, seen, telling)
        return
    if seen.viewer not in (None, take.Viewer.none) or seen.serve or plan or speed not in (None, "max"):
        raise UsageError(
            "Many sessions are replayed as fast as they go, and nobody looks on: --viewer, --serve, --speed and --plan "
            "are for one."
        )
    replay_many(many, what, seen.archive, crew, telling)


def _replay(
    files: list[Path], what: Wanted, plans: Missions, speed: str | None, seen: take.Seen, telling: take.Telling
) -> None:
    """Run one recording, or session, again."""
    from adapters.files import FileError
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_replay
    from gateway.runtime.seeking import SeekError
    from gateway.runtime.setup import RunFailure
    from gateway.runtime.signals import StopSignals

    looks = chosen(seen.viewer)
    pace = read_speed(speed, None if looks is take.Viewer.none else 1.0)
    try:
        playback, setup = what.opened(files, plans)
        setup = replace(
            setup,
            archive=seen.archive,
            serve=take.read_serve(seen.serve, looks),
            is_watched=pace is not None or looks is not take.Viewer.none,
        )
        with (
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=telling.quiet, as_json=telling.json, fraction=playback.fraction) as display,
        ):
            for note in _notes(playback, is_kept=not what.smooth or seen.archive is not None):
                display.say(note)
            summary = run_replay(
                playback,
                setup,
                speed=pace,
                watch=display.watch,
                asked_to_stop=stop,
                tell_smoothed=display.smoothing if what.smooth else lambda share: None,
            )
        display.show(summary)
    except (FileError, FolderError, SeekError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure


def _notes(playback: Playback, *, is_kept: bool) -> tuple[str, ...]:
    """What there is to say before it begins; `is_kept`: what is smoothed goes to an archive, or nothing is."""
    return playback.notes if is_kept else (*playback.notes, _SMOOTHED_IN_PASSING)
