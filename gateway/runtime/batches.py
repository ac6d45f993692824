"""Many datagrams with one system call, where there is one for it (Linux: recvmmsg).

Two things make this pay. One call brings up to 512 datagrams for the price of a few. And Python's own socket calls let go
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

from gateway.runtime.emptying import CONTROL_BYTES, NAME_BYTES, SLOT_BYTES
from gateway.runtime.links import Chunks

SO_TIMESTAMPNS = 35  # not in Python's socket module; the kernel's time of arrival
SO_RXQ_OVFL = 40  # not in Python's socket module; datagrams that the kernel had to drop
_PEERS_REMEMBERED = 4096
_AT_ONCE = 512
_DENSE_BYTES = 576  # any MAVLink frame; an odd number of cache lines spreads the rows over the processor's caches
_STAMP_HEADER = (32, socket.SOL_SOCKET | SO_TIMESTAMPNS << 32)  # of a control message: its size, level and kind
_DROPS_HEADER = (20, socket.SOL_SOCKET | SO_RXQ_OVFL << 32)


@dataclass(frozen=True, slots=True)
class Datagrams:
    """What came at once, with its senders and the kernel's times.

    `dropped` is how many the kernel had dropped since the socket was opened, modulo 2^32; None: it did not say.
    `is_full`: there may be more.
    """

    chunks: Chunks
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
    """Receives from one UDP socket into buffers that are made once: memory that no datagram has touched is never used.

    A datagram's first bytes come into a table that is dense enough for the processor's caches and is cut up at once; only
    of what is longer than any MAVLink frame the rest goes elsewhere.
    """

    def __init__(self, receiving: socket.socket, call: Callable[..., int]) -> None:
        self._socket = receiving
        self._call = call
        self._envelopes = Envelopes()
        self._dense = np.empty((_AT_ONCE, _DENSE_BYTES), np.uint8)
        self._rest = np.empty((_AT_ONCE, SLOT_BYTES), np.uint8)
        self._names = np.zeros((_AT_ONCE, NAME_BYTES), np.uint8)
        self._controls = np.zeros((_AT_ONCE, CONTROL_BYTES), np.uint8)
        vectors, messages = np.zeros((_AT_ONCE, 2), _VECTOR), np.zeros(_AT_ONCE, MESSAGE)
        for part, table in enumerate((self._dense, self._rest)):
            vectors["base"][:, part], vectors["size"][:, part] = _addresses(table), table.shape[1]
        messages["vectors"], messages["vector_count"] = _addresses(vectors), 2
        messages["name"], messages["control"] = _addresses(self._names), _addresses(self._controls)
        self._vectors, self._messages = vectors, messages
        self._at = ctypes.c_void_p(messages.ctypes.data)
        self._words = self._controls.view(np.int64)

    def receive(self) -> Datagrams | None:
        """The datagrams that wait, at most 512; None when none does. Raises OSError for what the socket has to report."""
        messages = self._messages
        messages["name_size"], messages["control_size"] = NAME_BYTES, CONTROL_BYTES
        count = self._call(self._socket.fileno(), self._at, _AT_ONCE, socket.MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            if code in (errno.EAGAIN, errno.EINTR):
                return None
            raise OSError(code, "recvmmsg")
        heard = messages[:count]
        times, dropped = self._envelopes.told(heard, self._words[:count])
        sender, names = self._envelopes.senders(heard, self._names[:count])
        return Datagrams(Chunks(self._contents(heard["size"]), sender, names, times), dropped, count == _AT_ONCE)

    def _contents(self, sizes: NDArray[np.uint32]) -> list[bytes]:
        longest = int(sizes.max())
        width = min(max(longest, 1), _DENSE_BYTES)
        block, at = self._dense[: len(sizes), :width].tobytes(), range(0, len(sizes) * width, width)
        contents = [block[start : start + size] for start, size in zip(at, sizes.tolist(), strict=True)]
        for place in np.flatnonzero(sizes > _DENSE_BYTES).tolist() if longest > _DENSE_BYTES else ():
            rest = self._rest[place, : int(sizes[place]) - _DENSE_BYTES].tobytes()
            contents[place] = block[place * width : (place + 1) * width] + rest
        return contents


class Envelopes:
    """Reads what the kernel tells of each datagram beside its content."""

    def __init__(self) -> None:
        self._names: dict[int, str] = {}
        self._numbers: dict[bytes, int] = {}
        self._numbered = 0

    def senders(self, messages: NDArray[Any], names: NDArray[np.uint8]) -> tuple[NDArray[np.int64], dict[int, str]]:
        """Who sent each, as numbers that are never given to anybody else, and their names; `names`: a row of each, as the kernel
        writes socket addresses.
        """
        if len(self._names) >= _PEERS_REMEMBERED:
            self._names, self._numbers = {}, {}  # new ones: whoever was given the old ones may read on in them
        first: NDArray[np.int64] = names.view(np.int64)[:, 0].copy()  # of an IPv4 peer: family, port and address
        for place in np.flatnonzero((first & 0xFFFF != socket.AF_INET) | (messages["name_size"] < 8)).tolist():
            first[place] = self._number(names[place, : int(messages["name_size"][place])].tobytes())
        for number in set(first.tolist()) - self._names.keys():
            self._names[number] = _sender(number.to_bytes(8, "little", signed=True))
        return first, self._names

    def _number(self, name: bytes) -> int:
        """Of an address that is none of IPv4; no IPv4 address looks like it."""
        number = self._numbers.get(name)
        if number is None:
            self._numbered += 1
            number = self._numbers[name] = self._numbered << 16
            self._names[number] = _sender(name)
        return number

    def told(self, messages: NDArray[Any], words: NDArray[np.int64]) -> tuple[NDArray[np.int64], int | None]:
        """The kernel's times of arrival, 0 where it told none, and its count of drops where it told one: in this order, if both.

        `words` are the control messages, a row for each datagram.
        """
        sizes = messages["control_size"]
        stamped = (sizes >= 32) & (words[:, 0] == _STAMP_HEADER[0]) & (words[:, 1] == _STAMP_HEADER[1])
        times = np.where(stamped, words[:, 2] * 1_000_000_000 + words[:, 3], 0)
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
