"""Ctrl-C and SIGTERM as a question that a loop can ask: should we stop?

The first one asks for a clean end. A second Ctrl-C raises KeyboardInterrupt where the program stands: what was flushed
is on the disk, and the next command that touches the session completes it.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any, Self


class StopSignals:
    """A context in which signals only ask, and call `then`. Outside the main thread it changes nothing."""

    def __init__(self, then: Callable[[], None] = lambda: None) -> None:
        self.asked_by: str | None = None
        self._then = then
        self._before: dict[int, Any] = {}

    def __call__(self) -> str | None:
        """Who asked us to stop ("Ctrl-C", "SIGTERM"), or None."""
        return self.asked_by

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._before[number] = signal.signal(number, self._ask)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        if self.asked_by is not None and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.asked_by = "Ctrl-C" if number == signal.SIGINT else "SIGTERM"
        self._then()
