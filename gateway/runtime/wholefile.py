"""A file that grows by whole records: whatever happens, it ends with a whole one.

Records gather in memory and are written at `flush`. When the disk is full, or a limit is reached, the file is cut back
to the last record that fits, so that it opens afterwards. Nothing is rewritten: a process that is killed loses what it
had not flushed, and at worst leaves a cut last record, which every reader of these formats must survive.
"""

from __future__ import annotations

import os
from itertools import accumulate
from pathlib import Path


class WholeFile:
    """An append-only file. A `write` is one record. Raises OSError when it cannot be made or written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644)
        self._pending = bytearray()
        self._ends: list[int] = []  # of the pending records, counted from the start of the pending bytes
        self._size = 0  # bytes in the file, all of them whole records

    def write(self, record: bytes) -> int:
        """Add one record; it reaches the disk with the next flush."""
        self._pending += record
        self._ends.append(len(self._pending))
        return len(record)

    def write_all(self, records: list[bytes]) -> None:
        """Add many records."""
        size = len(self._pending)
        self._pending += b"".join(records)
        self._ends += accumulate(map(len, records), initial=size)

    def flush(self) -> None:
        """Hand everything to the operating system.

        Raises OSError when it does not fit; then the file holds the records that did.
        """
        written = 0
        try:
            while written < len(self._pending):
                written += os.write(self._descriptor, memoryview(self._pending)[written:])
        except OSError:
            whole = max((end for end in self._ends if end <= written), default=0)
            os.ftruncate(self._descriptor, self._size + whole)
            self._forget(whole)
            raise
        self._forget(written)

    def _forget(self, whole: int) -> None:
        self._size += whole
        self._pending, self._ends = bytearray(), []

    def close(self) -> None:
        """Flush and close."""
        try:
            self.flush()
        finally:
            os.close(self._descriptor)
