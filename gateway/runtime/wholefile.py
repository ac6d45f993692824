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
        self._pending: list[bytes] = []  # records
        self._size = 0  # bytes in the file, all of them whole records

    def write(self, record: bytes) -> int:
        """Add one record; it reaches the disk with the next flush."""
        self._pending.append(record)
        return len(record)

    def write_all(self, records: list[bytes]) -> None:
        """Add many records."""
        self._pending += records

    def flush(self) -> None:
        """Hand everything to the operating system.

        Raises OSError when it does not fit; then the file holds the records that did.
        """
        self.put(self.taken())

    def taken(self) -> list[bytes]:
        """The records that wait; they are the caller's now, to be `put`, if in another thread, one after the other."""
        records, self._pending = self._pending, []
        return records

    def put(self, records: list[bytes]) -> None:
        """Hand some records to the operating system; raises as `flush` does."""
        waiting, written = memoryview(b"".join(records)), 0
        try:
            while written < len(waiting):
                written += os.write(self._descriptor, waiting[written:])
        except OSError:
            whole = max((end for end in accumulate(map(len, records)) if end <= written), default=0)
            os.ftruncate(self._descriptor, self._size + whole)
            self._size += whole
            raise
        self._size += written

    def close(self) -> None:
        """Flush and close."""
        try:
            self.flush()
        finally:
            os.close(self._descriptor)
