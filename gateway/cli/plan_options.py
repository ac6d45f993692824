"""Options of `talkdown plan`, in groups."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer


@dataclass(frozen=True, slots=True)
class Asked:
    """From where to where, past what."""

    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="Threats and areas, TOML or JSON.", show_default=False)
    ] = None
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed", metavar="N", help="Draws the threats; with a file, of the annealing.", show_default=False
        ),
    ] = None
    start: Annotated[
        str | None,
        typer.Option("--start", metavar="LAT,LON", help="In place of the file's; or runway.", show_default=False),
    ] = None
    goal: Annotated[
        str | None,
        typer.Option("--goal", metavar="LAT,LON", help="In place of the file's; or runway.", show_default=False),
    ] = None


@dataclass(frozen=True, slots=True)
class Method:
    """How it is planned."""

    method: Annotated[
        str,
        typer.Option(
            "--method", metavar="modern|seed|literal", help="modern; the paper's method, read well (seed) or literally."
        ),
    ] = "modern"
    objective: Annotated[
        str,
        typer.Option("--objective", metavar="threat|clearance|literal", help="Of the paper's triples, with seed."),
    ] = "threat"
    lambda_km4: Annotated[
        float,
        typer.Option(
            "--lambda", metavar="KM4", min=0.0, help="What threat counts: 16 doubles a metre at 2 km from one."
        ),
    ] = 16.0


@dataclass(frozen=True, slots=True)
class Flying:
    """How it is flown."""

    speed: Annotated[float, typer.Option("--speed", metavar="M/S", min=1.0, max=400.0, help="Over the ground.")] = 40.0
    turn_radius: Annotated[
        float | None,
        typer.Option(
            "--turn-radius",
            metavar="M",
            min=0.0,
            help="No turn is narrower. (default: 25 degrees of bank at the speed)",
            show_default=False,
        ),
    ] = None
    height: Annotated[
        str, typer.Option("--height", metavar="M[:M]", help="Above home: a level, or a band to choose one from.")
    ] = "300"


@dataclass(frozen=True, slots=True)
class Given:
    """Where the mission goes."""

    out: Annotated[Path, typer.Option("--out", "-o", metavar="NAME", help="NAME.plan, NAME.waypoints, NAME.rrd.")] = (
        Path("route")
    )
    upload: Annotated[
        str | None,
        typer.Option(
            "--upload", metavar="URL", help="Give the mission to the vehicle on this link.", show_default=False
        ),
    ] = None
    vehicle: Annotated[
        int | None,
        typer.Option(
            "--vehicle",
            metavar="N",
            min=1,
            max=250,
            help="Its MAVLink system. (default: the first)",
            show_default=False,
        ),
    ] = None
