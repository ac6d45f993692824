"""A session's folder is held by the process that writes it, so that nobody mends what is still growing.

The hold is a lock on the folder itself, which the system lets go when the process dies, however it dies. Where folders
cannot be locked (Windows), a session.json that is younger than a few seconds tells that somebody still writes it.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on this platform
    fcntl = None  # type: ignore[assignment]

_STILL_WRITTEN_S = 10.0


class Hold:
    """Holds a folder from now until `release`."""

    def __init__(self, folder: Path) -> None:
        self._descriptor: int | None = None
        if fcntl is not None:
            self._descriptor = os.open(folder, os.O_RDONLY)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def release(self) -> None:
        """Let go; calling it again does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def is_held(folder: Path, written: Path) -> bool:
    """Whether a process is still writing this folder, of which `written` is rewritten all the time."""
    if fcntl is None:
        return time.time() - written.stat().st_mtime < _STILL_WRITTEN_S
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False
