"""Where a link leads, written as MAVLink people write it: `udpin:0.0.0.0:14550`, `tcp:127.0.0.1:5760`.

udpin:HOST:PORT     listen; any number of peers may send to us
udpout:HOST:PORT    send to a peer (play, simulate), or call on one and hear what it answers (live)
tcp:HOST:PORT       connect as a client
serial:DEVICE:BAUD  a radio or an autopilot on a serial port
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

Scheme = Literal["udpin", "udpout", "tcp", "serial"]

MAVLINK_PORT = 14550
RADAR_PORT = 30070
_EVERYWHERE = ("0.0.0.0", "::")  # hosts that stand for all of this machine's

_EXAMPLES = "udpin:0.0.0.0:14550, udpout:127.0.0.1:14550, tcp:127.0.0.1:5760 or serial:/dev/ttyUSB0:57600"


class LinkError(ValueError):
    """A link that cannot be used; the message is one plain sentence that says what to do."""


@dataclass(frozen=True, slots=True)
class Url:
    """One end of a link. A network link has host and port, a serial one device and baud."""

    scheme: Scheme
    host: str = ""
    port: int = 0
    device: str = ""
    baud: int = 0

    def shares_port(self, other: Url) -> bool:
        """Whether both would have to hold one port of this machine, which only one of them can."""
        if self.scheme != other.scheme or self.scheme not in ("udpin", "serial"):
            return False
        if self.scheme == "serial":
            return self.device == other.device
        hosts = {self.host, other.host}
        return self.port == other.port != 0 and (len(hosts) == 1 or not hosts.isdisjoint(_EVERYWHERE))

    def __str__(self) -> str:
        if self.scheme == "serial":
            return f"serial:{self.device}:{self.baud}"
        return f"{self.scheme}:{bracketed(self.host)}:{self.port}"


def bracketed(host: str) -> str:
    """The host as it stands before a port: an IPv6 address in brackets."""
    return f"[{host}]" if ":" in host else host


def parse_url(text: str, default_port: int = MAVLINK_PORT) -> Url:
    """The link that a text describes.

    Raises LinkError: one sentence with what is wrong and how to write it.
    """
    scheme, colon, rest = text.strip().partition(":")
    rest = rest.removeprefix("//")
    if not colon or scheme not in ("udpin", "udpout", "tcp", "serial"):
        raise LinkError(f"{text!r} is not a link{_meant(text, scheme)}.")
    if scheme == "serial":
        return _serial(text, rest)
    host, port = _host_and_port(text, rest, default_port)
    if scheme == "udpin":
        return Url("udpin", host or "0.0.0.0", port)
    if not host:
        raise LinkError(
            f"{text!r} does not say where to: write {scheme}:HOST:PORT, such as {scheme}:127.0.0.1:{default_port}."
        )
    if port == 0:
        raise LinkError(f"{text!r} has the port 0, where nobody can be; write a port from 1 to 65535.")
    return Url("udpout" if scheme == "udpout" else "tcp", host, port)


def _meant(text: str, scheme: str) -> str:
    """What the writer may have meant."""
    if text.startswith("/dev/") or re.match(r"COM\d+", text):
        device = text.split(":")[0]
        return f"; for a serial port write serial:{device}:57600"
    if scheme == "udp":
        rest = text.partition(":")[2].removeprefix("//")
        return f"; write udpin:{rest} to listen there, or udpout:{rest} to send to there"
    if scheme == "tcpin":
        return "; Talkdown connects to a TCP server, it is none: write tcp:HOST:PORT"
    return f"; write one such as {_EXAMPLES}"


def _serial(text: str, rest: str) -> Url:
    device, _, baud = rest.rpartition(":")
    if device and baud.isdigit():
        return Url("serial", device=device, baud=int(baud))
    if rest and not rest.rpartition(":")[2].isdigit() and ":" not in rest:
        return Url("serial", device=rest, baud=57600)
    raise LinkError(f"{text!r} is not a serial port; write serial:DEVICE:BAUD, such as serial:/dev/ttyUSB0:57600.")


def _host_and_port(text: str, rest: str, default_port: int) -> tuple[str, int]:
    shape = re.fullmatch(r"(?:\[(?P<six>[^\]]+)\]|(?P<host>[^:\[\]]*))(?::(?P<port>[^:]*))?", rest)
    if shape is None:
        raise LinkError(
            f"{text!r} is not HOST:PORT; put an IPv6 address in brackets, such as udpin:[::1]:{default_port}."
        )
    host, port = shape["six"] or shape["host"] or "", shape["port"]
    if port is None and host.isdigit():
        host, port = "", host
    if not port:
        return host, default_port
    if not port.isdigit() or int(port) > 65535:
        raise LinkError(f"{text!r}: the port {port!r} is not a whole number from 0 to 65535.")
    return host, int(port)
