"""`talkdown demo`: an approach, simulated over real UDP on the loopback, fused, drawn and archived."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.runtime.links import Link

_HELP = """
Watch an approach come together: one aircraft and one landing radar, simulated over real UDP on this machine, with the
GPS 60 m off and the radar noisy, fused live, drawn, and archived. Nothing is needed, nothing leaves the machine.

It shows the end of the flight at real speed and ends by itself.

Examples:

  talkdown demo

  talkdown demo --headless --seconds 60 --archive sessions
"""

_SECONDS = 180.0
_SCENE = "landing"
_ENDS_AT_S = 520.0  # the aircraft has rolled out
_AFTER_S = 2.0  # the last datagrams, and the checks that wait for them


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("demo", help=_HELP)(demo)


def demo(
    headless: Annotated[bool, typer.Option("--headless", help="Open no viewer.")] = False,
    seconds: Annotated[
        float,
        typer.Option("--seconds", metavar="S", min=5.0, max=_ENDS_AT_S, help="How much of the end of the flight."),
    ] = _SECONDS,
    archive: take.ArchiveOption = Path("sessions"),
    viewer: take.ViewerOption = None,
    serve: take.ServeOption = None,
    seed: Annotated[int, typer.Option("--seed", metavar="N", help="Of the random numbers.")] = 0,
    estimator: take.EstimatorOption = take.Estimator.kalman,
    weighting: take.WeightingOption = take.Weighting.bias,
    association: take.AssociationOption = take.Association.default,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Watch an approach come together."""
    from gateway.cli.display import Display
    from gateway.cli.simulated import SimulatedWorld
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.folder import FolderError
    from gateway.runtime.links import open_link
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import Place, RunFailure, Setup
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import LinkError, Url
    from gateway.settings import Options, format_site, parse_site

    looks = take.Viewer.none if headless else chosen(viewer)
    links: list[Link] = []
    try:
        links = [open_link(Url("udpin", "127.0.0.1")), open_link(Url("udpin", "127.0.0.1"))]
        world = SimulatedWorld(_SCENE, seed, from_s=_ENDS_AT_S - seconds, until_s=_ENDS_AT_S)
        text = format_site(world.site)
        setup = Setup(
            place=Place(parse_site(text), text, "demo"),
            options=take.choose(Options(), weighting=weighting, association=association, estimator=estimator),
            archive=archive,
            serve=take.read_serve(serve, looks),
            live=True,
            name="demo",
            command=tuple(sys.argv[1:]),
        )
        with (
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=quiet, as_json=json, fraction=world.fraction) as display,
            world.playing(links[0].url.port, links[1].url.port),
        ):
            lasts = seconds + _AFTER_S
            summary = run_live(links[:1], links[1:], setup, seconds=lasts, watch=display.watch, asked_to_stop=stop)
        display.show(summary)
    except (LinkError, FolderError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
    finally:
        for link in links:
            link.close()
