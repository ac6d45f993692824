"""`talkdown replay`: run recordings or an archived session again."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
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
FromOption = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="T",
        help="Begin here: 90, 1:30 or 1:02:03 after the start, or UTC (00:05:00Z, 2026-01-01T00:05:00Z).",
        show_default=False,
    ),
]
ToOption = Annotated[
    str | None, typer.Option("--to", metavar="T", help="End here; written as for --from.", show_default=False)
]
MuteOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mute",
        metavar="WHAT[:N][:T:T]",
        help="Do not listen to gps or radar (number N) from T to T; may be given several times.",
        show_default=False,
    ),
]
PlanOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="VEHICLE=FILE",
        help="A mission file and whose it is, such as mavlink:2=circuit.plan; may be given several times.",
        show_default=False,
    ),
]
SmoothOption = Annotated[
    bool,
    typer.Option(
        "--smooth", help="When it is over, make smoothed tracks: what later measurements tell of each instant."
    ),
]


@dataclass(frozen=True, slots=True)
class Section:
    """Which part of a recording is run, and without which sources."""

    begin: FromOption = None
    end: ToOption = None
    mute: MuteOption = None


@dataclass(frozen=True, slots=True)
class Methods:
    """How tracks are made; None = as in the session."""

    estimator: Annotated[
        take.Estimator | None,
        typer.Option("--estimator", help="How tracks move. (default: the session's, else kalman)", show_default=False),
    ] = None
    weighting: Annotated[
        take.Weighting | None,
        typer.Option(
            "--weighting", help="How GPS and radar are weighed. (default: the session's, else bias)", show_default=False
        ),
    ] = None
    association: Annotated[
        take.Association | None,
        typer.Option(
            "--association", help="When two are one. (default: the session's, else default)", show_default=False
        ),
    ] = None
    registration: Annotated[
        take.Registration | None,
        typer.Option(
            "--registration",
            help="What radars measure too much: learnt and taken off, only told, or neither. "
            "(default: the session's, else apply)",
            show_default=False,
        ),
    ] = None
    dead_reckoning: Annotated[
        take.DeadReckoning | None,
        typer.Option(
            "--dead-reckoning",
            help="Whether vehicles go on by what they tell of their own motion. (default: the session's, else on)",
            show_default=False,
        ),
    ] = None

    def change(self, options: Options) -> Options:
        """The options with what was asked for in place of what was archived."""
        chosen = (self.weighting, self.association, self.estimator, self.registration, self.dead_reckoning)
        return take.change(options, *chosen)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("replay", help=_HELP)(spread(replay))


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


def read_plans(texts: list[str] | None) -> list[tuple[str | None, Path]]:
    """Mission files, each with its vehicle where it is named. Raises UsageError."""
    plans: list[tuple[str | None, Path]] = []
    for text in texts or []:
        vehicle, equals, file = text.partition("=")
        if equals and file and re.fullmatch(r"mavlink:\d{1,3}(@\d+)?", vehicle):
            plans.append((vehicle, Path(file)))
        elif not equals and text:
            plans.append((None, Path(text)))
        else:
            raise UsageError(f"--plan {text!r} is not understood: write mavlink:2=FILE, or FILE for the only vehicle.")
    return plans


def seek(
    playback: Playback, options: Options, begin: str | None, end: str | None, mutes: list[str] | None
) -> tuple[Playback, Options]:
    """The recording and the options with what --from, --to and --mute say. Raises SeekError."""
    from gateway.runtime.seeking import SeekError

    if begin is None and end is None and not mutes:
        return playback, options
    span = playback.span()
    if begin is not None:
        options = replace(options, begins_at=span.instant(begin, "--from"))
    if mutes:
        options = replace(options, mutes=tuple(span.mute(text) for text in mutes))
    if end is not None:
        ends_at = span.instant(end, "--to")
        if options.begins_at is not None and ends_at <= options.begins_at:
            raise SeekError(f"--to {end} is not after where the replay begins.")
        playback = replace(playback, watermark=ends_at)
    return playback, options


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
        playback, options = seek(playback, options, section.begin, section.end, section.mute)
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
            passing = (_SMOOTHED_IN_PASSING,) if smooth and seen.archive is None else ()
            for note in (*playback.notes, *passing):
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
