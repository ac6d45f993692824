"""Options of `talkdown simulate vehicle`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

_PANEL = "For the scene vehicle"


class VehicleType(StrEnum):
    """What flies, or sails."""

    plane = "plane"
    copter = "copter"
    helicopter = "helicopter"
    ship = "ship"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the command line says of vehicles."""

    kind: Annotated[VehicleType, typer.Option("--type", help="What it is.", rich_help_panel=_PANEL)] = VehicleType.plane
    mission: Annotated[
        Path | None,
        typer.Option(
            "--mission",
            metavar="FILE",
            help="What it is to do: a .plan, or QGC WPL 110.",
            show_default=False,
            rich_help_panel=_PANEL,
        ),
    ] = None
    home: Annotated[
        str | None,
        typer.Option(
            "--home",
            metavar="LAT,LON[,ALT[,HEADING]]",
            help="Where it stands: degrees, m above the sea, degrees. (default: the mission's home, or the runway)",
            show_default=False,
            rich_help_panel=_PANEL,
        ),
    ] = None
    count: Annotated[
        int, typer.Option("--count", metavar="N", help="How many, side by side.", rich_help_panel=_PANEL)
    ] = 1
    wind: Annotated[
        str | None,
        typer.Option(
            "--wind",
            metavar="SPEED[,FROM[,GUSTS]]",
            help="m/s, true degrees, one sigma of gusts in m/s; not for ships.",
            show_default=False,
            rich_help_panel=_PANEL,
        ),
    ] = None
    start: Annotated[
        bool, typer.Option("--start", help="Begin the mission without being told.", rich_help_panel=_PANEL)
    ] = False
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            metavar="S",
            help="End after so long, by the vehicle's clock.",
            show_default=False,
            rich_help_panel=_PANEL,
        ),
    ] = None
