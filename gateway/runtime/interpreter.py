"""What holds up the receiving thread while a session is live, and is kept from doing so: the interpreter itself.

One thread runs at a time. When bytes come in, the receiving thread waits until the other one pauses, and meanwhile the
kernel can hold 25 ms of 10 000 datagrams a second in a default receive buffer. A full collection of garbage takes 60 to
80 ms with a hundred aircraft, and looking for garbage among what is new a tenth of all time at 50 000 messages a second.
What it finds is next to nothing: some 80 objects a second, whatever comes in.
"""

from __future__ import annotations

import gc
import sys
import time
from types import TracebackType
from typing import Self

_SWITCH_S = 0.001  # how long the other thread may run on once we have something to do
_COLLECT_EVERY_S = 300.0


def collect_rarely() -> None:
    """Look for garbage less often, from now on: hardly anything here is cyclic, and it saves a tenth of all time."""
    gc.set_threshold(20_000, 10, 10)


class UnhurriedCollection:
    """While this context lasts, garbage is collected every five minutes, and never among what was there at its start."""

    def __init__(self) -> None:
        self._was_enabled = gc.isenabled()
        self._switch_s = sys.getswitchinterval()
        self._due_s = 0.0

    def __enter__(self) -> Self:
        gc.collect()
        gc.freeze()
        gc.disable()
        sys.setswitchinterval(_SWITCH_S)
        self._due_s = time.monotonic() + _COLLECT_EVERY_S
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        gc.unfreeze()
        if self._was_enabled:
            gc.enable()
        sys.setswitchinterval(self._switch_s)

    def collect_when_due(self) -> None:
        """The collection, if it is time."""
        if time.monotonic() >= self._due_s:
            gc.collect()
            self._due_s = time.monotonic() + _COLLECT_EVERY_S
