"""A recording sent onto UDP at its own intervals: each MAVLink peer from a socket of its own."""

from __future__ import annotations

import socket
import time
from collections import Counter
from collections.abc import Callable

from gateway.runtime.links import resolve
from gateway.runtime.playback import Playback
from gateway.runtime.urls import Url

_SLEEP_AT_MOST_S = 0.1  # so that a request to stop is heard
_BURST = 64  # at full speed a pause after so many lets a receiver on the same machine keep up


def play_onto(
    playback: Playback,
    mavlink: Url,
    radar: Url,
    *,
    speed: float | None = 1.0,
    asked_to_stop: Callable[[], str | None] = lambda: None,
) -> dict[str, int]:
    """Send everything, `speed` times as fast as it came in (None: as fast as it goes); what was sent, by kind.

    A receiver that is not there is no error: datagrams are sent, not delivered. Raises LinkError for a host that cannot
    be found, OSError when the machine cannot send.
    """
    addresses = {"mavlink": resolve(mavlink, socket.SOCK_DGRAM), "radar": resolve(radar, socket.SOCK_DGRAM)}
    kinds = {source.number: source.kind for source in playback.sources}
    sockets = {number: socket.socket(addresses[kind][0], socket.SOCK_DGRAM) for number, kind in kinds.items()}
    sent: Counter[str] = Counter()
    began, first = time.monotonic(), None
    try:
        for arrival in playback.arrivals():
            first = arrival.received_at if first is None else first
            if speed is not None:
                _sleep_until(began + (arrival.received_at - first) / 1e9 / speed, asked_to_stop)
            elif sum(sent.values()) % _BURST == 0:
                time.sleep(0.001)
            if asked_to_stop():
                break
            kind = kinds[arrival.source]
            sockets[arrival.source].sendto(arrival.data, addresses[kind][1])
            sent["MAVLink frames" if kind == "mavlink" else "radar datagrams"] += 1
    finally:
        for opened in sockets.values():
            opened.close()
    return dict(sent)


def _sleep_until(monotonic_s: float, asked_to_stop: Callable[[], str | None]) -> None:
    while (left := monotonic_s - time.monotonic()) > 0 and not asked_to_stop():
        time.sleep(min(left, _SLEEP_AT_MOST_S))
