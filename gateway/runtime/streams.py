"""Byte-stream links: a TCP client and a serial port. Both must work at the start, and come back later by themselves."""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from abc import ABC, abstractmethod
from collections import Counter
from typing import Any

from adapters.reasons import reason_of
from gateway.runtime.links import RECEIVE_BUFFER_BYTES, Chunks, addresses
from gateway.runtime.urls import LinkError, Url

_CONNECT_TIMEOUT_S = 5.0
_UNDER_WAY = (errno.EINPROGRESS, errno.EALREADY, errno.EWOULDBLOCK)
# Ask after 10 s of silence, three times; what we send and nobody confirms ends it as well (where the system can do that).
_KEEPALIVE = {"TCP_KEEPIDLE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3, "TCP_USER_TIMEOUT": 25_000, "TCP_NODELAY": 1}
_READ_BYTES = 32_768  # a piece fits into a datagram of a .pcap
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


class _StreamLink(ABC):
    """What TCP and serial links share: they open again by themselves, each time as a new byte stream.

    The peer is the URL. Counters: "connections lost", "connections refused", "not sent".
    """

    patience_s = 0.01  # the other side waits when we do

    def __init__(self, url: Url) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self.news: list[tuple[str, str]] = []
        self._retries = Retries()
        self._stream = 0
        self._unsent = b""  # the rest of a frame that did not go out in one piece: it goes before everything else

    @abstractmethod
    def _write(self, data: bytes) -> int:
        """Hand bytes to the system; how many it took. Raises BlockingIOError or OSError."""

    def finish(self) -> None:
        """Send what was left over; what has come in waits for nothing."""
        self._flush()

    @abstractmethod
    def close(self) -> None:
        """Close what is open."""

    @property
    @abstractmethod
    def _is_open(self) -> bool: ...

    def _chunks(self, pieces: list[bytes]) -> Chunks:
        return Chunks.of([str(self.url)] * len(pieces), pieces, [0] * len(pieces), self._stream)

    def send(self, data: bytes, peer: str | None) -> bool:
        """Send to the only peer there is. What cannot go out at once is dropped, but a frame never in its middle."""
        if self._is_open and self._flush() and (taken := self._hand(data)):
            self._unsent = data[taken:]
            return True
        self.counters["not sent"] += 1
        return False

    def _flush(self) -> bool:
        """Send what was left over; whether nothing is any more."""
        if self._unsent:
            taken = self._hand(self._unsent)
            self._unsent = self._unsent[taken:]
        return self._is_open and not self._unsent

    def _hand(self, data: bytes) -> int:
        """How many bytes the system took; a connection that fails here is lost."""
        try:
            return self._write(data)
        except (BlockingIOError, InterruptedError):
            pass
        except OSError as error:
            self._lost(_reason(error))
        return 0

    def _lost(self, reason: str) -> None:
        self.counters["connections lost"] += 1
        self.news.append(("warning", f"{self.url}: {reason}; trying again."))
        self.close()
        self._unsent = b""

    def _opened_again(self, text: str) -> None:
        self._stream += 1
        self._unsent = b""
        self._retries.succeeded()
        self.news.append(("info", f"{self.url}: {text} again."))


class TcpLink(_StreamLink):
    """A TCP client. It must reach its server at the start, at any of the host's addresses; later it waits for it."""

    def __init__(self, url: Url) -> None:
        super().__init__(url)
        self._connecting_since_ns: int | None = None
        self._socket: socket.socket | None = None
        self._family, self._address, connection = _connect(url)
        self._prepare(connection)
        self._socket = connection

    def _prepare(self, connection: socket.socket) -> None:
        """Never wait, hold much, and notice within half a minute that the other side is gone without a word."""
        connection.setblocking(False)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _KEEPALIVE.items():
            option = getattr(socket, name, None)
            if option is not None:
                with contextlib.suppress(OSError):  # the system knows its name and not its use
                    connection.setsockopt(socket.IPPROTO_TCP, option, value)

    @property
    def _is_open(self) -> bool:
        return self._socket is not None and self._connecting_since_ns is None

    def fileno(self) -> int | None:
        """The connection's descriptor, or None while there is no connection."""
        return self._socket.fileno() if self._socket is not None and self._is_open else None

    def receive(self) -> Chunks:
        """What the connection has brought."""
        pieces: list[bytes] = []
        while self._socket is not None and self._is_open and len(pieces) < _READS_A_TURN:
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
            pieces.append(data)
        return self._chunks(pieces)

    def _write(self, data: bytes) -> int:
        assert self._socket is not None
        return self._socket.send(data)

    def tend(self, now_ns: int) -> None:
        """Connect again when it is time; send what was left over."""
        if self._is_open:
            self._flush()
            return
        if self._socket is None and self._retries.is_due(now_ns):
            self._socket = socket.socket(self._family, socket.SOCK_STREAM)
            self._prepare(self._socket)
            self._connecting_since_ns = now_ns
        if self._socket is None or self._connecting_since_ns is None:
            return
        code = self._socket.connect_ex(self._address)
        if code in (0, errno.EISCONN):
            self._connecting_since_ns = None
            self._opened_again("connected")
        elif code not in _UNDER_WAY or now_ns - self._connecting_since_ns > _CONNECT_TIMEOUT_S * 1e9:
            self.counters["connections refused"] += 1
            self.close()

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()
        self._socket, self._connecting_since_ns = None, None


def _connect(url: Url) -> tuple[socket.AddressFamily, tuple[str, int], socket.socket]:
    """The first address of a host that answers, and the connection to it. Raises LinkError: what the last one said."""
    reason: OSError | None = None
    for family, address in addresses(url, socket.SOCK_STREAM):
        try:
            return family, address, socket.create_connection(address, timeout=_CONNECT_TIMEOUT_S)
        except OSError as error:
            reason = error
    assert reason is not None
    raise LinkError(
        f"{url}: {_reason(reason)}; start what should answer there first, or correct the address."
    ) from reason


class SerialLink(_StreamLink):
    """A serial port. It must be there at the start; a radio that is unplugged later is waited for."""

    def __init__(self, url: Url) -> None:
        super().__init__(url)
        try:
            self._port: Any = self._open()
        except (OSError, ValueError) as error:
            advice = "is the radio plugged in, and may this user read the port (group dialout on Linux)?"
            raise LinkError(f"{url}: {_reason(error)}; {advice}") from error

    def _open(self) -> Any:
        import serial

        return serial.serial_for_url(self.url.device, baudrate=self.url.baud, timeout=0, write_timeout=0)

    @property
    def _is_open(self) -> bool:
        return self._port is not None

    def fileno(self) -> int | None:
        """The port's descriptor where the platform can wait on it, else None: then it is asked at every turn."""
        if self._port is None or os.name != "posix":
            return None
        try:
            return int(self._port.fileno())
        except (AttributeError, OSError, ValueError):
            return None  # a port that has no descriptor, such as pyserial's loop://

    def receive(self) -> Chunks:
        """What the port has brought."""
        if self._port is None:
            return self._chunks([])
        try:
            data = bytes(self._port.read(_READ_BYTES))
        except (OSError, TypeError) as error:  # a radio that was unplugged; TypeError: pyserial's, closed while reading
            self._lost(_reason(error))
            data = b""
        return self._chunks([data] if data else [])

    def _write(self, data: bytes) -> int:
        descriptor = self.fileno()
        if descriptor is not None:
            return os.write(descriptor, data)  # pyserial's own spins while the port takes nothing
        return int(self._port.write(data) or 0)

    def tend(self, now_ns: int) -> None:
        """Open the port again when it is time; send what was left over."""
        if self._port is not None:
            self._flush()
            return
        if not self._retries.is_due(now_ns):
            return
        try:
            self._port = self._open()
        except (OSError, ValueError):
            self.counters["connections refused"] += 1
            return
        self._opened_again("open")

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
    return reason_of(error)
