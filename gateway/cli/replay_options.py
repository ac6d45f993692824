"""What `talkdown replay` and its like may be told: recordings, which part of them, how fast, whose plans, which methods."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError

if TYPE_CHECKING:
    from gateway.runtime.playback import Playback
    from gateway.settings import Options

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
        metavar="[VEHICLE=]FILE",
        help="A mission file (.plan, QGC WPL 110), and whose it is, such as mavlink:2=circuit.plan; repeatable.",
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

    def cut(self, playback: Playback, options: Options) -> tuple[Playback, Options]:
        """The recording and the options with what was said. Raises SeekError."""
        return seek(playback, options, self.begin, self.end, self.mute)


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
    flows: take.FlowsOption = None

    def change(self, options: Options) -> Options:
        """The options with what was asked for in place of what was archived."""
        return take.choose(
            options,
            estimator=self.estimator,
            weighting=self.weighting,
            association=self.association,
            registration=self.registration,
            dead_reckoning=self.dead_reckoning,
        )


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
