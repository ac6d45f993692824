"""Datagrams sent onto UDP at their own intervals: the one loop behind play, simulate and the demo's world."""

from __future__ import annotations

import contextlib
import socket
import time
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from gateway.runtime.links import resolve
from gateway.runtime.urls import Url

_WAKES_EVERY_S = 0.1  # so that a request to stop is heard
_BURST, _PAUSE_S = 64, 0.001  # at full speed a pause after so many lets a receiver on the same machine keep up
_KINDS = {"mavlink": "MAVLink frames", "radar": "radar datagrams"}


class Datagram(NamedTuple):
    """What is sent when, by whom: each speaker has a socket of its own. `kind` is "mavlink" or "radar"."""

    at: int  # ns
    speaker: Hashable
    kind: str
    data: bytes


@dataclass(slots=True)
class Pace:
    """When it is time: `speed` times as fast as the instants that are asked for (None: at once), until asked to stop.

    `first` is the instant (ns) that is at the monotonic second `began`; None: the first that is asked for, at once.
    """

    speed: float | None = 1.0
    asked_to_stop: Callable[[], object] = lambda: None
    first: int | None = None
    began: float | None = None
    _count: int = 0

    def wait(self, at: int) -> bool:
        """Wait for an instant (ns); false when asked to stop."""
        if self.first is None or self.began is None:
            self.first, self.began = at, time.monotonic()
        if self.speed is None:
            self._count += 1
            if self._count % _BURST == 0:
                time.sleep(_PAUSE_S)
            return not self.asked_to_stop()
        due = self.began + (at - self.first) / 1e9 / self.speed
        while not self.asked_to_stop():
            left = due - time.monotonic()
            if left <= 0:
                return True
            time.sleep(min(left, _WAKES_EVERY_S))
        return False


def find(url: Url) -> tuple[Any, Any]:
    """The address family and address of a URL to send to. Raises LinkError for a host that cannot be found."""
    return resolve(url, socket.SOCK_DGRAM)


def send_paced(
    datagrams: Iterable[Datagram],
    addresses: Mapping[str, tuple[Any, Any]],
    pace: Pace,
    progress: Callable[[int], None] = lambda at: None,
) -> dict[str, int]:
    """Send datagrams to the address (family, address) of their kind; how many were sent, by kind.

    Kinds without an address are left out. `progress` is told the instant of each datagram before it is sent. A receiver
    that is not there is no error: datagrams are sent, not delivered. Raises OSError when the machine cannot send.
    """
    sockets: dict[Hashable, socket.socket] = {}
    sent: Counter[str] = Counter()
    with contextlib.ExitStack() as opened:
        for datagram in datagrams:
            if not pace.wait(datagram.at):
                break
            progress(datagram.at)
            found = addresses.get(datagram.kind)
            if found is None:
                continue
            if datagram.speaker not in sockets:
                sockets[datagram.speaker] = opened.enter_context(socket.socket(found[0], socket.SOCK_DGRAM))
            sockets[datagram.speaker].sendto(datagram.data, found[1])
            sent[_KINDS[datagram.kind]] += 1
    return dict(sent)
