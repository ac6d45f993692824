"""One end of a conversation on a link: the good frames that come in, by peer, and what is told to everybody who was heard.

For who talks a little and listens to little: a simulated vehicle, her helmsman, the upload of a mission. What takes in tens of
thousands of frames a second is `gateway.runtime.receiver`.
"""

from __future__ import annotations

import select
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from adapters.mavlink_frames import Frame, FrameScanner, parse
from gateway.runtime.links import Link


@dataclass(slots=True)
class Conversation:
    """`heard_at`: when each peer was heard last, by the clock of `hear`, in the order in which they were heard first."""

    link: Link
    heard_at: dict[str, int] = field(default_factory=dict)
    _scanners: dict[str, FrameScanner] = field(default_factory=dict)

    def hear(self, now: int) -> list[tuple[str, Frame]]:
        """The good frames that have come in by this instant, ns, each with its peer; never waits."""
        self.link.tend(now)
        chunks = self.link.receive()
        heard: list[tuple[str, Frame]] = []
        for peer, data in zip(chunks.peers, chunks.data, strict=True):
            self.heard_at[peer] = now
            scanner = self._scanners.setdefault(peer, FrameScanner())
            for raw in scanner.feed_datagram(data) if chunks.stream is None else scanner.feed(data):
                frame = parse(raw)
                if frame is not None and frame.verdict == "good":
                    heard.append((peer, frame))
        return heard

    def tell(self, frame: bytes) -> int:
        """Send to whoever is there, and how often it went out; a link that calls, or a byte stream, has its one peer."""
        peers: list[str | None] = list(self.heard_at) if self.link.url.scheme == "udpin" else [None]
        return sum(self.link.send(frame, peer) for peer in peers)

    def forget(self, before: int) -> None:
        """Peers that were last heard before an instant, ns, are told nothing more."""
        for peer in [one for one, at in self.heard_at.items() if at < before]:
            del self.heard_at[peer], self._scanners[peer]


def wait(links: Sequence[Link], seconds: float) -> None:
    """Until somebody speaks on a link, or it is time. Links that cannot be waited on are asked again when it is time."""
    if seconds <= 0.0:
        return
    open_ones = [number for link in links if (number := link.fileno()) is not None]
    if open_ones:
        select.select(open_ones, [], [], seconds)
    else:
        time.sleep(seconds)
