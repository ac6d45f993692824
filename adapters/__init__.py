"""Bytes to observations and back: knows wires, knows no mathematics of the picture. One wire format, one file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

DISTRIBUTION = (
    "talkdown"  # another distribution on PyPI installs a package of this name; the program checks this at start
)


@dataclass(frozen=True, slots=True)
class Source:
    """One peer on one link: a MAVLink peer, or a radar link. `number` orders simultaneous arrivals and never changes."""

    number: int
    kind: Literal["mavlink", "radar"]
    name: str  # file stem in a session's inputs/, unique in the session
    origin: str  # what people call it: a URL, a peer's address or a file


@dataclass(frozen=True, slots=True)
class Arrival:
    """One frame (MAVLink) or one datagram (radar), with the receiver's stamp: ns since 1970 UTC, a multiple of 4000."""

    received_at: int
    source: int
    data: bytes
    peer: str = ""  # who sent it ("host:port"), on a link that hears several; kept in a session's .pcap
