"""What is kept for later, on the disk, of a session that may last for hours: a file without a name, gone with the program."""

from __future__ import annotations

import pickle
import tempfile
from pathlib import Path
from typing import Any

Kept = tuple[int, int]  # where, and how many bytes


class Spool:
    """Values in a temporary file of our own, in `folder` or where the system keeps such files. Raises OSError on a full disk."""

    def __init__(self, folder: Path | None) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115  (lives as long as the session)
        self._end = 0

    def keep(self, value: Any) -> Kept:
        """Write a value; where it is."""
        data = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
        self._file.seek(self._end)
        self._file.write(data)
        kept = self._end, len(data)
        self._end += len(data)
        return kept

    def read(self, kept: Kept) -> Any:
        """A value that was kept."""
        self._file.seek(kept[0])
        return pickle.loads(self._file.read(kept[1]))

    def forget(self) -> None:
        """Use the file from its beginning again: nothing that was kept is needed any more."""
        self._file.seek(0)
        self._file.truncate()
        self._end = 0

    def close(self) -> None:
        """Let go of the file; calling it again does nothing."""
        self._file.close()
