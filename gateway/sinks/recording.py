"""The end of a recording: session.rrd made small and whole, also after a session that was killed.

While a session runs its rows go to the file in many small pieces, so that nothing is lost; afterwards they are put
together, which makes the file about ten times smaller and quick to open, and writes the index that it lacks until then.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import rerun_cli  # type: ignore[import-untyped]  # its command is used, not its code

_FOOTER, _FOOTER_BYTES = b"RRF2FOOT", 12  # the end of a stream that points to its index
LARGEST = 200_000_000  # bytes: it is done in memory, and a recording of many hours is left as it is, readable


def optimise(path: Path) -> bool:
    """Rewrite a recording in few large pieces with an index; returns whether that was done.

    The file stays as it is, and can be opened, until the new one is complete beside it (`.part`). When the disk is full
    or Rerun cannot make sense of the file, it stays for good. Raises OSError where the folder is not writable.
    """
    return path.stat().st_size <= LARGEST and _rewritten(path)


def compact(path: Path) -> bool | None:
    """The same whatever the file's size, the new one verified by Rerun before it takes the old one's place.

    None: it has an index already, there is nothing to gain. Memory: a few times the file's size.
    """
    return None if has_index(path) else _rewritten(path, verified=True)


def has_index(path: Path) -> bool:
    """Whether a recording ends with an index, as those that were rewritten do."""
    with path.open("rb") as file:
        file.seek(0, os.SEEK_END)
        file.seek(-min(file.tell(), _FOOTER_BYTES), os.SEEK_END)
        return _FOOTER in file.read(_FOOTER_BYTES)


def _rewritten(path: Path, *, verified: bool = False) -> bool:
    part = path.with_name(path.name + ".part")
    try:
        if not _rerun("optimize", str(path), "-o", str(part)) or not part.exists() or not part.stat().st_size:
            return False
        if verified and not _rerun("verify", str(part)):
            return False
        os.replace(part, path)
        return True
    finally:
        part.unlink(missing_ok=True)


def _rerun(*arguments: str) -> bool:
    """Run one of Rerun's commands on recordings; whether it ended well."""
    program = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
    ended = subprocess.run(
        [str(program), "rrd", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C once more, while this goes on, does not leave half a file
        env={**os.environ, "RERUN_ANALYTICS": "0"},
        check=False,
    )
    return ended.returncode == 0
