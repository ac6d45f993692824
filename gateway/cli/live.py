"""`talkdown live`: fuse what comes in now."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.runtime.links import Link

_HELP = """
Fuse what aircraft and radars say now: align, associate, fuse, predict, draw, archive.

Links: [bold]udpin:0.0.0.0:14550[/] listens, [bold]tcp:127.0.0.1:5760[/] connects, [bold]serial:/dev/ttyUSB0:57600[/]
opens a radio. [bold]udpout:HOST:PORT[/] calls on a server with one empty datagram a second until it answers; nothing
else is ever sent.

Examples:

  talkdown live --mavlink udpin:0.0.0.0:14550 --radar udpin:0.0.0.0:30070 --site field.toml --archive sessions

  talkdown live --mavlink tcp:127.0.0.1:5760 --viewer web
"""

MavlinkOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mavlink",
        metavar="URL",
        help="A MAVLink link; may be given several times. Port 14550 if none is said.",
        show_default=False,
    ),
]
RadarOption = Annotated[
    list[str] | None,
    typer.Option(
        "--radar",
        metavar="URL",
        help="A landing-radar link; may be given several times. Port 30070 if none is said.",
        show_default=False,
    ),
]
SecondsOption = Annotated[
    float | None, typer.Option("--seconds", metavar="S", min=0.0, help="End after so many seconds.", show_default=False)
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("live", help=_HELP)(live)


def buffer_of(link: Link) -> str:
    """What the system granted for a burst; it may be less than was asked for, and says so nowhere else."""
    from gateway.runtime.links import UdpLink

    return f" The system holds {link.granted_bytes // 1024} KiB for it." if isinstance(link, UdpLink) else ""


def live(
    mavlink: MavlinkOption = None,
    radar: RadarOption = None,
    site: take.SiteOption = None,
    viewer: take.ViewerOption = None,
    serve: take.ServeOption = None,
    archive: take.ArchiveOption = None,
    seconds: SecondsOption = None,
    weighting: take.WeightingOption = take.Weighting.bias,
    association: take.AssociationOption = take.Association.default,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Fuse what comes in now."""
    if not mavlink and not radar:
        raise UsageError("live needs something to listen to: give --mavlink udpin:0.0.0.0:14550, or --radar, or both.")
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.folder import FolderError
    from gateway.runtime.links import open_link
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import RunFailure, Setup
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import MAVLINK_PORT, RADAR_PORT, LinkError

    place = take.read_place(site)
    looks = chosen(viewer)
    setup = Setup(
        place=place,
        options=take.choose(weighting, association),
        archive=archive,
        serve=take.read_serve(serve, looks),
        keys=take.read_keys(place, site),
        live=True,
        command=tuple(sys.argv[1:]),
    )
    links: list[list[Link]] = [[], []]
    try:
        for group, texts, port in ((0, mavlink, MAVLINK_PORT), (1, radar, RADAR_PORT)):
            for url in take.read_urls(texts or [], port):
                links[group].append(open_link(url))
        with StopSignals() as stop, Viewing(looks) as viewing, Display(viewing, quiet=quiet, as_json=json) as display:
            for link in (*links[0], *links[1]):
                display.say(f"Listening on {link.url}.{buffer_of(link)}")
            summary = run_live(links[0], links[1], setup, seconds=seconds, watch=display.watch, asked_to_stop=stop)
        display.show(summary)
    except (LinkError, FolderError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
    finally:
        for link in (*links[0], *links[1]):
            link.close()
