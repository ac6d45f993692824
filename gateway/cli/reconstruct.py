"""`talkdown reconstruct`: flights rebuilt from airspeed, heading and pitch, without positions."""

from __future__ import annotations

import json as text
import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError, writing
from gateway.cli.replay_options import FilesArgument, MuteOption

if TYPE_CHECKING:
    from gateway.offline.carrying import Muted, Place
    from gateway.offline.reconstruction import How, Sortie
    from gateway.runtime.playback import Playback
    from gateway.runtime.setup import Place as SitePlace

_HELP = """
Rebuild the flights of a recording from what its aircraft said of airspeed, attitude and pressure. Sorties are found by
airspeed, integrated from lift-off on, and closed onto where they ended; that tells the wind (paper 002-2).

Positions are not used, but for where lift-off was, and touchdown if that was elsewhere, unless --with-gps ties the path to
them; what was rebuilt is held against them where there are any. Accelerations (50 a second) tell how the wind changed. What a
landing radar saw (a capture, a session) ties the path too; which plots are this aircraft's is found by the path.
--without-radar leaves it out.

Examples:

  talkdown reconstruct flight.BIN

  talkdown reconstruct flight.tlog --close-on -35.3632,149.1652 --archive flights

  talkdown reconstruct flight.tlog --site field.toml --close-on threshold

  talkdown reconstruct flight.tlog --with-gps --mute gps:120:400

  talkdown reconstruct flight.tlog radar.pcap --site field.toml

  talkdown reconstruct sessions/20260301T120000Z-demo-field --archive flights
"""

CloseOption = Annotated[
    str | None,
    typer.Option(
        "--close-on",
        metavar="lift-off|threshold|nothing|LAT,LON",
        help="Where every sortie ended: where it lifted off; the site's landing threshold; a place; or nobody knows. "
        "(default: where it lifted off, or where its positions say it touched down, if that is elsewhere)",
        show_default=False,
    ),
]
LiftOffOption = Annotated[
    str | None,
    typer.Option(
        "--lift-off",
        metavar="LAT,LON",
        help="Where it lifted off. (default: the position told nearest to it, where there is one)",
        show_default=False,
    ),
]
TakeOffOption = Annotated[
    float | None,
    typer.Option(
        "--take-off-speed",
        metavar="M/S",
        min=0.1,
        help="Airspeed above which a sortie begins. (default: 0.6 of the cruising speed)",
        show_default=False,
    ),
]
LandingOption = Annotated[
    float | None,
    typer.Option(
        "--landing-speed",
        metavar="M/S",
        min=0.1,
        help="Airspeed below which it ends. (default: 0.45 of the cruising speed)",
        show_default=False,
    ),
]
RunwayOption = Annotated[
    float | None,
    typer.Option(
        "--runway-direction",
        metavar="DEGREES",
        help="True direction of the runway, either way: tells the heading's constant error. "
        "(default: the site's, for flights that lifted off there)",
        show_default=False,
    ),
]
WithGpsOption = Annotated[
    bool, typer.Option("--with-gps", help="Tie the paths to the positions that were told; --mute leaves some out.")
]
WithoutRadarOption = Annotated[
    bool, typer.Option("--without-radar", help="Do not tie the paths to what a landing radar saw.")
]
ConstantWindOption = Annotated[
    bool, typer.Option("--constant-wind", help="Close as the paper does, with one wind, whatever accelerations tell.")
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("reconstruct", help=_HELP)(reconstruct)


def reconstruct(
    files: FilesArgument,
    site: take.SiteOption = None,
    close_on: CloseOption = None,
    lift_off: LiftOffOption = None,
    take_off_speed: TakeOffOption = None,
    landing_speed: LandingOption = None,
    runway_direction: RunwayOption = None,
    with_gps: WithGpsOption = False,
    without_radar: WithoutRadarOption = False,
    constant_wind: ConstantWindOption = False,
    mute: MuteOption = None,
    archive: take.ArchiveOption = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Rebuild flights."""
    from adapters.files import FileError
    from gateway.cli.reconstruct_shown import show
    from gateway.runtime.flights import document
    from gateway.runtime.folder import FolderError
    from gateway.runtime.playback import open_playback
    from gateway.runtime.seeking import SeekError

    place = take.read_place(site)
    how = _how(take_off_speed, landing_speed, lift_off, close_on, runway_direction, place)
    try:
        playback = open_playback(files)
        gps, radars = _muted(playback, mute)
        how = replace(how, fixes=with_gps, muted=gps, radars_muted=radars, inertial=not constant_wind)
        session = files[0] if files[0].is_dir() else None
        found = _rebuilt(playback, how, Around(place, session, not without_radar), quiet)
    except (FileError, FolderError, SeekError) as error:
        raise UsageError(str(error)) from error
    kept = None if archive is None else _archive(found, archive / f"{files[0].resolve().stem}-flights")
    if json:
        print(text.dumps(document(found)))
    elif not quiet:
        show(found)
        if kept is not None:
            print(f"archived in {kept}; look: rerun {kept / 'flights.rrd'}")


def _how(
    take_off_mps: float | None,
    landing_mps: float | None,
    lift_off: str | None,
    close_on: str | None,
    runway_deg: float | None,
    place: SitePlace | None,
) -> How:
    """What the options say of how. Raises UsageError."""
    from gateway.offline.reconstruction import How

    if take_off_mps is not None and landing_mps is not None and landing_mps >= take_off_mps:
        raise UsageError("The landing speed must be below the take-off speed, or a sortie would end as it begins.")
    runway = None if place is None else place.site.runway
    close: Place | str | None = close_on
    if close_on == "threshold":
        close = _threshold(place)
    elif close_on is not None and close_on not in ("lift-off", "nothing"):
        close = _read_place(close_on, "--close-on", "lift-off, threshold, nothing, or ")
    return How(
        take_off_mps,
        landing_mps,
        None if lift_off is None else _read_place(lift_off, "--lift-off"),
        close,
        runway if runway_deg is None else math.radians(runway_deg),
    )


def _threshold(place: SitePlace | None) -> Place:
    """The site's landing threshold."""
    from gateway.frames import RunwayFrame

    if place is None:
        raise UsageError("--close-on threshold needs the runway: give a site file with --site.")
    runway = place.site.runway
    latitude, longitude, _ = RunwayFrame(runway).geodetic_from_runway([runway.threshold_x_m, 0.0, 0.0])
    return float(latitude), float(longitude)


def _read_place(written: str, option: str, others: str = "") -> Place:
    try:
        latitude, longitude = (float(part) for part in written.split(","))
    except ValueError:
        latitude = longitude = math.nan
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise UsageError(f"{option} {written!r} is not understood: write {others}degrees as in -35.3632,149.1652.")
    return math.radians(latitude), math.radians(longitude)


@dataclass(frozen=True, slots=True)
class Around:
    """The site that was given, the session that the recording is, and whether its radars are asked."""

    place: SitePlace | None
    session: Path | None
    asks_radars: bool


def _muted(playback: Playback, mutes: list[str] | None) -> tuple[Muted, tuple[tuple[int, Muted], ...]]:
    """From when to when, ns UTC, positions tie nothing, and plots of a radar (0: of all). Raises SeekError, UsageError."""
    if not mutes:
        return (), ()
    span = playback.span()
    found = [span.mute(one) for one in mutes]
    if any(mute.what == "gps" and mute.number is not None for mute in found):
        raise UsageError("Positions are muted of all aircraft at once: write --mute gps:60:90.")
    times = [(mute, ((mute.since + span.utc_offset, mute.until + span.utc_offset),)) for mute in found]
    gps = tuple(time for mute, when in times if mute.what == "gps" for time in when)
    return gps, tuple((mute.number or 0, when) for mute, when in times if mute.what == "radar")


def _rebuilt(playback: Playback, how: How, around: Around, quiet: bool) -> dict[str, list[Sortie]]:
    """Every sortie of every aircraft. Raises FileError, FolderError, RunError where there is nothing to rebuild."""
    from gateway.cli.progress import progressing
    from gateway.offline.ends import Unplaced, Unreachable
    from gateway.offline.reconstruction import reconstructed
    from gateway.runtime.flights import radar_tracks, radar_views, read_recorded

    with progressing("reading", show=not quiet) as tell:
        recorded = read_recorded(playback, tell)
    flyable = {name: one for name, one in recorded.aircraft.items() if one.lacks() is None}
    if not flyable:
        lacking = {name: one.lacks() for name, one in recorded.aircraft.items()}
        told = "; ".join(f"{name} tells no {what}" for name, what in lacking.items()) or "no aircraft tells anything"
        raise RunError(f"Nothing can be rebuilt, because a path needs airspeed and attitude: {told}.")
    for name in (name for name, one in flyable.items() if not one.flies_by_its_nose and not quiet):
        print(f"{name} is no aeroplane: it need not move where its nose points.", file=sys.stderr)
    views = radar_views(recorded, playback, around.place, around.session) if around.asks_radars else []
    tracks = radar_tracks(around.session) if views and around.session is not None else {}
    if around.asks_radars and recorded.sightings.plots and not views and not quiet:
        print("Nothing tells where the radar stands: give a site file with --site to use what it saw.", file=sys.stderr)
    found: dict[str, list[Sortie]] = {}
    try:
        with progressing("rebuilding", show=not quiet) as tell:
            for name, one in flyable.items():
                found[name] = reconstructed(one, how, views, tracks.get(name, ()))
                tell(len(found) / len(flyable))
    except Unplaced as error:
        raise UsageError(f"{str(error).capitalize()}: tell it with --lift-off LAT,LON.") from error
    except Unreachable as error:
        raise UsageError(str(error)) from error
    return found


def _archive(found: dict[str, list[Sortie]], folder: Path) -> Path:
    from gateway.runtime.flights import write_flights
    from gateway.sinks.flights import draw

    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_flights(found, folder)
        draw(found, folder / "flights.rrd")
    return folder
