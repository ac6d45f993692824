"""The end of a recording: session.rrd made small and whole, also after a session that was killed.

While a session runs its rows go to the file in many small pieces, so that nothing is lost; afterwards they
are put together, which makes the file about ten times smaller and quick to open, and writes the index that a
killed session lacks.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import rerun_cli  # type: ignore[import-untyped]  # its command is used, not its code


def optimise(path: Path) -> bool:
    """Rewrite a recording in few large pieces with an index; returns whether that was done.

    The file stays as it is, and can be opened, until the new one is complete beside it (`.part`) and
    verified; when Rerun cannot make sense of it, it stays for good. Raises OSError when the disk is full or
    not writable.
    """
    part = path.with_name(path.name + ".part")
    try:
        done = _rerun("optimize", str(path), "-o", str(part)) and _rerun("verify", str(part))
        if done:
            os.replace(part, path)
        return done
    finally:
        part.unlink(missing_ok=True)


def _rerun(*arguments: str) -> bool:
    """Run one of Rerun's own commands on recordings, in silence."""
    program = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
    quiet = {**os.environ, "RUST_LOG": "error"}
    ended = subprocess.run([str(program), "rrd", *arguments], capture_output=True, env=quiet, check=False)
    return ended.returncode == 0
