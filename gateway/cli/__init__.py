"""The console script: one file a command; a command reads, calls and draws, and imports what it needs when called."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run `talkdown`; exits 0 done, 1 failed while running, 2 wrong usage or site file."""
    from gateway.cli.app import run

    code = run(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    if code == 1:
        os._exit(code)  # after a disk that filled, or a second Ctrl-C, no library's own clean-up may hold us up
    sys.exit(code)
