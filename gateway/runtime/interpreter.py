"""What holds up the receiving thread while a session is live, and is kept from doing so: the interpreter itself.

One thread runs at a time. When bytes come in, the receiving thread waits until the other one pauses, and meanwhile the
kernel can hold 25 ms of 10 000 datagrams a second in a default receive buffer. A full collection of garbage takes 60 to
80 ms with a hundred aircraft, most of it to look through modules and a history of which nothing is garbage.
"""

from __future__ import annotations

import gc
import sys
import time
from types import TracebackType
from typing import Self

_SWITCH_S = 0.001  # how long the other thread may run on once we have something to do
_NEVER = 1_000_000
_FULL_EVERY_S = 300.0  # cycles that only a full collection finds are few: what they hold until then is little


class UnhurriedCollection:
    """While this context lasts, full collections are made every five minutes, and never of what was there at its start."""

    def __init__(self) -> None:
        self._before = gc.get_threshold()
        self._switch_s = sys.getswitchinterval()
        self._due_s = 0.0

    def __enter__(self) -> Self:
        gc.collect()
        gc.freeze()
        gc.set_threshold(*self._before[:2], _NEVER)
        sys.setswitchinterval(_SWITCH_S)
        self._due_s = time.monotonic() + _FULL_EVERY_S
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        gc.set_threshold(*self._before)
        gc.unfreeze()
        sys.setswitchinterval(self._switch_s)

    def collect_when_due(self) -> None:
        """The full collection, if it is time."""
        if time.monotonic() >= self._due_s:
            gc.collect()
            self._due_s = time.monotonic() + _FULL_EVERY_S
