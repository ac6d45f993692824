"""What a process writes is held by it, so that nobody mends what is still growing: a session's folder, and its recording.

The hold is a lock on the folder or the file itself, which the system lets go when the process dies, however it dies. Where
there are no such locks (Windows), a file that is younger than a few seconds tells that somebody still writes it. The process
that draws holds the recording for itself: when the gateway is killed, it still draws what was handed over.
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
    """Holds a folder or a file from now until `release`. Raises BlockingIOError when another process holds it."""

    def __init__(self, path: Path) -> None:
        self._descriptor: int | None = None
        if fcntl is not None:
            descriptor = os.open(path, os.O_RDONLY)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(descriptor)
                raise
            self._descriptor = descriptor

    def release(self) -> None:
        """Let go; calling it again does nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def is_held(path: Path, written: Path) -> bool:
    """Whether a process is still writing this folder or file, of which `written` is rewritten all the time."""
    if fcntl is None:
        return time.time() - written.stat().st_mtime < _STILL_WRITTEN_S
    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False
