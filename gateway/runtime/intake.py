"""From bytes of links to stamped arrivals: each MAVLink frame and each radar datagram becomes one, with its source.

A MAVLink peer is a source of its own from its first whole frame on; whoever sends only noise never becomes one. A radar
link is one source. Frames are cut here and checked no further than the cutting needs: what they mean is the decoder's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate, islice, repeat
from operator import itemgetter

from adapters import Arrival, Source
from adapters.mavlink_frames import FrameScanner
from gateway.runtime.allowed import Allowed
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
    """Numbers the sources, cuts and stamps what they send. Link numbers: MAVLink links first, then radar links.

    Counters by link: "peer not allowed" (datagrams), "system not allowed" (frames), "datagrams of too many peers", and
    the scanners' own.
    """

    def __init__(
        self,
        stamper: Stamper,
        mavlink_origins: Sequence[str],
        radar_origins: Sequence[str],
        allowed: Allowed | None = None,
    ) -> None:
        self.counters: dict[str, Counter[str]] = {origin: Counter() for origin in (*mavlink_origins, *radar_origins)}
        self._stamper = stamper
        self._allowed = allowed or Allowed()
        self._origins = [*mavlink_origins, *radar_origins]
        self._radars = {
            len(mavlink_origins) + index: Source(index, "radar", f"radar-{index + 1}", origin)
            for index, origin in enumerate(radar_origins)
        }
        self._unannounced = list(self._radars.values())
        self._next_number = len(self._radars)
        self._peers: dict[tuple[int, str], _Peer] = {}
        self._strangers: dict[tuple[int, str], _Peer] = {}
        self._reached: dict[int, tuple[int, str]] = {}

    def way_to(self, source: int) -> tuple[int, str] | None:
        """The link and the peer of a MAVLink source; None for a radar, which is sent nothing, or an unknown number."""
        return self._reached.get(source)

    def take(self, heard: Sequence[tuple[int, Sequence[Chunk]]]) -> tuple[list[Source], list[Arrival]]:
        """Sources that are new, and the arrivals of one turn of all links (link number, chunks), in order of stamps."""
        sources, self._unannounced = self._unannounced, []
        arrivals: list[Arrival] = []
        stamp, peers, systems = self._stamper.stamp, self._peers, self._allowed.systems
        for heard_at, link, chunk in self._in_order(heard):
            if link in self._radars:
                if self._may_be_heard(link, chunk):
                    radar = self._radars[link].number
                    arrivals.append(Arrival(stamp(heard_at), radar, chunk.data, chunk.peer))
                continue
            peer = peers.get((link, chunk.peer)) or self._stranger(link, chunk)
            if peer is None:
                continue
            frames = peer.cut(chunk)
            if systems is not None:
                frames = self._of_allowed_systems(link, frames)
            if not frames:
                continue
            if peer.source is None:
                peer.source = self._admit(link, chunk, peer)
                if peer.source is None:
                    continue
                sources.append(peer.source)
            number = peer.source.number
            for frame in frames:
                arrivals.append(Arrival(stamp(heard_at), number, frame, ""))
        return sources, arrivals

    def _in_order(self, heard: Sequence[tuple[int, Sequence[Chunk]]]) -> Iterable[tuple[int, int, Chunk]]:
        """(heard at, link, chunk) over all links by time; what one link says keeps its order whatever its stamps say."""
        chunks = [chunk for _, of_link in heard for chunk in of_link]
        instants = iter(self._stamper.heard([chunk.kernel_utc_ns for chunk in chunks]))
        timed: list[tuple[int, int, Chunk]] = []
        for link, of_link in heard:
            timed += zip(accumulate(islice(instants, len(of_link)), max), repeat(link), of_link, strict=False)
        if len(heard) > 1:
            timed.sort(key=itemgetter(0))  # stable
        return timed

    def _may_be_heard(self, link: int, chunk: Chunk) -> bool:
        if chunk.stream is not None or self._allowed.hears_peer(chunk.peer):
            return True
        self.counters[self._origins[link]]["peer not allowed"] += 1
        return False

    def _of_allowed_systems(self, link: int, frames: list[bytes]) -> list[bytes]:
        kept = [frame for frame in frames if self._allowed.hears_frame(frame)]
        if len(kept) < len(frames):
            self.counters[self._origins[link]]["system not allowed"] += len(frames) - len(kept)
        return kept

    def _stranger(self, link: int, chunk: Chunk) -> _Peer | None:
        """A peer that has not sent a whole frame yet; None for one that may not be heard."""
        if not self._may_be_heard(link, chunk):
            return None
        key = (link, chunk.peer)
        peer = self._strangers.pop(key, None) or _Peer(self.counters[self._origins[link]])
        self._strangers[key] = peer  # newest last
        if len(self._strangers) > _STRANGERS_AT_MOST:
            del self._strangers[next(iter(self._strangers))]
        return peer

    def _admit(self, link: int, chunk: Chunk, peer: _Peer) -> Source | None:
        """The new source of a peer that sent its first whole frame, or None when there are too many."""
        origin = self._origins[link]
        if len(self._peers) >= PEERS_AT_MOST:
            self.counters[origin]["datagrams of too many peers"] += 1
            return None
        key = (link, chunk.peer)
        self._strangers.pop(key, None)
        self._peers[key] = peer
        if chunk.peer != origin:
            origin = f"{origin} from {chunk.peer}"
        source = Source(self._next_number, "mavlink", f"mavlink-{len(self._peers)}", origin)
        self._reached[source.number] = key
        self._next_number += 1
        return source
