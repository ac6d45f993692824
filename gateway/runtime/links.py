"""Links: where bytes come in. UDP, TCP client, serial; none of them blocks, none of them sends unless it is told to.

A link answers three questions: what it can be waited on by (`fileno`), what has come in (`receive`), and how it is
doing (`counters`).
"""

from __future__ import annotations

import socket
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gateway.runtime.urls import LinkError, Url

RECEIVE_BUFFER_BYTES = 4 << 20


@dataclass(frozen=True, slots=True)
class Chunks:
    """What one link has heard at once, in columns, because tens of thousands a second come: datagrams, or pieces of a stream.

    `sender` tells the senders of one link apart, and `names` names them; `kernel_utc_ns` is the kernel's time of arrival,
    0 where the platform does not tell it; `stream` numbers the connections of a byte stream (None: datagrams).
    """

    data: list[bytes]
    sender: NDArray[np.int64]
    names: Mapping[int, str]
    kernel_utc_ns: NDArray[np.int64]
    stream: int | None = None

    @classmethod
    def of(cls, peers: Sequence[str], data: list[bytes], kernel: Sequence[int], stream: int | None = None) -> Chunks:
        """The same from lists: the sender's name and the kernel's time (or 0) of each."""
        numbers = {name: number for number, name in enumerate(dict.fromkeys(peers))}
        sender = np.fromiter((numbers[name] for name in peers), np.int64, len(peers))
        return cls(data, sender, dict(enumerate(numbers)), np.array(kernel, np.int64), stream)

    @classmethod
    def joined(cls, parts: Sequence[Chunks]) -> Chunks:
        """Some after the others, in one: of one link, whose senders keep their numbers, and one connection at most."""
        if not parts:
            return cls.of((), [], ())
        if len(parts) == 1:
            return parts[0]
        names = parts[0].names
        if any(part.names is not names for part in parts):
            names = {number: name for part in parts for number, name in part.names.items()}
        return cls(
            [one for part in parts for one in part.data],
            np.concatenate([part.sender for part in parts]),
            names,
            np.concatenate([part.kernel_utc_ns for part in parts]),
            parts[0].stream,
        )

    @property
    def peers(self) -> list[str]:
        """The name of each one's sender."""
        return [self.names[number] for number in self.sender.tolist()]


class Link(Protocol):
    """What the receiver asks of a link."""

    url: Url
    counters: Counter[str]
    news: list[tuple[str, str]]  # (level, text) to be told once

    @property
    def patience_s(self) -> float:
        """How long what comes in can wait for us, at any rate that we can keep up with, s."""

    def fileno(self) -> int | None:
        """What to wait on, or None: closed at the moment, or to be asked at every turn."""

    def receive(self) -> Chunks:
        """What has come in; never waits."""

    def send(self, data: bytes, peer: str | None) -> bool:
        """Send to a peer (the name that its chunks have; None: the link's only one); never waits.

        What cannot be sent at once is dropped, counted as "not sent", and False.
        """

    def tend(self, now_ns: int) -> None:
        """Do what is due: say hello, connect again."""

    def finish(self) -> None:
        """Have all that has come in ready for `receive`, which is asked a last few times."""

    def close(self) -> None:
        """Let go of the port."""


def open_link(
    url: Url, receive_buffer_bytes: int | None = RECEIVE_BUFFER_BYTES, *, is_drained: bool | None = None
) -> Link:
    """The open link. The receive buffer is what a UDP link asks for; None leaves it as the system makes it.

    `is_drained`: whether a process of its own empties a UDP link's socket; None: where the buffer is small (Linux).

    Raises LinkError: one sentence with what is in the way and what to do.
    """
    if url.scheme in ("udpin", "udpout"):
        from gateway.runtime.udp import UdpLink

        return UdpLink(url, receive_buffer_bytes, is_drained=is_drained)
    from gateway.runtime.streams import SerialLink, TcpLink

    return TcpLink(url) if url.scheme == "tcp" else SerialLink(url)


def resolve(url: Url, kind: socket.SocketKind) -> tuple[socket.AddressFamily, tuple[str, int]]:
    """The address family and address of a URL's host: the first of `addresses`."""
    return addresses(url, kind)[0]


def addresses(url: Url, kind: socket.SocketKind) -> list[tuple[socket.AddressFamily, tuple[str, int]]]:
    """Every address of a URL's host, IPv4 first: where a name has both, MAVLink programs listen there.

    Raises LinkError when the host has none.
    """
    try:
        found = socket.getaddrinfo(url.host, url.port, type=kind)
    except (socket.gaierror, UnicodeError) as error:
        raise LinkError(f"{url}: there is no host {url.host!r} to be found; write its address in numbers.") from error
    ordered = sorted(found, key=lambda one: one[0] != socket.AF_INET)
    return [(family, (str(address[0]), int(address[1]))) for family, _, _, _, address in ordered]
