"""The console script: one file a command; a command reads, calls and draws, and imports what it needs when called."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run `talkdown`; exits 0 done, 1 failed while running, 2 wrong usage or site file."""
    from gateway.runtime.interpreter import collect_rarely

    collect_rarely()
    from gateway.cli.app import run

    code = run(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Everything of ours is closed by now. Taking a thousand modules apart costs 0.15 s, and after a disk that filled, or a
    # second Ctrl-C, a library's own clean-up could hold us up for ever.
    os._exit(code)
