"""The viewer that a person looks through: a window, or an address for the browser. It can be killed at any time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from typing import Self
from urllib.parse import quote

from gateway.cli.options import Viewer

_VIEWER_MEMORY = "2GB"  # a soft limit: the viewer forgets its oldest data beyond it


def has_screen() -> bool:
    """Whether a window would be seen by the person who typed the command."""
    if sys.platform == "linux":
        return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return "SSH_CONNECTION" not in os.environ


def chosen(viewer: Viewer | None) -> Viewer:
    """The viewer asked for, else a window where there is a screen, else the browser's."""
    return viewer or (Viewer.native if has_screen() else Viewer.web)


class Viewing:
    """Opens the viewer as soon as the session has an address. A window outlives the session: one can go on looking."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._process: subprocess.Popen[bytes] | None = None
        self._opened = False

    def open(self, address: str | None) -> str | None:
        """Open the viewer on a session's address, once; what to tell the person, or None for nothing new."""
        if address is None or self._opened:
            return None
        self._opened = True
        if self._viewer is Viewer.native:
            self._start("--memory-limit", _VIEWER_MEMORY, "--new", "--bind", "127.0.0.1", address)
            return f"The viewer opens; another one can join: rerun {address}"
        if self._viewer is Viewer.web:
            port = _free_port()
            self._start("--serve-web", "--bind", "127.0.0.1", "--web-viewer-port", str(port), address)
            return f"Look at http://127.0.0.1:{port}/?url={quote(address, safe='')} or with: rerun {address}"
        return f"Viewers find this session at: rerun {address}"

    def _start(self, *arguments: str) -> None:
        # A session of its own: Ctrl-C in the terminal ends the gateway, not the window that shows what it found.
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(
            [sys.executable, "-m", "rerun", *arguments],
            stdin=quiet,
            stdout=quiet,
            stderr=quiet,
            start_new_session=True,
            env={**os.environ, "RERUN_ANALYTICS": "0"},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *left: object) -> None:
        if self._process is not None and self._viewer is Viewer.web:
            # the program that serves is a child of the one that was started: both are this session's
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGTERM)
            self._process.wait()


def _free_port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
