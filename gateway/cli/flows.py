"""`talkdown flows`: the ways that arrivals took."""

from __future__ import annotations

import json as text
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.arrivals_selected import Selection, document, flown_by, shortcuts, table_of
from gateway.cli.failures import RunError, UsageError, reading, writing
from gateway.cli.many import Crew, expanded, failures, tell_failures, wide_console
from gateway.cli.places import read_place_deg
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.offline.flows import Flows, Method, Track
    from gateway.offline.procedures import Compared
    from gateway.runtime.arrivals import Flight

_HELP = """
Find the flows of many arrivals: which ways they came, how many came that way, how long they took, and who came no way of many.

Recorded ADS-B is read as CSV (also .gz) or Parquet with the columns timestamp, latitude, longitude, altitude (feet), and fid,
flight_id, callsign or icao24; and so are archived sessions, and folders of them. Flights that do not end low are left out
(paper 002-7).

With --procedure arrivals are compared with what is published: who flew which procedure, shortcuts, heights at the entry.

Examples:

  talkdown flows arrivals.csv.gz --airport 49.01,2.55

  talkdown flows sessions --method jaccard --archive flows

  talkdown flows arrivals.csv.gz --runway 27 --from NE

  talkdown flows sessions --runway 26L --procedure published.toml --archive flows
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("flows", help=_HELP)(spread(flows))


def flows(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE|SESSION|DIR...",
            help="Recorded ADS-B, archived sessions, folders of them.",
            show_default=False,
        ),
    ],
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="default|jaccard|literal",
            help="default compares whole tracks (needs scikit-learn); literal is as printed; jaccard its repair.",
        ),
    ] = "default",
    airport: Annotated[
        str | None,
        typer.Option(
            "--airport",
            metavar="LAT,LON",
            help="Where they land, degrees. (default: where most end)",
            show_default=False,
        ),
    ] = None,
    least: Annotated[
        int, typer.Option("--least", metavar="N", min=2, help="How many flights make a flow; fewer came alone.")
    ] = 3,
    selection: Selection = Selection(),
    archive: take.ArchiveOption = None,
    crew: Crew = Crew(),
    telling: take.Telling = take.Telling(),
) -> None:
    """Find flows."""
    from gateway.runtime.arrivals import ArrivalsError, arrivals_among

    chosen = _method(method)
    where = None if airport is None else read_place_deg(airport, "--airport")
    published = selection.published()
    paths = expanded(files, crew)
    flights, failed = _read(paths, crew, show=not telling.quiet)
    try:
        tracks, where, left_out = arrivals_among(flights, where)
    except ArrivalsError as error:
        tell_failures(failed, len(paths))
        raise UsageError(str(error)) from error
    tracks = selection.of(tracks, published, where)
    beside = selection.compared(tracks, published, where)
    result = _found(tracks, chosen, least)
    if archive is not None:
        _archive(archive, tracks, result, where, beside)
    if telling.json:
        print(text.dumps(_document(tracks, result, where, left_out, beside) | {"failed": failed}))
    elif not telling.quiet:
        _show(tracks, result, where, left_out, beside)
        if archive is not None:
            print(f"archived in {archive}; look: rerun {archive / 'flows.rrd'}")
    tell_failures(failed, len(paths))


def _method(name: str) -> Method:
    """The method of this name. Raises UsageError."""
    from gateway.offline.flows import METHODS

    chosen = next((one for one in METHODS if one == name), None)
    if chosen is None:
        raise UsageError(f"--method {name!r} is none of {', '.join(METHODS)}.")
    return chosen


def _found(tracks: tuple[Track, ...], method: Method, least: int) -> Flows:
    """The flows of some arrivals. Raises RunError."""
    from gateway.offline.flows import found

    try:
        return found(tracks, method, least_flights=least)
    except ModuleNotFoundError as error:
        raise RunError(
            "--method default needs scikit-learn, which is not installed: pip install 'talkdown[flows]', or --method jaccard."
        ) from error


def _read(paths: list[Path], crew: Crew, *, show: bool) -> tuple[list[Flight], list[dict[str, str]]]:
    """The flights of all files and sessions, and those that could not be read."""
    if len(paths) == 1:
        return flights_one(paths[0]), []
    outcomes = crew.work_on(flights_one, paths, "reading", show=show)
    return [flight for one in outcomes for flight in one.result or ()], failures(paths, outcomes)


def flights_one(path: Path) -> list[Flight]:
    """The flights of one file or session. Raises UsageError, RunError."""
    from gateway.runtime.arrivals import ArrivalsError, flights_of

    try:
        with reading(path):
            return flights_of(path)
    except ArrivalsError as error:
        raise UsageError(str(error)) from error


def _archive(
    folder: Path, tracks: tuple[Track, ...], result: Flows, airport_deg: tuple[float, float], beside: Compared | None
) -> None:
    """memberships.parquet, flows.parquet (mean tracks), flows.json (as predictions take them up), flows.rrd."""
    from gateway.runtime.flow_tables import ways_of, write_flows
    from gateway.runtime.flow_ways import write_ways
    from gateway.sinks.flows import draw

    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        write_flows(tracks, result, folder)
        write_ways(ways_of(result.flows, airport_deg), airport_deg, folder)
        draw(tracks, result, folder / "flows.rrd", () if beside is None else beside.procedures)


def _document(
    tracks: tuple[Track, ...], result: Flows, where: tuple[float, float], left_out: int, beside: Compared | None
) -> dict[str, Any]:
    return {
        "airport_deg": list(where),
        "flights": len(tracks),
        "left_out": left_out,
        "flows": [
            {
                "flights": [tracks[flight].name for flight in flow.flights],
                "mean_time_s": flow.mean_time_s,
                "time_spread_s": flow.time_spread_s,
                "lateral_spread_m": float(flow.spread_m[:, 0].mean()),
                "vertical_spread_m": float(flow.spread_m[:, 1].mean()),
                **({} if beside is None else flown_by(beside, flow.flights)),
            }
            for flow in result.flows
        ],
        "alone": [
            {"flight": name, "aside_m": None if math.isnan(aside) else aside} for name, aside in _alone(tracks, result)
        ],
        **({} if beside is None else {"procedures": document(beside, tracks)}),
    }


def _alone(tracks: tuple[Track, ...], result: Flows) -> list[tuple[str, float]]:
    """Who came no way of many, and how far aside of the nearest one, m, NaN = there is none."""
    rows = zip(tracks, result.labels, result.aside_m.tolist(), strict=True)
    return [(track.name, aside) for track, label, aside in rows if label < 0]


def _show(
    tracks: tuple[Track, ...], result: Flows, where: tuple[float, float], left_out: int, beside: Compared | None
) -> None:
    from rich.table import Table

    console = wide_console()
    table = Table(box=None, padding=(0, 2, 0, 0))
    headings = ("flow", "flights", "from", "minutes", "+-", "lateral, m", "vertical, m")
    for place, heading in enumerate((*headings, *(() if beside is None else ("procedure", "of them", "aside, m")))):
        table.add_column(heading, justify="right" if place else "left", no_wrap=True)
    for number, flow in enumerate(result.flows, 1):
        east, north = flow.mean_m[0, :2]
        bearing, distance = math.degrees(math.atan2(east, north)) % 360.0, math.hypot(east, north) / 1000.0
        numbers = (flow.mean_time_s / 60.0, flow.time_spread_s / 60.0)
        spreads = flow.spread_m.mean(axis=0)
        table.add_row(
            str(number),
            str(len(flow.flights)),
            f"{bearing:03.0f} deg, {distance:.0f} km",
            *(f"{one:.1f}" for one in numbers),
            *(f"{one:.0f}" for one in spreads),
            *(() if beside is None else _procedure(flown_by(beside, flow.flights))),
        )
    console.print(table)
    alone = [
        name if math.isnan(aside) else f"{name} ({aside / 1000.0:.1f} km aside)"
        for name, aside in _alone(tracks, result)
    ]
    if alone:
        console.print(f"alone: {', '.join(alone)}")
    more = f"; {left_out} more did not end low" if left_out else ""
    console.print(f"{len(tracks)} arrivals about {where[0]:.4f}, {where[1]:.4f}{more}")
    if beside is not None:
        _show_procedures(beside, tracks)


def _procedure(flown: dict[str, Any]) -> tuple[str, str, str]:
    """What most of a flow's flights flew, in words."""
    if flown["procedure"] is None:
        return "none", "", ""
    return flown["procedure"], f"{100.0 * flown['procedure_share']:.0f} %", f"{flown['procedure_aside_m'] or 0.0:.0f}"


def _show_procedures(beside: Compared, tracks: tuple[Track, ...]) -> None:
    """Heights are above the airport."""
    console, rows = wide_console(), document(beside, tracks)
    console.print(table_of(rows))
    for line in shortcuts(rows):
        console.print(line)
    none = [track.name for track, one in zip(tracks, beside.flights, strict=True) if one is None]
    console.print(f"on no procedure: {len(none)} of {len(tracks)}")
