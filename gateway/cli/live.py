"""`talkdown live`: fuse what comes in now."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
from gateway.cli.live_options import Declares, Links, SecondsOption, Sending, Trust
from gateway.cli.replay_options import PlanOption, read_plans
from gateway.cli.spread import spread

if TYPE_CHECKING:
    from gateway.cli.display import Display
    from gateway.runtime.declaring import Declaring
    from gateway.runtime.links import Link
    from gateway.runtime.setup import Setup

_HELP = """
Fuse what aircraft and radars say now: align, associate, fuse, predict, draw, archive.

Links: [bold]udpin:0.0.0.0:14550[/] listens, [bold]tcp:127.0.0.1:5760[/] connects, [bold]serial:/dev/ttyUSB0:57600[/]
opens a radio. [bold]udpout:HOST:PORT[/] calls on a server with one empty datagram a second until it answers.

Nothing else is sent, unless --heartbeat, --request-rates, --fetch-mission or --publish ask for it.

Examples:

  talkdown live --mavlink udpin:0.0.0.0:14550 --radar udpin:0.0.0.0:30070 --site field.toml --archive sessions

  talkdown live --mavlink udpin:0.0.0.0:14550 --estimator alpha-beta-gamma

  talkdown live --mavlink tcp:127.0.0.1:5760 --heartbeat --request-rates --fetch-mission --viewer web

  talkdown live --mavlink serial:/dev/ttyUSB0:57600 --key link.key --publish udpout:127.0.0.1:14551
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("live", help=_HELP)(spread(live))


def buffer_of(link: Link) -> str:
    """What the system granted for a burst; it may be less than was asked for, and says so nowhere else."""
    from gateway.runtime.udp import UdpLink

    return f" The system holds {link.granted_bytes // 1024} KiB for it." if isinstance(link, UdpLink) else ""


def live(
    links: Links,
    site: take.SiteOption = None,
    seen: take.Seen = take.Seen(),
    seconds: SecondsOption = None,
    plan: PlanOption = None,
    declares: Declares = Declares(),
    methods: take.Methods = take.Methods(),
    key: take.KeyOption = None,
    trust: Trust = Trust(),
    sending: Sending = Sending(),
    telling: take.Telling = take.Telling(),
) -> None:
    """Fuse what comes in now."""
    if not links.mavlink and not links.radar:
        raise UsageError("live needs something to listen to: give --mavlink udpin:0.0.0.0:14550, or --radar, or both.")
    from adapters.files import FileError
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.allowed import AllowError
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import RunFailure
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.told_plans import told_line
    from gateway.runtime.urls import LinkError

    signing_key, looks = take.read_signing_key(key), chosen(seen.viewer)
    setup = _setup(site, replace(seen, viewer=looks), methods, sending, signing_key)
    try:
        allowed = trust.allowed()
        told = [told_line(path, vehicle) for vehicle, path in read_plans(plan)]
        with (
            links.opened() as opened,
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=telling.quiet, as_json=telling.json) as display,
        ):
            declaring = declares.opened()
            _say_where(display, (*opened[0], *opened[1]), declaring)
            summary = run_live(
                *opened,
                setup,
                seconds=seconds,
                watch=display.watch,
                asked_to_stop=stop,
                allowed=allowed,
                manners=sending.manners(signing_key),
                told=told,
                declaring=declaring,
            )
        display.show(summary)
    except (LinkError, FolderError, AllowError, FileError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure


def _say_where(display: Display, links: Sequence[Link], declaring: Declaring) -> None:
    """What is listened on."""
    for link in links:
        display.say(f"Listening on {link.url}.{buffer_of(link)}")
    if declaring.port is not None:
        display.say(f"Declarations on port {declaring.port.port} of this machine.")


def _setup(
    site: Path | None, seen: take.Seen, methods: take.Methods, sending: Sending, signing_key: bytes | None
) -> Setup:
    """What a live session is made of. Raises UsageError."""
    from gateway.runtime.setup import Setup
    from gateway.runtime.urls import MAVLINK_PORT

    place = take.read_place(site)
    return Setup(
        place=place,
        options=methods.options(),
        archive=seen.archive,
        serve=take.read_serve(seen.serve, seen.viewer or take.Viewer.none),
        publish=take.read_urls([sending.publish], MAVLINK_PORT)[0] if sending.publish else None,
        publish_system=sending.publish_system,
        publish_leave_out=frozenset(sending.publish_without or ()),
        keys=take.read_keys(place, site),
        signing_key=signing_key,
        live=True,
        flows=take.read_flows(methods.flows),
        takes_up=methods.registration is not take.Registration.off,
        command=tuple(sys.argv[1:]),
    )
