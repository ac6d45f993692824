"""The link that tracks are published on. It never waits: what the other side does not take at once is dropped, counted.

udpout sends to one place; udpin answers everybody who has spoken to us in the last minute, whatever they said; tcp and
serial send to the other end, and open again by themselves. What comes in is not listened to.
"""

from __future__ import annotations

import errno
import select
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Protocol

from adapters.reasons import reason_of
from gateway.runtime.links import resolve
from gateway.runtime.urls import LinkError, Url

_LISTENERS = 32  # more cannot be meant: each of them costs every frame once more
_LISTENER_NS = 60_000_000_000
_DATAGRAMS_A_TURN = 64
_WAITING_FRAMES = 256  # of a stream whose other end is slow: about three seconds of a radio of 57600 baud
_RETRY_NS = 2_000_000_000
_CONNECT_TIMEOUT_S = 5.0
_BLOCKED = (errno.EAGAIN, errno.EWOULDBLOCK, errno.EINTR, errno.ENOBUFS, errno.EINPROGRESS, errno.ENOTCONN)

SENT, NOT_SENT = "publish: frames sent", "publish: frames not sent"


class Publisher(Protocol):
    """One open link to publish on."""

    url: Url
    counters: Counter[str]

    def send(self, frame: bytes) -> None:
        """Send one frame or count it as not sent; never waits, never raises."""

    def close(self) -> None:
        """Let go of the port."""


def open_publisher(url: Url) -> Publisher:
    """The open link.

    Raises LinkError: one sentence with what is in the way and what to do.
    """
    try:
        if url.scheme in ("udpin", "udpout"):
            return UdpPublisher(url)
        return StreamPublisher(url, *(_tcp(url) if url.scheme == "tcp" else _serial(url)))
    except LinkError:
        raise
    except (OSError, ValueError) as error:
        raise LinkError(f"Tracks cannot be published on {url}: {_why(error)}.") from error


class UdpPublisher:
    """UDP: to one place (udpout), or to those who have spoken to us (udpin)."""

    def __init__(self, url: Url) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self._listeners: dict[Any, int] = {}
        family, address = resolve(url, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            if url.scheme == "udpout":
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                self._socket.connect(address)
            else:
                self._socket.bind(address)
                host, port = self._socket.getsockname()[:2]
                self.url = Url("udpin", str(host), int(port))
        except OSError:
            self._socket.close()
            raise

    def send(self, frame: bytes) -> None:
        """Send one frame to whom it may concern."""
        if self.url.scheme == "udpout":
            self._send(frame, lambda: self._socket.send(frame))
            return
        self._hear(time.monotonic_ns())
        for address in self._listeners:
            self._send(frame, lambda to=address: self._socket.sendto(frame, to))  # type: ignore[misc]

    def _send(self, frame: bytes, send: Callable[[], int]) -> None:
        for _ in range(2):
            try:
                send()
            except ConnectionRefusedError:  # told of the datagram before: nobody was there, this one has not gone yet
                self.counters[NOT_SENT] += 1
                self.counters[SENT] -= self.counters[SENT] > 0
                continue
            except OSError:
                break
            self.counters[SENT] += 1
            return
        self.counters[NOT_SENT] += 1

    def _hear(self, now_ns: int) -> None:
        """Take note of who speaks to us; forget who does not."""
        for _ in range(_DATAGRAMS_A_TURN):
            try:
                _, address = self._socket.recvfrom(1)
            except OSError:
                break
            if address in self._listeners or len(self._listeners) < _LISTENERS:
                self._listeners[address] = now_ns
        for address in [one for one, heard in self._listeners.items() if now_ns - heard > _LISTENER_NS]:
            del self._listeners[address]

    def close(self) -> None:
        """Let go of the port."""
        self._socket.close()


class StreamPublisher:
    """A byte stream: whole frames wait for a while when the other end is slow, and a frame that was begun is ended."""

    def __init__(self, url: Url, first: Any, reopen: Callable[[], Any], write: Callable[[Any, bytes], int]) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self._port: Any = first
        self._reopen, self._write = reopen, write
        self._waiting: deque[bytes] = deque()
        self._retry_at = 0

    def send(self, frame: bytes) -> None:
        """Queue one frame, and write what the other end takes."""
        now_ns = time.monotonic_ns()
        if self._port is None and now_ns >= self._retry_at:
            try:
                self._port = self._reopen()
            except (OSError, ValueError):
                self._retry_at = now_ns + _RETRY_NS
        if self._port is None or len(self._waiting) >= _WAITING_FRAMES:
            self.counters[NOT_SENT] += 1
            if self._port is None:
                return
        else:
            self._waiting.append(frame)
        try:
            self._drain()
        except OSError as error:
            if error.errno not in _BLOCKED:
                self._lose(now_ns)

    def _drain(self) -> None:
        while self._waiting:
            frame = self._waiting[0]
            written = self._write(self._port, frame)
            if written < len(frame):
                self._waiting[0] = frame[written:]
                return
            self._waiting.popleft()
            self.counters[SENT] += 1

    def _lose(self, now_ns: int) -> None:
        """The other end is gone, and with it what waited: the rest of a frame would spoil the next stream."""
        self.counters["publish: connections lost or refused"] += 1
        self.counters[NOT_SENT] += len(self._waiting)
        self._retry_at = now_ns + _RETRY_NS
        self.close()

    def close(self) -> None:
        """Close the stream."""
        self._waiting.clear()
        if self._port is not None:
            self._port.close()
        self._port = None


def _tcp(url: Url) -> tuple[Any, Callable[[], Any], Callable[[Any, bytes], int]]:
    family, address = resolve(url, socket.SOCK_STREAM)
    first = socket.create_connection(address, timeout=_CONNECT_TIMEOUT_S)
    first.setblocking(False)

    def reopen() -> socket.socket:
        connection = socket.socket(family, socket.SOCK_STREAM)
        connection.setblocking(False)
        connection.connect_ex(address)  # what comes of it shows when something is sent
        return connection

    def write(connection: socket.socket, data: bytes) -> int:
        return connection.send(data)

    return first, reopen, write


def _serial(url: Url) -> tuple[Any, Callable[[], Any], Callable[[Any, bytes], int]]:
    import serial

    def reopen() -> Any:
        return serial.serial_for_url(url.device, baudrate=url.baud, timeout=0, write_timeout=0)

    def write(port: Any, data: bytes) -> int:
        # pyserial asks again and again while the port takes nothing, so it is asked only when the port takes something
        if hasattr(port, "fd") and not select.select([], [port.fd], [], 0)[1]:
            return 0
        written = port.write(data)
        return len(data) if written is None else int(written)

    return reopen(), reopen, write


def _why(error: Exception) -> str:
    """What is in the way and what to do, as part of a sentence."""
    number = getattr(error, "errno", None)
    if number == errno.EADDRINUSE:
        return "another link has this port already; publish from another port, or with udpout:HOST:PORT"
    if number == errno.EADDRNOTAVAIL:
        return "this machine has no such address; answer on 0.0.0.0 for all that it has"
    if isinstance(error, TimeoutError):
        return "nobody answers; start what should take them first, or correct the address"
    if isinstance(error, ConnectionRefusedError):
        return "nobody listens there; start what should take them first, or correct the address"
    return f"{reason_of(error)}; correct what follows --publish"
