"""Links: where bytes come in. UDP, TCP client, serial; none of them blocks, none of them sends telemetry.

A link answers three questions: what it can be waited on by (`fileno`), what has come in (`receive`), and how it is
doing (`counters`). The gateway is passive; the one thing that a link ever sends is the empty datagram of a `udpout`
link, once a second until its peer answers: it carries no MAVLink, and without it the peer could not know where we are.
"""

from __future__ import annotations

import errno
import socket
import struct
import sys
from collections import Counter
from dataclasses import dataclass
from typing import Protocol

from gateway.runtime.urls import LinkError, Url, bracketed

RECEIVE_BUFFER_BYTES = 4 << 20
_LARGEST_DATAGRAM = 65_535
_DATAGRAMS_A_TURN = 512  # then the other links have theirs
_LINUX = sys.platform == "linux"
_SO_TIMESTAMPNS = 35 if _LINUX else None  # not in Python's socket module; the kernel's time of arrival
_SO_RXQ_OVFL = 40 if _LINUX else None  # not in Python's socket module; datagrams that the kernel had to drop
_ANCILLARY_BYTES = 128
_HELLO_EVERY_NS = 1_000_000_000
_SILENT_AFTER_NS = 5_000_000_000


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes that came in at once: a datagram, or a piece of a stream.

    `peer` tells senders of one link apart; `stream` numbers the connections of a byte stream (None: a datagram);
    `kernel_utc_ns` is the kernel's time of arrival where the platform tells it.
    """

    peer: str
    data: bytes
    stream: int | None
    kernel_utc_ns: int | None


class Link(Protocol):
    """What the receiver asks of a link."""

    url: Url
    counters: Counter[str]
    news: list[tuple[str, str]]  # (level, text) to be told once

    def fileno(self) -> int | None:
        """What to wait on, or None: closed at the moment, or to be asked at every turn."""

    def receive(self) -> list[Chunk]:
        """What has come in; never waits."""

    def tend(self, now_ns: int) -> None:
        """Do what is due: say hello, connect again."""

    def close(self) -> None:
        """Let go of the port."""


def open_link(url: Url) -> Link:
    """The open link.

    Raises LinkError: one sentence with what is in the way and what to do.
    """
    if url.scheme in ("udpin", "udpout"):
        return UdpLink(url)
    from gateway.runtime.streams import SerialLink, TcpLink

    return TcpLink(url) if url.scheme == "tcp" else SerialLink(url)


def resolve(url: Url, kind: socket.SocketKind) -> tuple[socket.AddressFamily, tuple[str, int]]:
    """The address family and address of a URL's host.

    Raises LinkError when the host has no address.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(url.host, url.port, type=kind)[0]
    except (socket.gaierror, UnicodeError) as error:
        raise LinkError(f"{url}: there is no host {url.host!r} to be found; write its address in numbers.") from error
    return family, (str(address[0]), int(address[1]))


class UdpLink:
    """A UDP socket: listening (udpin), or calling on one peer (udpout)."""

    def __init__(self, url: Url) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self.news: list[tuple[str, str]] = []
        self._dropped = 0
        self._hello_due_ns = 0
        self._heard = False
        family, self._address = resolve(url, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            self.granted_bytes = self._configure()
            if url.scheme == "udpin":
                self._socket.bind(self._address)
                host, port = self._socket.getsockname()[:2]
                self.url = Url("udpin", str(host), int(port))
            else:
                self._socket.connect(self._address)  # from now on the kernel refuses what others send
        except OSError as error:
            self._socket.close()
            raise LinkError(_why_not(url, error)) from error

    def _configure(self) -> int:
        """Ask for what helps, and read back what was granted: the receive buffer in bytes."""
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        granted = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        if _LINUX:
            granted //= 2  # Linux tells twice what it gives, the other half is its own book-keeping
        for option in (_SO_TIMESTAMPNS, _SO_RXQ_OVFL):
            if option is not None:
                try:
                    self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
                except OSError:
                    self.counters[f"no socket option {option}"] += 1
        if granted < RECEIVE_BUFFER_BYTES:
            advice = ", raise net.core.rmem_max to change that" if _LINUX else ""
            kib = granted >> 10
            self.news.append(("info", f"{self.url}: receive buffer of {kib} KiB instead of 4096 KiB{advice}."))
        return granted

    def fileno(self) -> int | None:
        """The socket's descriptor, or None once closed."""
        number = self._socket.fileno()
        return number if number >= 0 else None

    def receive(self) -> list[Chunk]:
        """The datagrams that wait, at most a turn's worth."""
        chunks: list[Chunk] = []
        for _ in range(_DATAGRAMS_A_TURN):
            try:
                data, kernel_utc_ns, peer = self._one_datagram()
            except (BlockingIOError, InterruptedError):
                break
            except OSError as error:  # "nobody there" in answer to a hello, or a network that went away
                self.counters[f"socket error {errno.errorcode.get(error.errno or 0, 'unknown')}"] += 1
                break
            self._heard = True
            chunks.append(Chunk(peer, data, None, kernel_utc_ns))
        return chunks

    def _one_datagram(self) -> tuple[bytes, int | None, str]:
        if not _LINUX:
            data, address = self._socket.recvfrom(_LARGEST_DATAGRAM)
            return data, None, _named(address)
        data, ancillary, _, address = self._socket.recvmsg(_LARGEST_DATAGRAM, _ANCILLARY_BYTES)
        kernel_utc_ns: int | None = None
        for level, kind, content in ancillary:
            if level != socket.SOL_SOCKET:
                continue
            if kind == _SO_TIMESTAMPNS and len(content) == 16:
                seconds, nanoseconds = struct.unpack("@qq", content)
                kernel_utc_ns = seconds * 1_000_000_000 + nanoseconds
            elif kind == _SO_RXQ_OVFL and len(content) == 4:
                (dropped,) = struct.unpack("@I", content)
                if not self._dropped:
                    self.news.append(("error", f"{self.url}: datagrams were lost before we could read them (counted)."))
                self.counters["dropped by the kernel"] += (dropped - self._dropped) % (1 << 32)
                self._dropped = dropped
        return data, kernel_utc_ns, _named(address) if address else str(self.url)

    def tend(self, now_ns: int) -> None:
        """On a udpout link: an empty datagram a second until the peer answers, and again when it falls silent."""
        if self.url.scheme != "udpout" or now_ns < self._hello_due_ns:
            return
        if not self._heard:
            try:
                self._socket.send(b"")
                self.counters["empty datagrams sent"] += 1
            except OSError as error:
                self.counters[f"socket error {errno.errorcode.get(error.errno or 0, 'unknown')}"] += 1
        self._hello_due_ns = now_ns + (_SILENT_AFTER_NS if self._heard else _HELLO_EVERY_NS)
        self._heard = False

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()


def _named(address: tuple[object, ...]) -> str:
    return f"{bracketed(str(address[0]))}:{address[1]}"


def _why_not(url: Url, error: OSError) -> str:
    """Why a UDP port cannot be had, and what to do about it."""
    if error.errno == errno.EADDRINUSE:
        return (
            f"{url}: another program has this port already; close it (a ground station, another talkdown), "
            f"or have it forward to another port and listen there."
        )
    if error.errno == errno.EACCES:
        return f"{url}: this port may only be used by the administrator; choose one from 1024 up."
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{url}: this machine has no address {url.host}; listen on 0.0.0.0 for all that it has."
    return f"{url}: cannot be opened: {(error.strerror or str(error)).lower()}."
