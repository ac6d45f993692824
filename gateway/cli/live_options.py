"""What `talkdown live` may be told: links to hear, what to send, whom to believe, where people declare."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError

if TYPE_CHECKING:
    from gateway.runtime.allowed import Allowed
    from gateway.runtime.declaring import Declaring
    from gateway.runtime.links import Link
    from gateway.runtime.manners import Manners
    from gateway.runtime.urls import Url

_LINKS, _SENDING, _TRUST = "Links", "What is sent", "Who is believed"

SecondsOption = Annotated[
    float | None, typer.Option("--seconds", metavar="S", min=0.0, help="End after so many seconds.", show_default=False)
]


@dataclass(frozen=True, slots=True)
class Declares:
    """How people may declare where aircraft go, and weather."""

    declared: Annotated[
        Path | None,
        typer.Option(
            "--declared",
            metavar="FILE",
            help="A TOML file that is watched: [\\[declared]] where aircraft go, [\\[weather]] to avoid.",
            show_default=False,
        ),
    ] = None
    declare_port: Annotated[
        int | None,
        typer.Option(
            "--declare-port",
            metavar="N",
            min=0,
            max=65535,
            help="Where `talkdown declare` is listened to, on this machine only; 0 takes a free port. (default: 30071)",
            show_default=False,
        ),
    ] = None

    def opened(self) -> Declaring:
        """Both, open. Raises LinkError, UsageError."""
        from gateway.runtime.declared_file import WatchedFile
        from gateway.runtime.declaring import Declaring, DeclaringPort
        from gateway.settings import SiteError

        try:
            file = None if self.declared is None else WatchedFile(self.declared)
        except SiteError as error:
            raise UsageError(str(error)) from error
        return Declaring(DeclaringPort(self.declare_port), file)


@dataclass(frozen=True, slots=True)
class Links:
    """What is listened to."""

    mavlink: Annotated[
        list[str] | None,
        typer.Option(
            "--mavlink",
            metavar="URL",
            help="A MAVLink link; may be given several times. Port 14550 if none is said.",
            show_default=False,
            rich_help_panel=_LINKS,
        ),
    ] = None
    radar: Annotated[
        list[str] | None,
        typer.Option(
            "--radar",
            metavar="URL",
            help="A landing-radar link; may be given several times. Port 30070 if none is said.",
            show_default=False,
            rich_help_panel=_LINKS,
        ),
    ] = None

    @contextlib.contextmanager
    def opened(self) -> Iterator[tuple[list[Link], list[Link]]]:
        """The links of both kinds, open while the context lasts. Raises UsageError, LinkError."""
        from gateway.runtime.links import open_link
        from gateway.runtime.urls import MAVLINK_PORT, RADAR_PORT

        with contextlib.ExitStack() as opened:

            def links(urls: Sequence[Url]) -> list[Link]:
                return [opened.enter_context(contextlib.closing(open_link(url))) for url in urls]

            mavlink = take.read_urls(self.mavlink or [], MAVLINK_PORT)
            radar = take.read_urls(self.radar or [], RADAR_PORT)
            _refuse_twice([*mavlink, *radar])
            yield links(mavlink), links(radar)


def _refuse_twice(urls: Sequence[Url]) -> None:
    """Raises UsageError where two links would have to hold one port."""
    for number, url in enumerate(urls):
        if any(url.shares_port(other) for other in urls[:number]):
            raise UsageError(f"{url}: this port is given twice; give each link of --mavlink and --radar its own.")


@dataclass(frozen=True, slots=True)
class Trust:
    """Who is believed."""

    allow_peer: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-peer",
            metavar="ADDRESS",
            help="Hear only these senders: 10.0.0.5 or 192.168.1.0/24; repeatable.",
            show_default=False,
            rich_help_panel=_TRUST,
        ),
    ] = None
    allow_system: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-system",
            metavar="N",
            help="Hear only these MAVLink system numbers: 1,2,10-20; repeatable.",
            show_default=False,
            rich_help_panel=_TRUST,
        ),
    ] = None

    def allowed(self) -> Allowed:
        """Who is heard. Raises AllowError."""
        from gateway.runtime.allowed import parse_allowed

        return parse_allowed(self.allow_peer or (), self.allow_system or ())


@dataclass(frozen=True, slots=True)
class Sending:
    """What is sent, all of it only if asked for."""

    heartbeat: Annotated[
        bool,
        typer.Option(
            "--heartbeat", help="Send a heartbeat a second, as a ground station does.", rich_help_panel=_SENDING
        ),
    ] = False
    request_rates: Annotated[
        bool,
        typer.Option(
            "--request-rates",
            help="Ask vehicles for the messages that do not come often enough.",
            rich_help_panel=_SENDING,
        ),
    ] = False
    fetch_mission: Annotated[
        bool, typer.Option("--fetch-mission", help="Read each vehicle's mission, once.", rich_help_panel=_SENDING)
    ] = False
    publish: Annotated[
        str | None,
        typer.Option(
            "--publish",
            metavar="URL",
            help="Tell the tracks as ADSB_VEHICLE to a ground station or vehicle, such as udpout:127.0.0.1:14551.",
            show_default=False,
            rich_help_panel=_SENDING,
        ),
    ] = None
    publish_system: Annotated[
        int,
        typer.Option(
            "--publish-system",
            metavar="N",
            min=1,
            max=255,
            help="As which system's ADS-B receiver; stations show traffic of vehicles that they know.",
            rich_help_panel=_SENDING,
        ),
    ] = 1
    publish_without: Annotated[
        list[str] | None,
        typer.Option(
            "--publish-without",
            metavar="AIRCRAFT",
            help="Do not tell of this one, such as mavlink:1: a vehicle that avoids traffic must not be told of itself.",
            show_default=False,
            rich_help_panel=_SENDING,
        ),
    ] = None

    def manners(self, key: bytes | None) -> Manners | None:
        """How to speak on MAVLink links, signed with a key if there is one; None = not at all."""
        from gateway.runtime.manners import Manners

        if not (self.heartbeat or self.request_rates or self.fetch_mission):
            return None
        return Manners(
            heartbeat=self.heartbeat, request_rates=self.request_rates, fetch_mission=self.fetch_mission, key=key
        )
