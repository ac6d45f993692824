"""The console script: one file a command; a command reads, calls and draws, and imports what it needs when called."""

from __future__ import annotations

import gc
import os
import sys


def main() -> None:
    """Run `talkdown`; exits 0 done, 1 failed while running, 2 wrong usage or site file."""
    gc.set_threshold(
        20_000, 10, 10
    )  # hardly anything here is cyclic: looking for it less often saves a tenth of all time
    from gateway.cli.app import run

    code = run(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Everything of ours is closed by now. Taking a thousand modules apart costs 0.15 s, and after a disk that filled, or a
    # second Ctrl-C, a library's own clean-up could hold us up for ever.
    os._exit(code)
