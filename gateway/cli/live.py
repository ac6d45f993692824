"""`talkdown live`: fuse what comes in now."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
from gateway.cli.replay import read_plans

if TYPE_CHECKING:
    from gateway.runtime.links import Link

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

_LINKS, _SENDING, _TRUST = "Links", "What is sent", "Who is believed"

MavlinkOption = Annotated[
    list[str] | None,
    typer.Option(
        "--mavlink",
        metavar="URL",
        help="A MAVLink link; may be given several times. Port 14550 if none is said.",
        show_default=False,
        rich_help_panel=_LINKS,
    ),
]
RadarOption = Annotated[
    list[str] | None,
    typer.Option(
        "--radar",
        metavar="URL",
        help="A landing-radar link; may be given several times. Port 30070 if none is said.",
        show_default=False,
        rich_help_panel=_LINKS,
    ),
]
SecondsOption = Annotated[
    float | None, typer.Option("--seconds", metavar="S", min=0.0, help="End after so many seconds.", show_default=False)
]

PlanOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="[VEHICLE=]FILE",
        help="A mission file (.plan, QGC WPL 110), and whose it is, such as mavlink:2=circuit.plan; repeatable.",
        show_default=False,
    ),
]
AllowPeerOption = Annotated[
    list[str] | None,
    typer.Option(
        "--allow-peer",
        metavar="ADDRESS",
        help="Hear only these senders: 10.0.0.5 or 192.168.1.0/24; repeatable.",
        show_default=False,
        rich_help_panel=_TRUST,
    ),
]
AllowSystemOption = Annotated[
    list[str] | None,
    typer.Option(
        "--allow-system",
        metavar="N",
        help="Hear only these MAVLink system numbers: 1,2,10-20; repeatable.",
        show_default=False,
        rich_help_panel=_TRUST,
    ),
]
HeartbeatOption = Annotated[
    bool,
    typer.Option("--heartbeat", help="Send a heartbeat a second, as a ground station does.", rich_help_panel=_SENDING),
]
RatesOption = Annotated[
    bool,
    typer.Option(
        "--request-rates", help="Ask vehicles for the messages that do not come often enough.", rich_help_panel=_SENDING
    ),
]
MissionOption = Annotated[
    bool, typer.Option("--fetch-mission", help="Read each vehicle's mission, once.", rich_help_panel=_SENDING)
]
PublishOption = Annotated[
    str | None,
    typer.Option(
        "--publish",
        metavar="URL",
        help="Tell the tracks as ADSB_VEHICLE to a ground station or vehicle, such as udpout:127.0.0.1:14551.",
        show_default=False,
        rich_help_panel=_SENDING,
    ),
]
PublishSystemOption = Annotated[
    int,
    typer.Option(
        "--publish-system",
        metavar="N",
        min=1,
        max=255,
        help="As which system's ADS-B receiver; stations show traffic of vehicles that they know.",
        rich_help_panel=_SENDING,
    ),
]
LeaveOutOption = Annotated[
    list[str] | None,
    typer.Option(
        "--publish-without",
        metavar="AIRCRAFT",
        help="Do not tell of this one, such as mavlink:1: a vehicle that avoids traffic must not be told of itself.",
        show_default=False,
        rich_help_panel=_SENDING,
    ),
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("live", help=_HELP)(live)


def buffer_of(link: Link) -> str:
    """What the system granted for a burst; it may be less than was asked for, and says so nowhere else."""
    from gateway.runtime.udp import UdpLink

    return f" The system holds {link.granted_bytes // 1024} KiB for it." if isinstance(link, UdpLink) else ""


@contextlib.contextmanager
def _opened(mavlink: list[str], radar: list[str]) -> Iterator[tuple[list[Link], list[Link]]]:
    """The links of both kinds, open while the context lasts. Raises UsageError, LinkError."""
    from gateway.runtime.links import open_link
    from gateway.runtime.urls import MAVLINK_PORT, RADAR_PORT

    with contextlib.ExitStack() as opened:

        def links(texts: list[str], port: int) -> list[Link]:
            return [opened.enter_context(contextlib.closing(open_link(url))) for url in take.read_urls(texts, port)]

        yield links(mavlink, MAVLINK_PORT), links(radar, RADAR_PORT)


def live(
    mavlink: MavlinkOption = None,
    radar: RadarOption = None,
    site: take.SiteOption = None,
    viewer: take.ViewerOption = None,
    serve: take.ServeOption = None,
    archive: take.ArchiveOption = None,
    seconds: SecondsOption = None,
    plan: PlanOption = None,
    estimator: take.EstimatorOption = take.Estimator.kalman,
    weighting: take.WeightingOption = take.Weighting.bias,
    association: take.AssociationOption = take.Association.default,
    registration: take.RegistrationOption = take.Registration.apply,
    key: take.KeyOption = None,
    allow_peer: AllowPeerOption = None,
    allow_system: AllowSystemOption = None,
    heartbeat: HeartbeatOption = False,
    request_rates: RatesOption = False,
    fetch_mission: MissionOption = False,
    publish: PublishOption = None,
    publish_system: PublishSystemOption = 1,
    publish_without: LeaveOutOption = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Fuse what comes in now."""
    if not mavlink and not radar:
        raise UsageError("live needs something to listen to: give --mavlink udpin:0.0.0.0:14550, or --radar, or both.")
    from adapters.files import FileError
    from gateway.cli.display import Display
    from gateway.cli.viewing import Viewing, chosen
    from gateway.runtime.allowed import AllowError, parse_allowed
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_live
    from gateway.runtime.manners import Manners
    from gateway.runtime.setup import RunFailure, Setup
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.told_plans import told_line
    from gateway.runtime.urls import MAVLINK_PORT, LinkError

    place = take.read_place(site)
    looks = chosen(viewer)
    signing_key = take.read_signing_key(key)
    setup = Setup(
        place=place,
        options=take.choose(weighting, association, estimator, registration),
        archive=archive,
        serve=take.read_serve(serve, looks),
        publish=take.read_urls([publish], MAVLINK_PORT)[0] if publish else None,
        publish_system=publish_system,
        publish_leave_out=frozenset(publish_without or ()),
        keys=take.read_keys(place, site),
        signing_key=signing_key,
        live=True,
        takes_up=registration is not take.Registration.off,
        command=tuple(sys.argv[1:]),
    )
    speaks = heartbeat or request_rates or fetch_mission
    manners = Manners(heartbeat=heartbeat, request_rates=request_rates, fetch_mission=fetch_mission, key=signing_key)
    try:
        allowed = parse_allowed(allow_peer or (), allow_system or ())
        told = [told_line(path, vehicle) for vehicle, path in read_plans(plan)]
        with (
            _opened(mavlink or [], radar or []) as links,
            StopSignals() as stop,
            Viewing(looks) as viewing,
            Display(viewing, quiet=quiet, as_json=json) as display,
        ):
            for link in (*links[0], *links[1]):
                display.say(f"Listening on {link.url}.{buffer_of(link)}")
            summary = run_live(
                *links,
                setup,
                seconds=seconds,
                watch=display.watch,
                asked_to_stop=stop,
                allowed=allowed,
                manners=manners if speaks else None,
                told=told,
            )
        display.show(summary)
    except (LinkError, FolderError, AllowError, FileError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
