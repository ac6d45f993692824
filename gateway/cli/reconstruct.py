"""`talkdown reconstruct`: flights rebuilt from airspeed, heading and pitch, without positions."""

from __future__ import annotations

import json as text
import math
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError, writing
from gateway.cli.replay_options import FilesArgument, MuteOption

if TYPE_CHECKING:
    from gateway.offline.carrying import Place
    from gateway.offline.reconstruction import How, Sortie
    from gateway.runtime.playback import Playback
    from gateway.runtime.setup import Place as SitePlace

_HELP = """
Rebuild the flights of a recording from what its aircraft said of airspeed, attitude and pressure. Sorties are found by
airspeed, integrated from lift-off on, and closed onto where they ended; that tells the wind (paper 002-2).

Positions are not used, but for where lift-off was, unless --with-gps ties the path to them; what was rebuilt is held against
them where there are any.

Examples:

  talkdown reconstruct flight.BIN

  talkdown reconstruct flight.tlog --close-on -35.3632,149.1652 --archive flights

  talkdown reconstruct flight.tlog --site field.toml --close-on threshold

  talkdown reconstruct flight.tlog --with-gps --mute gps:120:400
"""

CloseOption = Annotated[
    str,
    typer.Option(
        "--close-on",
        metavar="lift-off|threshold|nothing|LAT,LON",
        help="Where every sortie ended: where it lifted off; the site's landing threshold; a place; or nobody knows.",
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
        help="True direction of the runway, either way: tells the heading's constant error. (default: the site's)",
        show_default=False,
    ),
]
WithGpsOption = Annotated[
    bool, typer.Option("--with-gps", help="Tie the paths to the positions that were told; --mute leaves some out.")
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("reconstruct", help=_HELP)(reconstruct)


def reconstruct(
    files: FilesArgument,
    site: take.SiteOption = None,
    close_on: CloseOption = "lift-off",
    lift_off: LiftOffOption = None,
    take_off_speed: TakeOffOption = None,
    landing_speed: LandingOption = None,
    runway_direction: RunwayOption = None,
    with_gps: WithGpsOption = False,
    mute: MuteOption = None,
    archive: take.ArchiveOption = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Rebuild flights."""
    from adapters.files import FileError
    from gateway.runtime.flights import document
    from gateway.runtime.folder import FolderError
    from gateway.runtime.playback import open_playback
    from gateway.runtime.seeking import SeekError

    how = _how(take_off_speed, landing_speed, lift_off, close_on, runway_direction, take.read_place(site))
    try:
        playback = open_playback(files)
        how = replace(how, fixes=with_gps, muted=_muted(playback, mute))
        found = _rebuilt(playback, how, quiet)
    except (FileError, FolderError, SeekError) as error:
        raise UsageError(str(error)) from error
    kept = None if archive is None else _archive(found, archive / f"{files[0].resolve().stem}-flights")
    if json:
        print(text.dumps(document(found)))
    elif not quiet:
        _show(found)
        if kept is not None:
            print(f"archived in {kept}; look: rerun {kept / 'flights.rrd'}")


def _how(
    take_off_mps: float | None,
    landing_mps: float | None,
    lift_off: str | None,
    close_on: str,
    runway_deg: float | None,
    place: SitePlace | None,
) -> How:
    """What the options say of how. Raises UsageError."""
    from gateway.offline.reconstruction import How

    if take_off_mps is not None and landing_mps is not None and landing_mps >= take_off_mps:
        raise UsageError("The landing speed must be below the take-off speed, or a sortie would end as it begins.")
    direction = None if place is None else place.site.runway.landing_compass_rad
    close: Place | str = close_on
    if close_on == "threshold":
        close = _threshold(place)
    elif close_on not in ("lift-off", "nothing"):
        close = _read_place(close_on, "--close-on", "lift-off, threshold, nothing, or ")
    return How(
        take_off_mps,
        landing_mps,
        None if lift_off is None else _read_place(lift_off, "--lift-off"),
        close,
        direction if runway_deg is None else math.radians(runway_deg),
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


def _muted(playback: Playback, mutes: list[str] | None) -> tuple[tuple[int, int], ...]:
    """From when to when positions tie nothing, ns UTC. Raises SeekError."""
    if not mutes:
        return ()
    span = playback.span()
    found = [span.mute(one) for one in mutes]
    if any(mute.what != "gps" or mute.number is not None for mute in found):
        raise UsageError("Of a reconstruction only positions can be muted, all of them: write --mute gps:60:90.")
    return tuple((mute.since + span.utc_offset, mute.until + span.utc_offset) for mute in found)


def _rebuilt(playback: Playback, how: How, quiet: bool) -> dict[str, list[Sortie]]:
    """Every sortie of every aircraft. Raises FileError, RunError where there is nothing to rebuild."""
    from gateway.cli.progress import progressing
    from gateway.offline.reconstruction import Unplaced, reconstructed
    from gateway.runtime.flights import read_parameters

    with progressing("reading", show=not quiet) as tell:
        parameters = read_parameters(playback, tell)
    flyable = {name: one for name, one in parameters.items() if one.lacks() is None}
    if not flyable:
        lacking = {name: one.lacks() for name, one in parameters.items()}
        told = "; ".join(f"{name} tells no {what}" for name, what in lacking.items()) or "no aircraft tells anything"
        raise RunError(f"Nothing can be rebuilt, because a path needs airspeed and attitude: {told}.")
    for name in (name for name, one in flyable.items() if not one.flies_by_its_nose and not quiet):
        print(f"{name} is no aeroplane: it need not move where its nose points.", file=sys.stderr)
    try:
        return {name: reconstructed(one, how) for name, one in flyable.items()}
    except Unplaced as error:
        raise UsageError(f"{str(error).capitalize()}: tell it with --lift-off LAT,LON.") from error


def _archive(found: dict[str, list[Sortie]], folder: Path) -> Path:
    from gateway.runtime.flights import write_flights
    from gateway.sinks.flights import draw

    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_flights(found, folder)
        draw(found, folder / "flights.rrd")
    return folder


def _show(found: dict[str, list[Sortie]]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(box=None, padding=(0, 1, 0, 0))
    for place, heading in enumerate(("sortie", "lift-off", "lasted", "km", "end", "wind, m/s", "RMSE", "of way")):
        table.add_column(heading, justify="right" if place > 1 else "left", no_wrap=True)
    for aircraft, sorties in found.items():
        if not sorties:
            console.print(f"{aircraft} has no sortie: its airspeed never stays above the take-off speed for a minute.")
        for number, sortie in enumerate(sorties, 1):
            table.add_row(*_cells(f"{aircraft} {number}", sortie))
    if table.row_count:
        console.print(table)
    for aircraft, sorties in found.items():
        for number, sortie in enumerate(sorties, 1):
            for note in _notes(sortie):
                console.print(f"{aircraft} {number}: {note}", soft_wrap=True)


def _cells(name: str, sortie: Sortie) -> tuple[str, ...]:
    """`end`: how far the open path ended from where it should have, m; `RMSE` beside the positions, m, and of their way."""
    began = datetime.fromtimestamp(int(sortie.time[0]) // 1_000_000_000, UTC)
    minutes, seconds = divmod(round(sortie.duration_s), 60)
    east, north = sortie.wind_mps.mean(axis=0)
    wind = "-"
    if not math.isnan(east):
        wind = f"{math.hypot(east, north):.1f} from {math.degrees(math.atan2(-east, -north)) % 360:03.0f}"
    end = "-" if math.isnan(sortie.end_error_m) else f"{sortie.end_error_m:.0f} m"
    head = (name, f"{began:%H:%M:%S}", f"{minutes}:{seconds:02d}", f"{sortie.length_m / 1000:.1f}", end, wind)
    beside = sortie.compared
    if beside is None or beside.length_m == 0.0:
        return (*head, "-", "-")
    return (*head, f"{beside.rmse_m:.1f} m", f"{100 * beside.rmse_m / beside.length_m:.2f} %")


def _notes(sortie: Sortie) -> list[str]:
    """What a person should know of a sortie beside its row."""
    notes = []
    if not sortie.landed:
        notes.append("the recording ends in the air: the path is not closed.")
    elif not sortie.took_off and math.isnan(sortie.end_error_m):
        notes.append("the recording begins in the air: the path is not closed (--close-on LAT,LON).")
    if not math.isnan(sortie.heading_bias_rad):
        bias, sigma = (math.degrees(one) for one in (sortie.heading_bias_rad, sortie.heading_bias_sigma_rad))
        notes.append(f"on the take-off roll the heading showed {bias:+.1f} +- {sigma:.1f} degrees; it was taken off.")
    if sortie.fixes:
        notes.append(f"tied to {sortie.fixes} positions; 1 sigma at worst {sortie.sigma_m.max():.0f} m an axis.")
    if sortie.height_by == "pitch":
        notes.append(
            "neither pressure nor altitude is told: its height is that of the pitch, which drifts by kilometres."
        )
    if sortie.lift_off is None:
        notes.append("nothing tells where it lifted off: the path is in metres from there (--lift-off LAT,LON).")
    return notes
