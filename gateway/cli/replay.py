"""`talkdown replay`: run recordings or an archived session again."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
from gateway.cli.replay_options import (
    FilesArgument,
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
    from gateway.runtime.setup import Place, Setup
    from gateway.settings import Options

_HELP = """
Run recordings, or an archived session, again: the same path as live, as fast as it goes or at its own pace.

Files are told by what is in them: .tlog, .BIN, .ulg, .pcap, .pcapng. Several are merged by their time stamps. A session's
folder brings its site and options along and gives the same numbers, bit for bit. A mission file (.plan, QGC WPL 110) is
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
"""

_SMOOTHED_IN_PASSING = """The smoothed tracks are compared with the truth and drawn, where there is one; \
to keep them, name a folder with --archive."""
SMOOTHED = ("kalman", "imm", "rmimm")  # the estimators that a smoother can go back over


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replay", help=_HELP)(spread(replay))


def check_smoothing(options: Options) -> None:
    """Raise UsageError where --smooth was asked for with an estimator that it cannot go back over."""
    if options.estimator not in SMOOTHED:
        raise UsageError(
            f"--smooth cannot go back over {options.estimator}, which keeps no covariances that hold together; "
            f"choose --estimator {', '.join(SMOOTHED[:-1])} or {SMOOTHED[-1]}."
        )


def replay(
    files: FilesArgument,
    section: Section = Section(),
    plan: PlanOption = None,
    site: take.SiteOption = None,
    speed: SpeedOption = None,
    seen: take.Seen = take.Seen(),
    methods: Methods = Methods(),
    smooth: SmoothOption = False,
    key: take.KeyOption = None,
    telling: take.Telling = take.Telling(),
) -> None:
    """Run recordings again."""
    from adapters.files import FileError
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_replay
    from gateway.runtime.playback import open_playback
    from gateway.runtime.seeking import SeekError
    from gateway.runtime.setup import RunFailure
    from gateway.runtime.signals import StopSignals

    place, signing_key = take.read_place(site), take.read_signing_key(key)
    looks = chosen(seen.viewer)
    pace = read_speed(speed, None if looks is take.Viewer.none else 1.0)
    try:
        playback = open_playback(files, read_plans(plan), signing_key)
        options = methods.change(playback.options)
        if smooth:
            check_smoothing(options)
        playback, options = section.cut(playback, options)
        setup = replace(
            _setup(playback, place, files[0].stem, seen, looks),
            options=options,
            keys=take.read_keys(place, site),
            signing_key=signing_key,
            is_watched=pace is not None or looks is not take.Viewer.none,
            smooth=smooth,
        )
        with (
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=telling.quiet, as_json=telling.json, fraction=playback.fraction) as display,
        ):
            for note in _notes(playback, is_kept=not smooth or seen.archive is not None):
                display.say(note)
            summary = run_replay(
                playback,
                setup,
                speed=pace,
                watch=display.watch,
                asked_to_stop=stop,
                tell_smoothed=display.smoothing if smooth else lambda share: None,
            )
        display.show(summary)
    except (FileError, FolderError, SeekError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure


def _notes(playback: Playback, *, is_kept: bool) -> tuple[str, ...]:
    """What there is to say before it begins; `is_kept`: what is smoothed goes to an archive, or nothing is."""
    return playback.notes if is_kept else (*playback.notes, _SMOOTHED_IN_PASSING)


def _setup(playback: Playback, place: Place | None, stem: str, seen: take.Seen, looks: take.Viewer) -> Setup:
    """Where a recording is run again, how it is called, shown and kept. Raises UsageError, FileError."""
    from gateway.runtime.setup import Setup

    has_own_place = place is not None or playback.place is not None
    return Setup(
        place=place or playback.place or playback.find_place(),
        options=playback.options,
        archive=seen.archive,
        serve=take.read_serve(seen.serve, looks),
        remembered=playback.remembered,
        name="" if has_own_place else stem,
        command=tuple(sys.argv[1:]),
    )
