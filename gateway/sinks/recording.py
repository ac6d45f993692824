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

LARGEST = 200_000_000  # bytes: it is done in memory, and a recording of many hours is left as it is, readable


def optimise(path: Path) -> bool:
    """Rewrite a recording in few large pieces with an index; returns whether that was done.

    The file stays as it is, and can be opened, until the new one is complete beside it (`.part`). When the disk is full
    or Rerun cannot make sense of the file, it stays for good. Raises OSError where the folder is not writable.
    """
    if path.stat().st_size > LARGEST:
        return False
    part = path.with_name(path.name + ".part")
    program = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
    command = [str(program), "rrd", "optimize", str(path), "-o", str(part)]
    try:
        ended = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C once more, while this goes on, does not leave half a file
            env={**os.environ, "RERUN_ANALYTICS": "0"},
            check=False,
        )
        if ended.returncode != 0 or not part.exists() or not part.stat().st_size:
            return False
        os.replace(part, path)
        return True
    finally:
        part.unlink(missing_ok=True)
