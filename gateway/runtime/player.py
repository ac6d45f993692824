"""A recording sent onto UDP at its own intervals: each MAVLink peer from a socket of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from gateway.runtime.pace import Datagram, Pace, find, send_paced
from gateway.runtime.playback import Playback
from gateway.runtime.urls import Url


def play_onto(
    playback: Playback,
    mavlink: Url,
    radar: Url,
    *,
    speed: float | None = 1.0,
    begins_at: int | None = None,
    asked_to_stop: Callable[[], object] = lambda: None,
) -> dict[str, int]:
    """Send everything from the stamp `begins_at` on, `speed` times as fast as it came in (None: as fast as it goes).

    Returns what was sent, by kind; what people told the gateway is not sent. A receiver that is not there is no error.
    Raises LinkError for a host that cannot be found, OSError when the machine cannot send.
    """
    addresses = {"mavlink": find(mavlink), "radar": find(radar)}
    return send_paced(_datagrams(playback, begins_at), addresses, Pace(speed, asked_to_stop))


def _datagrams(playback: Playback, begins_at: int | None) -> Iterator[Datagram]:
    kinds = {source.number: source.kind for source in playback.sources}
    for arrival in playback.arrivals():
        if begins_at is None or arrival.received_at >= begins_at:
            yield Datagram(arrival.received_at, arrival.source, kinds[arrival.source], arrival.data)
