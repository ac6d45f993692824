"""Many datagrams with one system call, where there is one for it (Linux: recvmmsg).

Two things make this pay. One call brings up to 128 datagrams for the price of a few. And Python's own socket calls let go
of the interpreter each time: while the session works, every single one of them would then wait its turn for it, up to
milliseconds, and the kernel would drop what comes in meanwhile. A call that never waits has no reason to let go.
"""

from __future__ import annotations

import ctypes
import errno
import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.runtime.emptying import CONTROL_BYTES, DATAGRAMS, NAME_BYTES, SLOT_BYTES

SO_TIMESTAMPNS = 35  # not in Python's socket module; the kernel's time of arrival
SO_RXQ_OVFL = 40  # not in Python's socket module; datagrams that the kernel had to drop
_PEERS_REMEMBERED = 4096
_STAMP_HEADER = (32, socket.SOL_SOCKET | SO_TIMESTAMPNS << 32)  # of a control message: its size, level and kind
_DROPS_HEADER = (20, socket.SOL_SOCKET | SO_RXQ_OVFL << 32)


@dataclass(frozen=True, slots=True)
class Datagrams:
    """Columns of what came: contents, senders, kernel times (ns since 1970 UTC, or None).

    `dropped` is how many the kernel had dropped since the socket was opened, modulo 2^32; None: it did not say.
    `is_full`: there may be more.
    """

    contents: list[bytes]
    peers: list[str]
    kernel_utc_ns: list[int | None]
    dropped: int | None
    is_full: bool


# struct mmsghdr and struct iovec of a 64-bit Linux, the gaps that alignment leaves included.
MESSAGE = np.dtype(
    [
        *(("name", np.uint64), ("name_size", np.uint32), ("gap_1", np.uint32)),
        *(("vectors", np.uint64), ("vector_count", np.uint64)),
        *(("control", np.uint64), ("control_size", np.uint64)),
        *(("flags", np.int32), ("gap_2", np.uint32)),
        *(("size", np.uint32), ("gap_3", np.uint32)),
    ]
)
_VECTOR = np.dtype([("base", np.uint64), ("size", np.uint64)])


def batches_of(receiving: socket.socket) -> DatagramBatches | None:
    """The batches of a socket; None on a system that has no such call."""
    if sys.platform != "linux" or sys.byteorder != "little" or ctypes.sizeof(ctypes.c_void_p) != 8:
        return None  # elsewhere control messages are laid out otherwise
    call = getattr(ctypes.PyDLL(None, use_errno=True), "recvmmsg", None)
    return None if call is None else DatagramBatches(receiving, call)


class DatagramBatches:
    """Receives from one UDP socket into buffers that are made once: memory that no datagram has touched is never used."""

    def __init__(self, receiving: socket.socket, call: Callable[..., int]) -> None:
        self._socket = receiving
        self._call = call
        self._envelopes = Envelopes()
        self._slots = np.empty((DATAGRAMS, SLOT_BYTES), np.uint8)
        self._names = np.zeros((DATAGRAMS, NAME_BYTES), np.uint8)
        self._controls = np.zeros((DATAGRAMS, CONTROL_BYTES), np.uint8)
        vectors, messages = np.zeros(DATAGRAMS, _VECTOR), np.zeros(DATAGRAMS, MESSAGE)
        vectors["base"], vectors["size"] = _addresses(self._slots), SLOT_BYTES
        messages["vectors"], messages["vector_count"] = _addresses(vectors), 1
        messages["name"], messages["control"] = _addresses(self._names), _addresses(self._controls)
        self._vectors, self._messages = vectors, messages
        self._at = ctypes.c_void_p(messages.ctypes.data)
        self._words = self._controls.view(np.int64)
        self._bytes = self._slots.reshape(-1).data

    def receive(self) -> Datagrams | None:
        """The datagrams that wait, at most 128; None when none does. Raises OSError for what the socket has to report."""
        messages = self._messages
        messages["name_size"], messages["control_size"] = NAME_BYTES, CONTROL_BYTES
        count = self._call(self._socket.fileno(), self._at, DATAGRAMS, socket.MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            if code in (errno.EAGAIN, errno.EINTR):
                return None
            raise OSError(code, "recvmmsg")
        content, slot = self._bytes, SLOT_BYTES
        sizes = messages["size"][:count].tolist()
        contents = [
            content[start : start + size].tobytes()
            for start, size in zip(range(0, count * slot, slot), sizes, strict=True)
        ]
        heard = messages[:count]
        times, dropped = self._envelopes.told(heard, self._words[:count])
        peers = self._envelopes.senders(heard, self._names.tobytes())
        return Datagrams(contents, peers, times, dropped, count == DATAGRAMS)


class Envelopes:
    """Reads what the kernel tells of each datagram beside its content."""

    def __init__(self) -> None:
        self._peers: dict[bytes, str] = {}

    def senders(self, messages: NDArray[Any], names: bytes) -> list[str]:
        """Who sent each, by name; `names` holds a socket address of each in `NAME_BYTES`."""
        known, peers, at = self._peers, [], 0
        for size in messages["name_size"].tolist():
            key = names[at : at + size]
            at += NAME_BYTES
            peer = known.get(key)
            if peer is None:
                if len(known) >= _PEERS_REMEMBERED:
                    known.clear()
                peer = known[key] = _sender(key)
            peers.append(peer)
        return peers

    def told(self, messages: NDArray[Any], words: NDArray[np.int64]) -> tuple[list[int | None], int | None]:
        """The kernel's times of arrival, and its count of drops where it told one: in this order, if both.

        `words` are the control messages, a row for each datagram.
        """
        sizes = messages["control_size"]
        stamped = (sizes >= 32) & (words[:, 0] == _STAMP_HEADER[0]) & (words[:, 1] == _STAMP_HEADER[1])
        nanoseconds = words[:, 2] * 1_000_000_000 + words[:, 3]
        times: list[int | None] = nanoseconds.tolist()
        if not stamped.all():
            times = [time if has else None for time, has in zip(times, stamped.tolist(), strict=True)]
        dropped: int | None = None
        for index in np.flatnonzero(sizes > np.where(stamped, 32, 0)).tolist():
            size, kind, value = words[index, 4:7].tolist() if stamped[index] else words[index, 0:3].tolist()
            if (size, kind) == _DROPS_HEADER:
                dropped = value & 0xFFFFFFFF
        return times, dropped


def _addresses(table: NDArray[Any]) -> NDArray[np.uint64]:
    """Where each row of an array lies in memory."""
    return table.ctypes.data + np.arange(len(table), dtype=np.uint64) * np.uint64(table.strides[0])


def _sender(name: bytes) -> str:
    """ "host:port" of a socket address as the kernel writes it; "" where it is none of an IP peer."""
    family, port = int.from_bytes(name[:2], sys.byteorder), int.from_bytes(name[2:4], "big")
    if family == socket.AF_INET and len(name) >= 8:
        return f"{socket.inet_ntop(family, name[4:8])}:{port}"
    if family == socket.AF_INET6 and len(name) >= 28:
        scope = int.from_bytes(name[24:28], sys.byteorder)
        return f"[{socket.inet_ntop(family, name[8:24])}{f'%{scope}' if scope else ''}]:{port}"
    return ""
