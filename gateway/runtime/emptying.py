"""A process that does nothing but empty a UDP socket, so that nothing that holds up the session can make it lose datagrams.

python -I -S emptying.py DESCRIPTOR      started by `gateway.runtime.drain`; ends when its standard input does

It imports next to nothing, and so starts quickly and stays small. What it writes to its standard output is one byte once
it is ready, then sheets: a header (how many bytes follow; how many datagrams, or minus the error that the socket had to
report), and of each datagram the kernel's own words, as `recvmmsg` put them down: sizes, then senders, then control
messages; at last the contents. What the output does not take is kept, up to a limit, and from there on it is left
to the kernel, which counts what it drops.
"""

import ctypes
import errno
import mmap
import os
import select
import signal
import struct
import sys
import time
from collections import deque

DATAGRAMS = 128  # of one sheet at most
SLOT_BYTES = 65_536 + 576  # any datagram; the odd size spreads the slots' beginnings over the processor's caches
NAME_BYTES = 32
CONTROL_BYTES = 64
MESSAGE_BYTES = 64  # struct mmsghdr of a 64-bit Linux
HEADER = struct.Struct("=Ii")
READY = b"r"
_VECTOR_BYTES = 16
_MSG_DONTWAIT = 0x40  # the socket module, which knows it, takes long to import
_NOTHING = (-errno.EAGAIN, -errno.EINTR)
_SIZE_AT = 14  # of a struct mmsghdr in numbers of four bytes: how large the datagram was
_KEPT_BYTES = 16 << 20
_REST_S = 0.004  # the smallest receive buffer that a system gives holds 5 ms of the fastest stream measured
_SHORT_REST_S = 0.0005
_MUCH = 64


class Slots:
    """Where one call puts up to 128 datagrams; memory that no datagram has touched is never used."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._call = ctypes.PyDLL(None, use_errno=True).recvmmsg
        self._contents, contents = _memory(DATAGRAMS * SLOT_BYTES)
        self._names, names = _memory(DATAGRAMS * NAME_BYTES)
        self._controls, controls = _memory(DATAGRAMS * CONTROL_BYTES)
        self._vectors, vectors = _memory(DATAGRAMS * _VECTOR_BYTES)
        self._messages, messages = _memory(DATAGRAMS * MESSAGE_BYTES)
        self._sizes = memoryview(self._messages).cast("I")
        self._at = ctypes.c_void_p(messages)
        asked = []
        for slot in range(DATAGRAMS):
            struct.pack_into("=QQ", self._vectors, slot * _VECTOR_BYTES, contents + slot * SLOT_BYTES, SLOT_BYTES)
            name, control = names + slot * NAME_BYTES, controls + slot * CONTROL_BYTES
            vector = vectors + slot * _VECTOR_BYTES
            asked.append(struct.pack("=QQQQQQQQ", name, NAME_BYTES, vector, 1, control, CONTROL_BYTES, 0, 0))
        self._asked = b"".join(asked)

    def sheet(self) -> tuple[bytes, int]:
        """The datagrams that wait, written down, and how many; less than 0: what the socket had to report."""
        self._messages[:] = self._asked
        count: int = self._call(self._descriptor, self._at, DATAGRAMS, _MSG_DONTWAIT, None)
        if count < 0:
            code = ctypes.get_errno()
            return HEADER.pack(0, -code), -code
        contents = memoryview(self._contents)
        sizes = self._sizes[_SIZE_AT : count * MESSAGE_BYTES // 4 : MESSAGE_BYTES // 4].tolist()
        parts = [
            memoryview(self._messages)[: count * MESSAGE_BYTES],
            memoryview(self._names)[: count * NAME_BYTES],
            memoryview(self._controls)[: count * CONTROL_BYTES],
            *(contents[slot * SLOT_BYTES : slot * SLOT_BYTES + size] for slot, size in enumerate(sizes)),
        ]
        return b"".join([HEADER.pack(sum(map(len, parts)), count), *parts]), count


def _memory(size: int) -> tuple[mmap.mmap, int]:
    made = mmap.mmap(-1, size)
    return made, ctypes.addressof(ctypes.c_char.from_buffer(made))


class Outlet:
    """The output, and what it has not taken yet."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: deque[memoryview] = deque()
        self.kept_bytes = 0
        os.set_blocking(descriptor, False)

    def put(self, sheet: bytes) -> None:
        """Write, or keep it behind what waits already. Raises BrokenPipeError: nobody reads any more."""
        self._waiting.append(memoryview(sheet))
        self.kept_bytes += len(sheet)
        self.flush()

    def flush(self) -> None:
        """Write what waits, as far as the output takes it."""
        try:
            while self._waiting:
                taken = os.write(self._descriptor, self._waiting[0])
                self.kept_bytes -= taken
                if taken == len(self._waiting[0]):
                    self._waiting.popleft()
                else:
                    self._waiting[0] = self._waiting[0][taken:]
        except BlockingIOError:
            pass

    def finish(self) -> None:
        """Write all that waits, however long it takes."""
        os.set_blocking(self._descriptor, True)
        self.flush()


def empty(descriptor: int) -> None:
    """Empty a socket into the standard output until the standard input ends, or nobody reads any more."""
    slots, outlet = Slots(descriptor), Outlet(1)
    os.write(1, READY)
    waits = select.poll()
    waits.register(0, select.POLLIN)
    while True:
        is_room = outlet.kept_bytes < _KEPT_BYTES
        waits.register(descriptor, select.POLLIN if is_room else 0)
        waits.register(1, select.POLLOUT if outlet.kept_bytes else 0)
        events = dict(waits.poll())
        if events.get(1, 0) & (select.POLLERR | select.POLLHUP):
            return
        outlet.flush()
        if 0 in events:
            outlet.finish()  # what is still in the kernel the other side reads by itself
            return
        if descriptor in events:
            count = 0
            if is_room:
                sheet, count = slots.sheet()
                if count not in _NOTHING:
                    outlet.put(sheet)
            # Resting, so that a sheet holds many and the other program is not woken for each.
            time.sleep(_REST_S if count < _MUCH else _SHORT_REST_S)


if __name__ == "__main__":
    # Who started us decides when we end; until then we read for it, whatever the terminal or the system tells everybody.
    for _number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(_number, signal.SIG_IGN)
    try:
        empty(int(sys.argv[1]))
    except BrokenPipeError:
        sys.exit(1)
