"""UDP links: datagrams, who sent them, when they came, and what the kernel had to drop.

The one thing that a link sends by itself is the empty datagram of a `udpout` link, once a second until its peer
answers: it carries no MAVLink, and without it the peer could not know where we are.
"""

from __future__ import annotations

import errno
import socket
import struct
import sys
from collections import Counter

import numpy as np

from adapters.reasons import reason_of
from gateway.runtime.batches import SO_RXQ_OVFL, SO_TIMESTAMPNS, Datagrams, batches_of
from gateway.runtime.drain import Drain
from gateway.runtime.links import RECEIVE_BUFFER_BYTES, Chunks, resolve
from gateway.runtime.urls import LinkError, Url, bracketed

_LARGE_BUFFER = 1 << 20  # some 2 700 small datagrams; the system's own choice holds a tenth of it
_LONG_S, _SHORT_S = 0.01, 0.002
_LARGEST_DATAGRAM = 65_535
_DATAGRAMS_A_TURN = 2048  # then the other links have theirs
_LINUX = sys.platform == "linux"
_SO_MEMINFO = 55  # not in Python's socket module; nine numbers, the last of which is what the kernel had to drop
_ANCILLARY_BYTES = 128
_HELLO_EVERY_NS = 1_000_000_000
_SILENT_AFTER_NS = 5_000_000_000
_ASK_DROPS_NS = 1_000_000_000
_PEERS_REMEMBERED = 1024


class UdpLink:
    """A UDP socket: listening (udpin), or calling on one peer (udpout)."""

    def __init__(
        self, url: Url, receive_buffer_bytes: int | None = RECEIVE_BUFFER_BYTES, *, is_drained: bool | None = None
    ) -> None:
        self.url = url
        self.counters: Counter[str] = Counter()
        self.news: list[tuple[str, str]] = []
        self._dropped = 0
        self._ask_drops_ns = 0
        self._hello_due_ns = 0
        self._heard = False
        self._senders: dict[str, tuple[str, int]] = {}
        self._numbers: dict[str, int] = {}
        self._numbered = 0
        family, self._address = resolve(url, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._batches = batches_of(self._socket)
        self._drain: Drain | None = None
        try:
            self.granted_bytes = self._configure(receive_buffer_bytes)
            is_small = self.granted_bytes < (receive_buffer_bytes or RECEIVE_BUFFER_BYTES)
            if self._batches is not None and (is_small if is_drained is None else is_drained):
                self._drain = self._start_drain()
            if url.scheme == "udpin":
                self._socket.bind(self._address)
                host, port = self._socket.getsockname()[:2]
                self.url = Url("udpin", str(host), int(port))
            else:
                self._socket.connect(self._address)  # from now on the kernel refuses what others send
        except OSError as error:
            self.close()
            raise LinkError(_why_not(url, error)) from error

    def _configure(self, wanted: int | None) -> int:
        """Ask for what helps, and read back what was granted: the receive buffer in bytes."""
        self._socket.setblocking(False)
        if wanted is not None:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, wanted)
        granted = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        if _LINUX:
            granted //= 2  # Linux tells twice what it gives, the other half is its own book-keeping
            for option in (SO_TIMESTAMPNS, SO_RXQ_OVFL):
                try:
                    self._socket.setsockopt(socket.SOL_SOCKET, option, 1)
                except OSError:
                    self.counters[f"no socket option {option}"] += 1
        if wanted is not None and granted < wanted:
            advice = ", raise net.core.rmem_max to change that" if _LINUX else ""
            text = f"{self.url}: receive buffer of {granted >> 10} KiB instead of {wanted >> 10} KiB{advice}."
            self.news.append(("info", text))
        return granted

    def _start_drain(self) -> Drain | None:
        """The process that empties the socket; before the socket has its port, so that nothing comes in meanwhile."""
        try:
            return Drain(self._socket)
        except OSError:
            self._without_drain("cannot be started")
            return None

    def _without_drain(self, why: str) -> None:
        self.counters["draining processes lost"] += 1
        text = (
            f"{self.url}: the process that empties this socket {why}; going on without it, more may be lost (counted)."
        )
        self.news.append(("warning", text))

    @property
    def patience_s(self) -> float:
        """How long what comes in can wait for us, s."""
        return _LONG_S if self._drain is not None or self.granted_bytes >= _LARGE_BUFFER else _SHORT_S

    @property
    def drained_by(self) -> int | None:
        """The number of the process that empties the socket, if there is one."""
        return None if self._drain is None else self._drain.process

    def fileno(self) -> int | None:
        """The descriptor to wait on, or None once closed."""
        number = self._socket.fileno()
        if self._drain is not None:
            return self._drain.fileno()
        return number if number >= 0 else None

    def receive(self) -> Chunks:
        """The datagrams that wait, at most a turn's worth."""
        parts: list[Chunks] = []
        left = _DATAGRAMS_A_TURN
        try:
            while left > 0 and (batch := self._take()) is not None:
                if batch.dropped is not None:
                    self._lost(batch.dropped)
                if batch.chunks.data:
                    parts.append(batch.chunks)
                left -= len(batch.chunks.data)
                if not batch.is_full:
                    break
        except (BlockingIOError, InterruptedError):
            pass
        except OSError as error:  # "nobody there" in answer to what we sent, or a network that went away
            self._failed(error)
        self._heard = self._heard or bool(parts)
        return Chunks.joined(parts)

    def _take(self) -> Datagrams | None:
        """The next datagrams; None where there are none. Raises OSError for what the socket has to report."""
        if self._batches is None:
            return self._one()
        return self._batches.receive() if self._drain is None else self._drained()

    def _drained(self) -> Datagrams | None:
        """What the other process has read for us; where it has ended, we read from now on."""
        assert self._drain is not None
        try:
            return self._drain.receive()
        except EOFError:
            if not self._drain.is_finished:
                self._without_drain("has ended")
            self._drain.close()
            self._drain = None
        return Datagrams(Chunks.of((), [], ()), None, is_full=True)

    def _one(self) -> Datagrams:
        """One by one, on a system that has no other way."""
        kernel_utc_ns, dropped = 0, None
        if not _LINUX:
            data, address = self._socket.recvfrom(_LARGEST_DATAGRAM)
        else:
            data, ancillary, _, address = self._socket.recvmsg(_LARGEST_DATAGRAM, _ANCILLARY_BYTES)
            for level, kind, content in ancillary:
                if (level, kind, len(content)) == (socket.SOL_SOCKET, SO_TIMESTAMPNS, 16):
                    seconds, nanoseconds = struct.unpack("@qq", content)
                    kernel_utc_ns = seconds * 1_000_000_000 + nanoseconds
                elif (level, kind, len(content)) == (socket.SOL_SOCKET, SO_RXQ_OVFL, 4):
                    dropped = int(struct.unpack("@I", content)[0])
        name = _named(address) if address else str(self.url)
        number = self._numbers.get(name)
        if number is None:
            if len(self._numbers) >= _PEERS_REMEMBERED:
                self._numbers.clear()
            self._numbered += 1
            number = self._numbers[name] = self._numbered
        chunk = Chunks([data], np.array([number]), {number: name}, np.array([kernel_utc_ns]))
        return Datagrams(chunk, dropped, is_full=True)

    def _lost(self, dropped: int) -> None:
        """The kernel has dropped so many datagrams in all, modulo 2^32."""
        more = (dropped - self._dropped) % (1 << 32)
        if not 0 < more < 1 << 31:  # what a datagram says of drops is older than what the socket says when asked
            return
        if not self.counters["dropped by the kernel"]:
            self.news.append(("error", f"{self.url}: datagrams were lost before we could read them (counted)."))
        self.counters["dropped by the kernel"] += more
        self._dropped = dropped

    def _ask_drops(self) -> None:
        """A datagram tells of the drops before it; of those after the last one only the socket itself can tell."""
        try:
            told = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 36)
        except OSError:
            return  # a kernel before 4.12
        if len(told) == 36:
            self._lost(struct.unpack("@9I", told)[8])

    def tend(self, now_ns: int) -> None:
        """Ask for drops. On a udpout link: an empty datagram a second until the peer answers, and when it falls silent."""
        if _LINUX and now_ns >= self._ask_drops_ns:
            self._ask_drops()
            self._ask_drops_ns = now_ns + _ASK_DROPS_NS
        if self.url.scheme != "udpout" or now_ns < self._hello_due_ns:
            return
        if not self._heard:
            try:
                self._socket.send(b"")
                self.counters["empty datagrams sent"] += 1
            except OSError as error:
                self._failed(error)
        self._hello_due_ns = now_ns + (_SILENT_AFTER_NS if self._heard else _HELLO_EVERY_NS)
        self._heard = False

    def send(self, data: bytes, peer: str | None) -> bool:
        """Send a datagram: to a peer of a listening link, by the name of its chunks; a calling link has its own."""
        try:
            if self.url.scheme == "udpout":
                self._socket.send(data)
            elif peer is None:
                raise BlockingIOError
            else:
                self._socket.sendto(data, self._address_of(peer))
        except OSError as error:
            self.counters["not sent"] += 1
            if not isinstance(error, BlockingIOError):
                self._failed(error)
            return False
        return True

    def _address_of(self, peer: str) -> tuple[str, int]:
        address = self._senders.get(peer)
        if address is None:
            if len(self._senders) >= _PEERS_REMEMBERED:
                self._senders.clear()
            host, _, port = peer.rpartition(":")
            address = self._senders[peer] = (host.strip("[]"), int(port))
        return address

    def _failed(self, error: OSError) -> None:
        self.counters[f"socket error {errno.errorcode.get(error.errno or 0, 'unknown')}"] += 1

    def finish(self) -> None:
        """End the other process, if there is one: what it holds comes first, then what the socket holds."""
        if self._drain is not None:
            self._drain.finish()

    def close(self) -> None:
        """Count the last drops, and let go of the port."""
        if self._drain is not None:
            self._drain.close()
            self._drain = None
        if _LINUX and self.fileno() is not None:
            self._ask_drops()
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
    return f"{url}: cannot be opened: {reason_of(error)}."
