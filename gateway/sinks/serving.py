"""Where viewers are served: a port that can be had."""

from __future__ import annotations

import socket

from adapters.reasons import reason_of


def free_port(host: str, port: int) -> int:
    """The port itself, or a free one for 0; raises OSError when it is taken, which Rerun would only log."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise OSError(error.errno, f"the viewer's server cannot use {host}:{port}: {reason_of(error)}") from error
        return int(probe.getsockname()[1])
