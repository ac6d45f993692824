"""From bytes of links to stamped arrivals: each MAVLink frame and each radar datagram becomes one, with its source.

A MAVLink peer is a source of its own from its first whole frame on; whoever sends only noise never becomes one. A radar
link is one source. Frames are cut here and checked no further than the cutting needs: what they mean is the decoder's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adapters import Source
from adapters.arrivals import Arrivals
from adapters.frame_batches import MANY, NO_HEAD, heads_of
from adapters.mavlink_frames import FrameScanner
from gateway.runtime.allowed import Allowed
from gateway.runtime.links import Chunks
from gateway.runtime.stamps import Stamper
from gateway.runtime.told_plans import TOLD

PEERS_AT_MOST = 128  # a session's MAVLink peers; more are counted and not heard
_STRANGERS_AT_MOST = 64  # peers that have not sent a whole frame yet; the one silent for longest makes room


class _Peer:
    """One sender of MAVLink bytes, with the scanner that cuts them."""

    __slots__ = ("scanner", "source", "stream")

    def __init__(self, counters: Counter[str]) -> None:
        self.source: Source | None = None
        self.scanner = FrameScanner(counters)
        self.stream: int | None = None

    def cut(self, data: bytes, stream: int | None) -> list[bytes]:
        """The whole frames; what remains of a datagram, or of a lost connection, never reaches the next one."""
        if stream is None:
            return self.scanner.feed_datagram(data)
        if stream != self.stream:
            self.stream, self.scanner = stream, FrameScanner(self.scanner.counters)
        return self.scanner.feed(data)


class Taken(NamedTuple):
    """The sources that are new, and arrivals in the order of their stamps."""

    sources: list[Source]
    arrivals: Arrivals


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
        self._told: Source | None = None
        self._peers: list[dict[str, _Peer]] = [{} for _ in self._origins]
        self._numbers: list[dict[str, int]] = [{} for _ in self._origins]  # of the peers that are sources
        self._strangers: dict[tuple[int, str], _Peer] = {}
        self._reached: dict[int, tuple[int, str]] = {}

    def way_to(self, source: int) -> tuple[int, str] | None:
        """The link and the peer of a MAVLink source; None for a radar, which is sent nothing, or an unknown number."""
        return self._reached.get(source)

    def take(self, heard: Sequence[tuple[int, Chunks]]) -> Taken:
        """What one turn of all links (link number, chunks) brought."""
        sources, self._unannounced = self._unannounced, []
        count = sum(len(chunks.data) for _, chunks in heard)
        if not count:
            return Taken(sources, Arrivals.of(()))
        instants = self._instants(heard)
        if count >= MANY and (plain := self._take_plain(heard, instants)) is not None:
            return Taken(sources, plain)
        heard_at: list[int] = []
        numbers: list[int] = []
        contents: list[bytes] = []
        names: list[str] = []
        for at, link, name, data, stream in _in_order(heard, instants):
            peer = self._peers[link].get(name)
            if peer is None:
                if stream is None and not self._may_be_heard(link, name):
                    continue
                if link in self._radars:
                    heard_at.append(at)
                    numbers.append(self._radars[link].number)
                    contents.append(data)
                    names.append(name)
                    continue
                peer = self._stranger(link, name)
            frames = peer.cut(data, stream)
            if self._allowed.systems is not None:
                frames = self._of_allowed_systems(link, frames)
            if not frames:
                continue
            if peer.source is None:
                peer.source = self._admit(link, name, peer)
                if peer.source is None:
                    continue
                sources.append(peer.source)
            for frame in frames:
                heard_at.append(at)
                numbers.append(peer.source.number)
                contents.append(frame)
                names.append("")
        stamps = self._stamper.stamps(np.array(heard_at, np.int64))
        return Taken(sources, Arrivals(stamps, np.array(numbers, np.int64), contents, names if any(names) else None))

    def _instants(self, heard: Sequence[tuple[int, Chunks]]) -> NDArray[np.int64]:
        """When each of all was heard; what one link says keeps its order whatever its stamps say."""
        instants = self._stamper.heard(np.concatenate([chunks.kernel_utc_ns for _, chunks in heard]))
        begin = 0
        for _, chunks in heard:
            of_link = instants[begin : begin + len(chunks.data)]
            np.maximum.accumulate(of_link, out=of_link)
            begin += len(chunks.data)
        return instants

    def _take_plain(self, heard: Sequence[tuple[int, Chunks]], instants: NDArray[np.int64]) -> Arrivals | None:
        """The arrivals of datagrams that are one good frame each, of peers that are sources, and of radars' datagrams:
        almost all there are where thousands a second come. None where anything else is among them.
        """
        numbers = []
        for link, chunks in heard:
            number = None if chunks.stream is not None else self._numbers_of(link, chunks)
            if number is None:
                return None
            numbers.append(number)
        source, data = np.concatenate(numbers), [one for _, chunks in heard for one in chunks.data]
        heads, is_radar = (
            heads_of(data),
            np.repeat([link in self._radars for link, _ in heard], list(map(len, numbers))),
        )
        if self._allowed.systems is not None or ((heads == NO_HEAD) & ~is_radar).any():
            return None
        peers = None
        if is_radar.any():
            peers = [name for link, chunks in heard for name in _named(chunks, link in self._radars)]
        if len(heard) > 1:
            order = np.argsort(instants, kind="stable")
            places = order.tolist()
            instants, source, heads, data = instants[order], source[order], heads[order], [data[one] for one in places]
            peers = peers and [peers[one] for one in places]
        return Arrivals(self._stamper.stamps(instants), source, data, peers, heads)

    def _numbers_of(self, link: int, chunks: Chunks) -> NDArray[np.int64] | None:
        """The source of each datagram; None where one of the senders is not known yet, or not allowed."""
        senders, which = np.unique(chunks.sender, return_inverse=True)
        names = [chunks.names[sender] for sender in senders.tolist()]
        if link in self._radars:
            all_may = all(map(self._allowed.hears_peer, names))
            return np.full(len(which), self._radars[link].number) if all_may else None
        numbers = [self._numbers[link].get(name, -1) for name in names]
        return None if -1 in numbers else np.array(numbers, np.int64)[which]

    def tell(self, lines: Sequence[bytes]) -> Taken:
        """What people told the gateway: its source, if it is the first time, and the lines as arrivals of now."""
        new = []
        if self._told is None:
            self._told = Source(self._next_number, "told", TOLD, "the command line")
            self._next_number += 1
            new.append(self._told)
        stamps = self._stamper.stamps(np.full(len(lines), self._stamper.now()))
        return Taken(new, Arrivals(stamps, np.full(len(lines), self._told.number), list(lines)))

    def _may_be_heard(self, link: int, name: str) -> bool:
        """Whether the datagrams of this peer may be; counts those that may not."""
        is_allowed = self._allowed.hears_peer(name)
        if not is_allowed:
            self.counters[self._origins[link]]["peer not allowed"] += 1
        return is_allowed

    def _of_allowed_systems(self, link: int, frames: list[bytes]) -> list[bytes]:
        kept = [frame for frame in frames if self._allowed.hears_frame(frame)]
        if len(kept) < len(frames):
            self.counters[self._origins[link]]["system not allowed"] += len(frames) - len(kept)
        return kept

    def _stranger(self, link: int, name: str) -> _Peer:
        """A peer that has not sent a whole frame yet."""
        key = (link, name)
        peer = self._strangers.pop(key, None) or _Peer(self.counters[self._origins[link]])
        self._strangers[key] = peer  # newest last
        if len(self._strangers) > _STRANGERS_AT_MOST:
            del self._strangers[next(iter(self._strangers))]
        return peer

    def _admit(self, link: int, name: str, peer: _Peer) -> Source | None:
        """The new source of a peer that sent its first whole frame, or None when there are too many."""
        origin, known = self._origins[link], sum(map(len, self._peers))
        if known >= PEERS_AT_MOST:
            self.counters[origin]["datagrams of too many peers"] += 1
            return None
        self._strangers.pop((link, name), None)
        self._peers[link][name] = peer
        if name != origin:
            origin = f"{origin} from {name}"
        source = Source(self._next_number, "mavlink", f"mavlink-{known + 1}", origin)
        self._reached[source.number] = (link, name)
        self._numbers[link][name] = source.number
        self._next_number += 1
        return source


def _in_order(
    heard: Sequence[tuple[int, Chunks]], instants: NDArray[np.int64]
) -> Iterable[tuple[int, int, str, bytes, int | None]]:
    """(heard at, link, peer, data, stream) over all links by time."""
    links = [link for link, chunks in heard for _ in chunks.data]
    names = [name for _, chunks in heard for name in chunks.peers]
    data = [(one, chunks.stream) for _, chunks in heard for one in chunks.data]
    times = instants.tolist()
    for place in np.argsort(instants, kind="stable").tolist():
        yield times[place], links[place], names[place], *data[place]


def _named(chunks: Chunks, are_named: bool) -> list[str]:
    """Who sent each: of a radar link, which is one source whoever speaks on it; else nobody, as the source is the peer."""
    return chunks.peers if are_named else [""] * len(chunks.data)
