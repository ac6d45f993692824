"""Who may be heard: addresses of peers, and MAVLink system numbers. Without a list, everybody.

Addresses are single ones or networks: `10.0.0.5`, `192.168.1.0/24`, `::1`, `fe80::/10`. They apply to datagrams, of
MAVLink and of radars; whom a TCP or serial link hears, its URL says already. System numbers: `1,2,10-20`.

This keeps out what strayed in, not an attacker: on an open network both can be forged. Against that there is signing.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from adapters.mavlink_frames import V2

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class AllowError(ValueError):
    """A list that cannot be understood; the message is one plain sentence that says how to write it."""


@dataclass(frozen=True, slots=True)
class Allowed:
    """`peers`: networks, none of them: every peer may be heard. `systems`: MAVLink system numbers; None: all."""

    peers: tuple[Network, ...] = ()
    systems: frozenset[int] | None = None

    def hears_peer(self, peer: str) -> bool:
        """Whether the datagrams of "host:port" may be heard."""
        return not self.peers or _is_within(peer, self.peers)

    def hears_frame(self, frame: bytes) -> bool:
        """Whether a whole MAVLink frame may be heard, by its system number."""
        return self.systems is None or frame[5 if frame[0] == V2 else 3] in self.systems


@lru_cache(maxsize=1024)
def _is_within(peer: str, networks: tuple[Network, ...]) -> bool:
    try:
        address = ipaddress.ip_address(peer.rpartition(":")[0].strip("[]").partition("%")[0])
    except ValueError:
        return False
    if address.version == 6 and address.ipv4_mapped is not None:  # an IPv4 peer, as a socket for both hears it
        address = address.ipv4_mapped
    return any(address in network for network in networks)


def parse_allowed(peers: Sequence[str] = (), systems: Sequence[str] = ()) -> Allowed:
    """What texts allow; each may hold several, with commas between. No texts allow all.

    Raises AllowError: one sentence with what is wrong and how to write it.
    """
    networks = tuple(_network(one) for one in _words(peers))
    numbers = [_numbers(one) for one in _words(systems)]
    return Allowed(networks, frozenset().union(*numbers) if numbers else None)


def _words(texts: Sequence[str]) -> list[str]:
    return [word.strip() for text in texts for word in text.split(",")]


def _network(text: str) -> Network:
    try:
        return ipaddress.ip_network(text.strip("[]"), strict=False)
    except ValueError as error:
        example = "an address such as 10.0.0.5 or a network such as 192.168.1.0/24, in numbers and without a port"
        raise AllowError(f"{text!r} is not a peer that can be allowed; write {example}.") from error


def _numbers(text: str) -> frozenset[int]:
    first, dash, last = text.partition("-")
    if first.strip().isdecimal() and (not dash or last.strip().isdecimal()):
        low, high = int(first), int(last if dash else first)
        if 1 <= low <= high <= 255:
            return frozenset(range(low, high + 1))
    raise AllowError(
        f"{text!r} is not a MAVLink system that can be allowed; write numbers from 1 to 255, such as 1,2,10-20."
    )
