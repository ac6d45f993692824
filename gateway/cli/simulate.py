"""`talkdown simulate`: a simulated world on the real wires, or into an archived session."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError, sending, writing
from gateway.cli.replay_options import read_speed
from gateway.cli.spread import spread
from gateway.cli.vehicle_options import Wanted
from gateway.cli.vehicles import simulate_vehicles

if TYPE_CHECKING:
    from sim.scene import Scene

_HELP = """
Play a simulated world onto the real wires: aircraft as MAVLink, radars as landing-radar datagrams, over UDP.

A scene is a TOML file: one that comes along ([bold]--list[/] names them) or one of your own (docs/scenes.md);
[bold]--show[/] prints one to begin with. The scene [bold]radar[/] is a landing radar that watches the aircraft of a
recording or of a live link. The scene [bold]vehicle[/] is a vehicle that ground stations talk to: it takes missions,
modes and commands, and flies. The scene [bold]helmsman[/] is an autopilot that steers a simulated ship on a link.

Examples:

  talkdown simulate approach

  talkdown simulate traffic --set aircraft=12 --set radars=2 --set gps.error_east_m=30 --seed 7

  talkdown simulate approach --speed max --archive sessions

  talkdown simulate --list

  talkdown simulate gps-loss --show > mine.toml

  talkdown simulate mine.toml --seed 7

  talkdown simulate radar --watch flight.tlog --site field.toml --archive sessions

  talkdown simulate vehicle --type copter --home 47.397,8.546,490 --mavlink udpout:127.0.0.1:14550

  talkdown simulate vehicle --mission route.plan --wind 8,270,1.5 --archive flights

  talkdown simulate helmsman --mavlink udpin:0.0.0.0:14560 --set autopilot=expert
"""
_NO_FILES = ("radar", "vehicle", "helmsman")  # scenes that are commands of their own


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("simulate", help=_HELP)(spread(simulate))


@dataclass(frozen=True, slots=True)
class Asking:
    """What is asked about scenes, in place of playing one."""

    listed: Annotated[bool, typer.Option("--list", help="List the scenes that there are, or those in a folder.")] = (
        False
    )
    shown: Annotated[bool, typer.Option("--show", help="Print the scene's file, to be copied and changed.")] = False


@dataclass(frozen=True, slots=True)
class Playing:
    """Where a world is played to, and how fast."""

    mavlink: Annotated[str, typer.Option("--mavlink", metavar="URL", help="Where aircraft send.")] = (
        "udpout:127.0.0.1:14550"
    )
    radar: Annotated[str, typer.Option("--radar", metavar="URL", help="Where radars send.")] = "udpout:127.0.0.1:30070"
    speed: Annotated[str, typer.Option("--speed", metavar="max|N", help="N times real time.")] = "1"
    archive: Annotated[
        Path | None,
        typer.Option(
            "--archive", metavar="DIR", help="Write a session into DIR instead of sending.", show_default=False
        ),
    ] = None


@dataclass(frozen=True, slots=True)
class Changes:
    """What is otherwise than the scene has it."""

    seed: Annotated[
        int | None,
        typer.Option(
            "--seed", metavar="N", help="Of the random numbers. (default: the scene's, 0)", show_default=False
        ),
    ] = None
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="A sensor's parameter, such as gps.period_s=1; repeatable.",
            show_default=False,
        ),
    ] = None
    watch: Annotated[
        str | None,
        typer.Option("--watch", metavar="FILE|URL", help="For the scene radar: what it looks at.", show_default=False),
    ] = None


def simulate(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENE]",
            help="A scene's name, a scene file, radar, vehicle or helmsman; a folder for --list.",
            show_default=False,
        ),
    ] = None,
    site: take.SiteOption = None,
    playing: Playing = Playing(),
    changes: Changes = Changes(),
    asking: Asking = Asking(),
    wanted: Wanted = Wanted(),
    quiet: take.QuietOption = False,
) -> None:
    """Play a simulated world."""
    from gateway.cli.scenes import list_scenes, show_scene

    if asking.listed:
        list_scenes(scene)
        return
    if scene is None:
        raise UsageError("Which scene? talkdown simulate --list names them; or give a scene file of your own.")
    if asking.shown:
        if scene in _NO_FILES:
            raise UsageError(f"The scene {scene} has no file to show; talkdown simulate --help says what it takes.")
        show_scene(scene)
        return
    pace, settings = read_speed(playing.speed, 1.0), changes.settings or []
    seed, archive = changes.seed, playing.archive
    _check_belonging(scene, wanted, changes.watch, settings, archive)
    if scene == "helmsman":
        from gateway.cli.helmsman import steer_a_ship

        steer_a_ship(playing.mavlink, settings, quiet)
    elif scene == "vehicle":
        simulate_vehicles(wanted, site, playing.mavlink, seed=seed or 0, speed=pace, archive=archive, quiet=quiet)
    elif changes.watch is not None:
        from gateway.cli.watching import watch_and_send

        watch_and_send(
            changes.watch,
            site,
            playing.radar,
            seed=seed or 0,
            settings=settings,
            speed=pace,
            archive=archive,
            quiet=quiet,
        )
    else:
        built = _build(scene, site, seed, settings)
        if archive is not None:
            _write(built, archive, quiet)
        else:
            _send(built, playing.mavlink, playing.radar, pace, quiet)


def _check_belonging(scene: str, wanted: Wanted, watch: str | None, settings: list[str], archive: Path | None) -> None:
    """Raises UsageError for an option that the scene would not heed."""
    if wanted != Wanted() and scene != "vehicle":
        raise UsageError(
            "--type, --mission, --home, --count, --wind, --start and --seconds belong to the scene vehicle: "
            "talkdown simulate vehicle."
        )
    if (scene == "radar") != (watch is not None):
        raise UsageError("--watch belongs to the scene radar: talkdown simulate radar --watch FILE|URL.")
    if settings and scene == "vehicle":
        raise UsageError("--set does not change a simulated vehicle; stations set its parameters over the link.")
    if archive is not None and scene == "helmsman":
        raise UsageError("A helmsman steers over a link and writes no session; leave --archive out.")


def _build(name: str, site: Path | None, seed: int | None, settings: list[str]) -> Scene:
    import time

    from gateway.settings import SiteError
    from sim.overrides import OverrideError
    from sim.scenes import find_scene, stage

    place = take.read_place(site)
    keys = take.read_keys(place, site)
    try:
        script = find_scene(name)
        start_ns = time.time_ns() // 4000 * 4000 if script.start_ns is None else script.start_ns
        there = place.site if place else None
        return stage(script, start_ns=start_ns, site=there, seed=seed, changes=settings, keys=keys)
    except (OverrideError, SiteError) as error:
        raise UsageError(str(error)) from error


def _write(scene: Scene, archive: Path, quiet: bool) -> None:
    from gateway.runtime.folder import FolderError
    from sim.recording import write_session

    try:
        with writing(archive), _telling(scene, quiet) as progress:
            folder = write_session(scene, archive, command=tuple(sys.argv[1:]), progress=progress)
    except FolderError as error:
        raise UsageError(str(error)) from error
    if not quiet:
        print(f"archived in {folder}")


def _send(scene: Scene, mavlink: str, radar: str, pace: float | None, quiet: bool) -> None:
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import MAVLINK_PORT, RADAR_PORT, LinkError
    from sim.run import play

    (mavlink_url,), (radar_url,) = take.read_urls([mavlink], MAVLINK_PORT), take.read_urls([radar], RADAR_PORT)
    for url in (mavlink_url, radar_url):
        if url.scheme != "udpout":
            raise UsageError(f"simulate sends, so it needs udpout:HOST:PORT and not {url}.")
    stop = threading.Event()
    try:
        with sending(), StopSignals(stop.set), _telling(scene, quiet) as progress:
            sent = play(scene, mavlink_url, radar_url, speed=pace, stop=stop, progress=progress)
    except LinkError as error:
        raise UsageError(str(error)) from error
    if not quiet:
        print(f"sent {' and '.join(f'{number} {kind}' for kind, number in sent.items()) or 'nothing'}")


@contextlib.contextmanager
def _telling(scene: Scene, quiet: bool) -> Iterator[Callable[[float], None]]:
    """A bar that is told the scene's second."""
    from gateway.cli.progress import progressing

    with progressing("seconds of the scene", show=not quiet) as told:
        yield lambda second: told(second / scene.duration_s)
