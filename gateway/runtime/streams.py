"""Byte-stream links: a TCP client and a serial port. Both must work at the start, and come back later by themselves."""

from __future__ import annotations

import errno
import os
import socket
from collections import Counter
from typing import Any

from gateway.runtime.links import RECEIVE_BUFFER_BYTES, Chunk, resolve
from gateway.runtime.urls import LinkError, Url

_CONNECT_TIMEOUT_S = 5.0
_READ_BYTES = 65_536
_READS_A_TURN = 16
_RETRY_NS = (500_000_000, 1_000_000_000, 2_000_000_000, 5_000_000_000)  # then every 5 s


class Retries:
    """When to try again: soon at first, then every 5 s."""

    def __init__(self) -> None:
        self._due_ns: int | None = None
        self._tried = 0

    def is_due(self, now_ns: int) -> bool:
        """Whether it is time; the first call after a loss only starts the wait."""
        if self._due_ns is None:
            self._due_ns = now_ns + _RETRY_NS[min(self._tried, len(_RETRY_NS) - 1)]
            return False
        if now_ns < self._due_ns:
            return False
        self._tried += 1
        self._due_ns = None
        return True

    def succeeded(self) -> None:
        """Forget the attempts so far."""
        self._due_ns, self._tried = None, 0


class TcpLink:
    """A TCP client. The peer is the URL; every connection is a new byte stream."""

    def __init__(self, url: Url) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self.news: list[tuple[str, str]] = []
        self._retries = Retries()
        self._stream = 0
        self._connecting = False
        self._family, self._address = resolve(url, socket.SOCK_STREAM)
        try:
            self._socket: socket.socket | None = socket.create_connection(self._address, timeout=_CONNECT_TIMEOUT_S)
        except OSError as error:
            raise LinkError(
                f"{url}: {_reason(error)}; start what should answer there first, or correct the address."
            ) from error
        self._prepare(self._socket)

    def _prepare(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)

    def fileno(self) -> int | None:
        """The connection's descriptor, or None while there is no connection."""
        return None if self._socket is None or self._connecting else self._socket.fileno()

    def receive(self) -> list[Chunk]:
        """What the connection has brought."""
        chunks: list[Chunk] = []
        while self._socket is not None and not self._connecting and len(chunks) < _READS_A_TURN:
            try:
                data = self._socket.recv(_READ_BYTES)
            except (BlockingIOError, InterruptedError):
                break
            except OSError as error:
                self._lost(_reason(error))
                break
            if not data:
                self._lost("the other side closed the connection")
                break
            chunks.append(Chunk(str(self.url), data, self._stream, None))
        return chunks

    def _lost(self, reason: str) -> None:
        self.counters["connections lost"] += 1
        self.news.append(("warning", f"{self.url}: {reason}; trying again."))
        self.close()

    def tend(self, now_ns: int) -> None:
        """Connect again when it is time."""
        if self._socket is None and self._retries.is_due(now_ns):
            self._socket = socket.socket(self._family, socket.SOCK_STREAM)
            self._prepare(self._socket)
            self._connecting = True
        if self._socket is None or not self._connecting:
            return
        code = self._socket.connect_ex(self._address)
        if code in (0, errno.EISCONN):
            self._connecting = False
            self._stream += 1
            self._retries.succeeded()
            self.news.append(("info", f"{self.url}: connected again."))
        elif code not in (errno.EINPROGRESS, errno.EALREADY, errno.EWOULDBLOCK):
            self.counters["connections refused"] += 1
            self.close()

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._connecting = None, False


class SerialLink:
    """A serial port. The peer is the URL; every time it is opened a new byte stream begins."""

    def __init__(self, url: Url) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self.news: list[tuple[str, str]] = []
        self._retries = Retries()
        self._stream = 0
        try:
            self._port: Any = self._open()
        except (OSError, ValueError) as error:
            advice = "is the radio plugged in, and may this user read the port (group dialout on Linux)?"
            raise LinkError(f"{url}: {_reason(error)}; {advice}") from error

    def _open(self) -> Any:
        import serial

        return serial.serial_for_url(self.url.device, baudrate=self.url.baud, timeout=0)

    def fileno(self) -> int | None:
        """The port's descriptor where the platform can wait on it, else None: then it is asked at every turn."""
        if self._port is None or os.name != "posix":
            return None
        try:
            return int(self._port.fileno())
        except (AttributeError, OSError, ValueError):
            return None  # a port that has no descriptor, such as pyserial's loop://

    def receive(self) -> list[Chunk]:
        """What the port has brought."""
        if self._port is None:
            return []
        try:
            data = bytes(self._port.read(_READ_BYTES))
        except (
            OSError,
            TypeError,
        ) as error:  # a radio that was unplugged; TypeError is pyserial's, closed while reading
            self.counters["connections lost"] += 1
            self.news.append(("warning", f"{self.url}: {_reason(error)}; trying again."))
            self.close()
            return []
        return [Chunk(str(self.url), data, self._stream, None)] if data else []

    def tend(self, now_ns: int) -> None:
        """Open the port again when it is time."""
        if self._port is not None or not self._retries.is_due(now_ns):
            return
        try:
            self._port = self._open()
        except (OSError, ValueError):
            self.counters["connections refused"] += 1
            return
        self._stream += 1
        self._retries.succeeded()
        self.news.append(("info", f"{self.url}: open again."))

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()
        self._port = None


def _reason(error: BaseException) -> str:
    """What went wrong, as part of a sentence."""
    if isinstance(error, TimeoutError):
        return "nobody answers"
    if isinstance(error, ConnectionRefusedError):
        return "nobody listens there"
    text = str(getattr(error, "strerror", None) or error)
    return text[:1].lower() + text[1:].rstrip(".")
