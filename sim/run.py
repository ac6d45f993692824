"""A scene played onto the network: UDP datagrams at the scene's own pace, each aircraft from a socket of its own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from threading import Event
from typing import Any

from gateway.runtime.pace import Datagram, Pace, find, send_paced
from gateway.runtime.urls import Url
from sim.events import events
from sim.scene import Scene

_TELLS_EVERY_NS = 100_000_000
_PRESENT_NS = 5_000_000_000  # a scene that begins this near to now is kept in step with the clock


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
    addresses = {kind: find(url) for kind, url in (("mavlink", mavlink), ("radar", radar)) if url is not None}
    return play_part(scene, addresses, from_s=0.0, speed=speed, stop=stop, progress=progress)


def play_part(
    scene: Scene,
    addresses: Mapping[str, tuple[Any, Any]],
    *,
    from_s: float,
    until_s: float | None = None,
    speed: float | None = 1.0,
    stop: Event | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, int]:
    """The part of a scene from one of its seconds to another, to addresses by kind; the rest as `play`."""
    first = scene.start_ns + round(from_s * 1e9)
    last = None if until_s is None else scene.start_ns + round(until_s * 1e9)
    pace = Pace(speed, (stop or Event()).is_set, first, _began(first, speed))
    told = first - _TELLS_EVERY_NS

    def tell(at: int) -> None:
        nonlocal told
        if progress is not None and at - told >= _TELLS_EVERY_NS:
            told = at
            progress((at - scene.start_ns) / 1e9)

    return send_paced(_datagrams(scene, first, last), addresses, pace, tell)


def _datagrams(scene: Scene, first: int, last: int | None) -> Iterator[Datagram]:
    for event in events(scene):
        if last is not None and event.at > last:
            return
        if event.at >= first:
            yield Datagram(event.at, event.link, event.link.partition(":")[0], event.data)


def _began(start_ns: int, speed: float | None) -> float:
    """The monotonic second at which a scene that begins at an instant begins."""
    until_start_ns = start_ns - time.time_ns()
    in_step = speed == 1.0 and abs(until_start_ns) < _PRESENT_NS
    return time.monotonic() + (until_start_ns / 1e9 if in_step else 0.0)
