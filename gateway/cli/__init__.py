"""The console script: one file a command; a command reads, calls and draws, and imports what it needs when called."""

from __future__ import annotations

import sys


def main() -> None:
    """Run `talkdown`; exits 0 done, 1 failed while running, 2 wrong usage or site file."""
    from gateway.cli.app import run

    sys.exit(run(sys.argv[1:]))
