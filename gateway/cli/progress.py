"""Progress of work whose length is known, for people at a terminal; silent where nobody looks."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import Progress


@contextlib.contextmanager
def progressing(what: str, *, show: bool) -> Iterator[Callable[[float], None]]:
    """A bar on stderr while the context lasts; yields the function that is told how far it is, from 0 to 1."""
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not show or not console.is_terminal) as progress:
        task = progress.add_task(what, total=1.0)
        yield lambda fraction: progress.update(task, completed=fraction)
