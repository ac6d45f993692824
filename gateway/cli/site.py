"""`talkdown site`: a site file to start from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from adapters import Arrival, Source
    from gateway.runtime.setup import Place

_HELP = """
Print a site file for a recording or a live link, to be edited: the runway from home, the mission's landing or where an
aircraft stands.

Examples:

  talkdown site flight.tlog > field.toml

  talkdown site flight.BIN > field.toml

  talkdown site udpin:0.0.0.0:14550 --seconds 30 > field.toml
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("site", help=_HELP)(site)


def site(
    source: Annotated[
        str, typer.Argument(metavar="FILE|URL", help="A recording, or a MAVLink link.", show_default=False)
    ],
    seconds: Annotated[
        float, typer.Option("--seconds", metavar="S", min=1.0, help="How long to listen to a link.")
    ] = 20.0,
) -> None:
    """Print a site file."""
    from adapters.files import FileError
    from gateway.runtime.folder import FolderError
    from gateway.runtime.urls import LinkError

    is_link = (
        source.partition(":")[0] in ("udp", "udpin", "udpout", "tcp", "tcpin", "serial") and not Path(source).exists()
    )
    try:
        place = _of_link(source, seconds) if is_link else _of_file(Path(source))
    except (FileError, FolderError, LinkError) as error:
        raise UsageError(str(error)) from error
    if place is None:
        raise RunError(
            f"Nothing in {source} tells where the runway is: no HOME_POSITION, no mission with a landing, nobody standing."
        )
    print(f"# Proposed from {place.origin}. Check the direction, the height and the radars before use.")
    print(place.text, end="")


def _of_file(path: Path) -> Place | None:
    from gateway.runtime.playback import open_playback

    playback = open_playback([path])
    return playback.place or playback.find_place()


def _of_link(text: str, seconds: float) -> Place | None:
    import time

    from gateway.runtime.links import open_link
    from gateway.runtime.places import PlaceFinder
    from gateway.runtime.receiver import Receiver
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import parse_url

    receiver = Receiver([open_link(parse_url(text))], [])
    receiver.start()
    sources: list[Source] = []
    arrivals: list[Arrival] = []
    until = time.monotonic() + seconds
    try:
        with StopSignals() as stop:
            while time.monotonic() < until and not stop():
                time.sleep(0.1)
                delivery = receiver.drain()
                sources += delivery.sources
                arrivals += delivery.arrivals
    finally:
        receiver.close()
    return PlaceFinder().search(sources, arrivals)
