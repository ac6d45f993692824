"""Progress of work whose length is known: a bar for people at a terminal, a line now and then where a file or a log takes it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from typing import Protocol

from rich.console import Console
from rich.progress import Progress

_LINE_EVERY_S = 10.0


class Tell(Protocol):
    """What is told how far the work is."""

    def __call__(self, fraction: float, what: str | None = None) -> None:
        """A share from 0 to 1; and what is being done, where that has changed."""


@contextlib.contextmanager
def progressing(what: str, *, show: bool) -> Iterator[Tell]:
    """Progress on stderr while the context lasts; yields what is told how far it is."""
    console = Console(stderr=True)
    if show and not console.is_terminal:
        yield _Lines(what, console)
        return
    with Progress(console=console, transient=True, disable=not show) as progress:
        task = progress.add_task(what, total=1.0)
        yield lambda fraction, what=None: progress.update(task, completed=fraction, description=what)


class _Lines:
    """Says a line each ten seconds; nothing of what is sooner over."""

    def __init__(self, what: str, console: Console) -> None:
        self._what, self._console = what, console
        self._due_s = time.monotonic() + _LINE_EVERY_S

    def __call__(self, fraction: float, what: str | None = None) -> None:
        self._what = what or self._what
        now = time.monotonic()
        if now >= self._due_s:
            self._due_s = now + _LINE_EVERY_S
            self._console.print(
                f"{self._what}: {100.0 * fraction:.0f} %", markup=False, highlight=False, soft_wrap=True
            )
