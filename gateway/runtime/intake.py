"""From bytes of links to stamped arrivals: each MAVLink frame and each radar datagram becomes one, with its source.

A MAVLink peer is a source of its own from its first whole frame on; whoever sends only noise never becomes one. A radar
link is one source. Frames are cut here and checked no further than the cutting needs: what they mean is the decoder's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from adapters import Arrival, Source
from adapters.mavlink_frames import FrameScanner
from gateway.runtime.links import Chunk
from gateway.runtime.stamps import Stamper

PEERS_AT_MOST = 128  # a session's MAVLink peers; more are counted and not heard
_STRANGERS_AT_MOST = 64  # peers that have not sent a whole frame yet; the one silent for longest makes room


class _Peer:
    """One sender of MAVLink bytes, with the scanner that cuts them."""

    __slots__ = ("scanner", "source", "stream")

    def __init__(self, counters: Counter[str]) -> None:
        self.source: Source | None = None
        self.scanner = FrameScanner(counters)
        self.stream: int | None = None

    def cut(self, chunk: Chunk) -> list[bytes]:
        """The whole frames; what remains of a datagram, or of a lost connection, never reaches the next one."""
        if chunk.stream is None:
            return self.scanner.feed_datagram(chunk.data)
        if chunk.stream != self.stream:
            self.stream, self.scanner = chunk.stream, FrameScanner(self.scanner.counters)
        return self.scanner.feed(chunk.data)


class Intake:
    """Numbers the sources, cuts and stamps what they send. Link numbers: MAVLink links first, then radar links."""

    def __init__(self, stamper: Stamper, mavlink_origins: Sequence[str], radar_origins: Sequence[str]) -> None:
        self.counters: dict[str, Counter[str]] = {origin: Counter() for origin in mavlink_origins}
        self._stamper = stamper
        self._mavlink_origins = list(mavlink_origins)
        self._radars = {
            len(mavlink_origins) + index: Source(index, "radar", f"radar-{index + 1}", origin)
            for index, origin in enumerate(radar_origins)
        }
        self._unannounced = list(self._radars.values())
        self._next_number = len(self._radars)
        self._peers: dict[tuple[int, str], _Peer] = {}
        self._strangers: dict[tuple[int, str], _Peer] = {}

    def take(self, heard: Sequence[tuple[int, Chunk]]) -> tuple[list[Source], list[Arrival]]:
        """Sources that are new, and the arrivals of one turn of all links (link number, chunk), in order of stamps."""
        timed = self._in_order(heard)
        sources, self._unannounced = self._unannounced, []
        arrivals: list[Arrival] = []
        for heard_at, link, chunk in timed:
            radar = self._radars.get(link)
            if radar is not None:
                arrivals.append(Arrival(self._stamper.stamp(heard_at), radar.number, chunk.data, chunk.peer))
                continue
            peer, frames = self._cut(link, chunk)
            if not frames:
                continue
            if peer.source is None:
                peer.source = self._admit(link, chunk, peer)
                if peer.source is None:
                    continue
                sources.append(peer.source)
            number = peer.source.number
            arrivals += [Arrival(self._stamper.stamp(heard_at), number, frame) for frame in frames]
        return sources, arrivals

    def _in_order(self, heard: Sequence[tuple[int, Chunk]]) -> list[tuple[int, int, Chunk]]:
        """(heard at, link, chunk) over all links by time; what one link says keeps its order whatever its stamps say."""
        latest: dict[int, int] = {}
        timed: list[tuple[int, int, Chunk]] = []
        instants = self._stamper.heard([chunk.kernel_utc_ns for _, chunk in heard])
        for instant, (link, chunk) in zip(instants, heard, strict=True):
            latest[link] = max(instant, latest.get(link, 0))
            timed.append((latest[link], link, chunk))
        return sorted(timed, key=lambda item: item[0])  # stable

    def _cut(self, link: int, chunk: Chunk) -> tuple[_Peer, list[bytes]]:
        """The peer of a chunk, and the whole frames in it."""
        key = (link, chunk.peer)
        peer = self._peers.get(key)
        if peer is None:
            peer = self._strangers.pop(key, None) or _Peer(self.counters[self._mavlink_origins[link]])
            self._strangers[key] = peer  # newest last
            if len(self._strangers) > _STRANGERS_AT_MOST:
                del self._strangers[next(iter(self._strangers))]
        return peer, peer.cut(chunk)

    def _admit(self, link: int, chunk: Chunk, peer: _Peer) -> Source | None:
        """The new source of a peer that sent its first whole frame, or None when there are too many."""
        origin = self._mavlink_origins[link]
        if len(self._peers) >= PEERS_AT_MOST:
            self.counters[origin]["datagrams of too many peers"] += 1
            return None
        key = (link, chunk.peer)
        self._strangers.pop(key, None)
        self._peers[key] = peer
        if chunk.peer != origin:
            origin = f"{origin} from {chunk.peer}"
        source = Source(self._next_number, "mavlink", f"mavlink-{len(self._peers)}", origin)
        self._next_number += 1
        return source
