"""Bytes to observations and back: knows wires, knows no mathematics of the picture. One wire format, one file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

DISTRIBUTION = (
    "talkdown"  # another distribution on PyPI installs a package of this name; the program checks this at start
)


Kind = Literal["mavlink", "radar", "told"]


@dataclass(frozen=True, slots=True)
class Source:
    """One peer on one link: a MAVLink peer, or a radar link; or what people tell the gateway ("told").

    `number` orders simultaneous arrivals and never changes.
    """

    number: int
    kind: Kind
    name: str  # file stem in a session's inputs/, unique in the session
    origin: str  # what people call it: a URL, a peer's address or a file


class Arrival(NamedTuple):
    """One MAVLink frame, radar datagram or told line, with the receiver's stamp: ns since 1970 UTC, a multiple of 4000.

    What is told is one JSON object a line, without the line's end. A NamedTuple, because hundreds of thousands a second
    are made.
    """

    received_at: int
    source: int
    data: bytes
    peer: str = ""  # who sent it ("host:port"), on a link that hears several; kept in a session's .pcap
