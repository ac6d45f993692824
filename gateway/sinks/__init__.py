"""Sinks: the picture -> the world.

A sink sees pictures and nothing else, so adding one cannot change a number. Every sink has `write(picture)`,
`flush(now)` and `close()`, and raises OSError when what it keeps could not be kept.
"""

from __future__ import annotations

from typing import Protocol

from gateway.picture import Picture


class Sink(Protocol):
    """What the loop does with every sink."""

    def write(self, picture: Picture) -> None:
        """Take one picture; raises OSError when an archive could not be written."""
        ...

    def flush(self, now: int) -> None:
        """Write out what waits, if anything has waited for a period until `now` (session time, ns)."""
        ...

    def close(self) -> None:
        """Write out everything and let go of files, threads and ports. Idempotent."""
        ...
