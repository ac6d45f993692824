"""A scene played onto the network: UDP datagrams at the scene's own pace, each aircraft from a socket of its own."""

from __future__ import annotations

import socket
import time
from collections import Counter
from collections.abc import Callable
from threading import Event

from gateway.runtime.links import resolve
from gateway.runtime.urls import Url
from sim.events import events
from sim.scene import Scene

_WAKES_EVERY_S = 0.1  # to hear of a stop and to tell the progress
_PRESENT_NS = 5_000_000_000  # a scene that begins this near to now is kept in step with the clock
_BURST, _PAUSE_S = 64, 0.001  # as fast as it goes still lets a receiver on the same machine breathe


def play(
    scene: Scene,
    mavlink: Url | None,
    radar: Url | None,
    *,
    speed: float | None = 1.0,
    stop: Event | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, int]:
    """Send a scene, `speed` times as fast as real time (None: as fast as it goes); how much was sent, by kind.

    A Url of None leaves that kind out. `progress` is told the scene's second now and then. A scene that begins about
    now runs in step with this machine's clock, so that what it says of time is true. A receiver that is not there is
    no error. Raises LinkError for a host that cannot be found, OSError when the machine cannot send.
    """
    stop = stop or Event()
    urls = {"mavlink": mavlink, "radar": radar}
    addresses = {kind: resolve(url, socket.SOCK_DGRAM) for kind, url in urls.items() if url is not None}
    kinds = {name: name.partition(":")[0] for name in scene.links}
    sockets = {
        name: socket.socket(addresses[kind][0], socket.SOCK_DGRAM) for name, kind in kinds.items() if kind in addresses
    }
    sent: Counter[str] = Counter()
    began, told = _began(scene, speed), -1.0
    try:
        for event in events(scene):
            elapsed_s = (event.at - scene.start_ns) / 1e9
            if speed is not None:
                _wait_until(began + elapsed_s / speed, stop)
            elif sum(sent.values()) % _BURST == 0:
                time.sleep(_PAUSE_S)
            if stop.is_set():
                break
            if progress is not None and elapsed_s - told >= _WAKES_EVERY_S:
                told = elapsed_s
                progress(elapsed_s)
            if event.link in sockets:
                kind = kinds[event.link]
                sockets[event.link].sendto(event.data, addresses[kind][1])
                sent["MAVLink frames" if kind == "mavlink" else "radar datagrams"] += 1
    finally:
        for opened in sockets.values():
            opened.close()
    return dict(sent)


def _began(scene: Scene, speed: float | None) -> float:
    """The monotonic second at which the scene's second 0 is."""
    until_start_ns = scene.start_ns - time.time_ns()
    in_step = speed == 1.0 and abs(until_start_ns) < _PRESENT_NS
    return time.monotonic() + (until_start_ns / 1e9 if in_step else 0.0)


def _wait_until(monotonic_s: float, stop: Event) -> None:
    while (left := monotonic_s - time.monotonic()) > 0 and not stop.wait(min(left, _WAKES_EVERY_S)):
        pass
