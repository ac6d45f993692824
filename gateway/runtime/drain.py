"""Our side of the process that empties a UDP socket for us (`emptying`): start it, read what it read, end it.

The session's own threads share one interpreter, and drawing or encoding can hold it for tens of milliseconds. A receive
buffer of the size that systems give by themselves is full after that time, at ten thousand datagrams a second. The other
process shares nothing with us but the socket and a pipe, so it reads on while we cannot.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from gateway.runtime.batches import MESSAGE, Datagrams, Envelopes
from gateway.runtime.emptying import CONTROL_BYTES, HEADER, MESSAGE_BYTES, NAME_BYTES, READY
from gateway.runtime.links import Chunks

_PROGRAM = Path(__file__).with_name("emptying.py")
_PIPE_BYTES = 1 << 20
_START_S = 5.0
_END_S = 5.0


class Drain:
    """The process that empties one socket. What it has read comes in the order in which the kernel had it."""

    def __init__(self, receiving: socket.socket) -> None:
        """Start it, and wait until it is ready. Raises OSError where that cannot be."""
        number = receiving.fileno()
        self.is_finished = False
        # Not in a session of its own: Linux schedules sessions as groups, and measured, it then waits longer for its turn.
        self._child = subprocess.Popen(
            [sys.executable, "-I", "-S", str(_PROGRAM), str(number)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            bufsize=0,
            pass_fds=(number,),
        )
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._control, self._output = self._child.stdin, self._child.stdout
        self._pipe = self._output.fileno()
        self._envelopes = Envelopes()
        self._held = b""
        self._at = 0
        self._ended = False
        self._room = ctypes.create_string_buffer(_PIPE_BYTES)
        # As with the socket itself: a call that never waits has no reason to let go of the interpreter.
        self._read = ctypes.PyDLL(None, use_errno=True).read
        self._read.restype = ctypes.c_ssize_t
        os.set_blocking(self._pipe, False)
        self._widen()
        if not self._comes(_START_S) or self._next_bytes() != READY:
            self.close()
            raise ChildProcessError("The process does not start.")

    @property
    def process(self) -> int:
        """Its number."""
        return self._child.pid

    def fileno(self) -> int:
        """What to wait on."""
        return self._pipe

    def receive(self) -> Datagrams | None:
        """The next sheet, at most 128 datagrams; None while there is none.

        Raises OSError for what the socket has to report, EOFError once the process has ended and all is taken.
        """
        while not self._has_sheet():
            more = self._next_bytes()
            if more is None:
                return None
            if not more:
                raise EOFError
            self._held, self._at = self._held[self._at :] + more, 0
        size, count = HEADER.unpack_from(self._held, self._at)
        start = self._at + HEADER.size
        self._at = start + size
        if count < 0:
            raise OSError(-count, "recvmmsg")
        return self._sheet(start, count)

    def _has_sheet(self) -> bool:
        left = len(self._held) - self._at
        return left >= HEADER.size and left >= HEADER.size + int(HEADER.unpack_from(self._held, self._at)[0])

    def _sheet(self, start: int, count: int) -> Datagrams:
        held = self._held
        names = start + count * MESSAGE_BYTES
        controls = names + count * NAME_BYTES
        at = controls + count * CONTROL_BYTES
        messages = np.frombuffer(held, MESSAGE, count, start)
        words = np.frombuffer(held, np.int64, count * CONTROL_BYTES // 8, controls).reshape(count, -1)
        contents = []
        for size in messages["size"].tolist():
            contents.append(held[at : at + size])
            at += size
        times, dropped = self._envelopes.told(messages, words)
        rows = np.frombuffer(held, np.uint8, controls - names, names).reshape(count, NAME_BYTES)
        sender, named = self._envelopes.senders(messages, rows)
        return Datagrams(Chunks(contents, sender, named, times), dropped, is_full=True)

    def _next_bytes(self) -> bytes | None:
        """What the pipe holds; nothing: it has ended; None: not yet."""
        if self._ended:
            return b""
        count = self._read(self._pipe, self._room, _PIPE_BYTES)
        if count < 0:
            return None
        self._ended = count == 0
        return ctypes.string_at(self._room, count)

    def _comes(self, wait_s: float) -> bool:
        waits = select.poll()
        waits.register(self._pipe, select.POLLIN)
        return bool(waits.poll(wait_s * 1000.0))

    def _widen(self) -> None:
        """So that the other process need not hold much itself, and is seldom told that there is room again."""
        if sys.platform == "linux":
            import fcntl

            with contextlib.suppress(OSError):  # more than this system lets one user have
                fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    def finish(self) -> None:
        """Let the process end, and take all that it holds: `receive` gives it, then raises EOFError."""
        self.is_finished = True
        self._let_go()
        give_up = time.monotonic() + _END_S
        pieces = [self._held[self._at :]]
        while not self._ended and self._comes(max(give_up - time.monotonic(), 0.0)):
            pieces.append(self._next_bytes() or b"")
        self._ended = True
        self._held, self._at = b"".join(pieces), 0

    def _let_go(self) -> None:
        if self._control.closed:
            return
        with contextlib.suppress(OSError):  # it has ended already
            self._control.write(b".")
        with contextlib.suppress(OSError):
            self._control.close()

    def close(self) -> None:
        """End the process; what it still holds is gone."""
        self._let_go()
        self._output.close()
        try:
            self._child.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
