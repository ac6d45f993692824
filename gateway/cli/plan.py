"""`talkdown plan`: a route under threat, as a mission."""

from __future__ import annotations

import json as text
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError, writing
from gateway.cli.places import read_place_deg
from gateway.cli.plan_options import Asked, Flying, Given, Method
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from adapters.mission_writing import MissionItem
    from gateway.runtime.urls import Url
    from sim.planning.case import Case
    from sim.planning.flight import Flight, Wishes

_HELP = """
Plan a route that keeps away from threats and out of areas, and write it as a mission (paper 002-3).

A file says where it starts and ends, and where threats and areas are; without one the paper's case is drawn from a seed:
20 km x 20 km with eight threats. What is written: NAME.plan (QGroundControl), NAME.waypoints (QGC WPL 110), and NAME.rrd, the
picture. With [bold]--site[/] the route ends with the approach and the landing there.

Examples:

  talkdown plan --seed 2

  talkdown plan threats.toml --height 200:600 --speed 40 --out route

  talkdown plan --seed 2 --site field.toml --out home

  talkdown plan threats.toml --upload udpin:0.0.0.0:14550
"""
_BANK_RAD = math.radians(25.0)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("plan", help=_HELP)(spread(plan))


def plan(
    asked: Asked = Asked(),
    method: Method = Method(),
    flying: Flying = Flying(),
    site: take.SiteOption = None,
    given: Given = Given(),
    telling: take.Telling = take.Telling(),
) -> None:
    """Plan a route."""
    from gateway.settings import SiteError
    from sim.planning.flight import plan_flight
    from sim.planning.mission import mission
    from sim.planning.task import PlanError

    link, wishes = _link(given), _wishes(flying, method)
    place = take.read_place(site)
    runway = None if place is None else place.site.runway
    try:
        case = _case(asked)
        if runway is not None and not case.is_placed:
            case = case.moved_to(runway)
        flight = plan_flight(case, wishes, _planner(method, asked.seed or 0), runway)
    except SiteError as error:
        raise UsageError(str(error)) from error
    except PlanError as error:
        raise RunError(str(error)) from error
    summary = _summary(flight, wishes, flying.speed)
    items, home = mission(flight, flying.speed)
    written = _write(flight, items, home, wishes, flying.speed, given.out)
    if telling.json:
        print(text.dumps({**summary, "written": [str(path) for path in written]}))
    elif not telling.quiet:
        _show(summary, written)
    if link is not None:
        _upload(items, home, link, given.vehicle, quiet=telling.quiet or telling.json)


def _wishes(flying: Flying, method: Method) -> Wishes:
    """What the route has to be like. Raises UsageError."""
    from gateway.geodesy import STANDARD_GRAVITY_MPS2
    from sim.planning.flight import Wishes

    banked_m = flying.speed**2 / (STANDARD_GRAVITY_MPS2 * math.tan(_BANK_RAD))
    radius_m = banked_m if flying.turn_radius is None else flying.turn_radius
    return Wishes(*_read_height(flying.height), radius_m, method.lambda_km4 * 1e12)


def _link(given: Given) -> Url | None:
    """Where the mission is given to; None: nowhere. Raises UsageError."""
    from gateway.runtime.urls import MAVLINK_PORT

    if given.upload is not None:
        (link,) = take.read_urls([given.upload], MAVLINK_PORT)
        return link
    if given.vehicle is not None:
        raise UsageError("--vehicle says whom --upload gives the mission to; add --upload URL.")
    return None


def _case(asked: Asked) -> Case:
    from sim.planning.case import drawn_case
    from sim.planning.files import read_case

    if asked.file is None and asked.seed is None:
        raise UsageError("Say what to plan: a file with threats and areas, or --seed N for the paper's case.")
    case = drawn_case(asked.seed or 0) if asked.file is None else read_case(asked.file)
    for end, written in (("start", asked.start), ("goal", asked.goal)):
        if written == "runway":
            case = case.with_end(end, None)
        elif written is not None:
            case = case.with_end(end, read_place_deg(written, f"--{end}"))
    return case


def _planner(wanted: Method, seed: int) -> Any:
    from functools import partial

    from sim.planning import modern
    from sim.planning import seed as paper
    from sim.planning.triples import OBJECTIVES

    chosen = next((one for one in OBJECTIVES if one == wanted.objective), None)
    if chosen is None:
        raise UsageError(f"--objective {wanted.objective!r} is none of {', '.join(OBJECTIVES)}.")
    planners = {
        "modern": modern.plan,
        "seed": partial(paper.plan, seed=seed, how=paper.Seed(chosen)),
        "literal": partial(paper.plan, seed=seed, how=paper.LITERAL),
    }
    if wanted.method not in planners:
        raise UsageError(f"--method {wanted.method!r} is none of {', '.join(planners)}.")
    if wanted.method != "seed" and chosen != OBJECTIVES[0]:
        raise UsageError(f"--objective {wanted.objective} is for --method seed; {wanted.method} does not heed it.")
    return planners[wanted.method]


def _read_height(written: str) -> tuple[float, float]:
    low, colon, high = written.partition(":")
    try:
        lowest, highest = float(low), float(high if colon else low)
    except ValueError:
        lowest = highest = math.nan
    if not 0.0 < lowest <= highest <= 20_000.0:
        raise UsageError(
            f"--height {written!r} is not understood: write metres above home as in 300, or a band, 200:600."
        )
    return lowest, highest


def _summary(flight: Flight, wishes: Wishes, speed_mps: float) -> dict[str, Any]:
    from sim.planning.mission import duration_s, waypoints

    found = flight.route.measures
    return {
        "case": flight.case.name,
        "method": flight.route.name,
        "length_m": found.length_m,
        "cost_m": found.cost_m,
        "exposure_per_m3": found.exposure_m3,
        "clearance_m": found.clearance_m if math.isfinite(found.clearance_m) else None,
        "least_turn_radius_m": found.turn_radius_m if math.isfinite(found.turn_radius_m) else None,
        "asked_turn_radius_m": wishes.turn_radius_m,
        "level_m": flight.level_m,
        "waypoints": len(waypoints(flight)),
        "lands": flight.final is not None,
        "duration_s": duration_s(flight, speed_mps),
        "candidates": [
            {"cost_m": one.measures.cost_m, "length_m": one.measures.length_m} for one in flight.route.candidates[:8]
        ],
    }


def _write(
    flight: Flight,
    items: list[MissionItem],
    home: tuple[float, float, float],
    wishes: Wishes,
    speed_mps: float,
    out: Path,
) -> list[Path]:
    from adapters.mission_writing import format_plan, format_waypoints
    from sim.planning.mission import fences
    from sim.planning.picture import draw

    paths = [out.with_name(f"{out.name}.{ending}") for ending in ("plan", "waypoints", "rrd")]
    with writing(out):
        paths[0].write_text(format_plan(items, home, cruise_mps=speed_mps, fences=fences(flight)), "utf-8")
        paths[1].write_text(format_waypoints(items, home), "utf-8")
        draw(flight, wishes.lambda_m4, paths[2])
    return paths


def _show(summary: dict[str, Any], written: list[Path]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)

    def metres(name: str) -> str:
        value = summary[name]
        return "-" if value is None else f"{value:,.0f} m".replace(",", " ")

    table.add_row("case", f"{summary['case']}, {summary['method']}")
    table.add_row("length", f"{metres('length_m')}, {summary['duration_s'] / 60.0:.1f} min")
    table.add_row("J", f"{metres('cost_m')} (length and threat)")
    table.add_row("nearest threat", metres("clearance_m"))
    table.add_row("exposure", f"{summary['exposure_per_m3'] * 1e9:.4f} /km3")
    table.add_row("least turn radius", f"{metres('least_turn_radius_m')} (asked: {metres('asked_turn_radius_m')})")
    landing = ", then the final and the landing" if summary["lands"] else ""
    table.add_row("waypoints", f"{summary['waypoints']} at up to {summary['level_m']:.0f} m above home{landing}")
    console.print(table)
    if (summary["least_turn_radius_m"] or math.inf) < summary["asked_turn_radius_m"]:
        console.print(
            "The paper's method knows no turn radius: this route turns too narrowly; --method modern keeps it."
        )
    console.print(f"written: {', '.join(str(path) for path in written)}", soft_wrap=True)


def _upload(
    items: list[MissionItem], home: tuple[float, float, float], link: Url, vehicle: int | None, *, quiet: bool
) -> None:
    from gateway.runtime.uploading import UploadError, upload_mission

    try:
        said = upload_mission(link, items, home, vehicle)
    except UploadError as error:
        raise RunError(str(error)) from error
    if not quiet:
        print(said)
