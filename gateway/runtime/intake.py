"""From bytes of links to stamped arrivals: each MAVLink frame and each radar datagram becomes one, with its source.

A MAVLink peer is a source of its own from its first whole frame on; whoever sends only noise never becomes one. A radar
link is one source. Frames are cut here and checked no further than the cutting needs: what they mean is the decoder's.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import accumulate, islice, repeat
from operator import itemgetter
from typing import NamedTuple

from adapters import Arrival, Source
from adapters.frame_batches import MANY, NO_HEAD, Head, heads_of
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
    """The sources that are new, and arrivals in the order of their stamps; `heads` of each, where they are known of all."""

    sources: list[Source]
    arrivals: list[Arrival]
    heads: list[Head] | None = None


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
        if len(heard) == 1 and (plain := self._take_plain(*heard[0])) is not None:
            return Taken(sources, *plain)
        instants: list[int] = []
        numbers: list[int] = []
        contents: list[bytes] = []
        names: list[str] = []
        for heard_at, link, name, data, stream in self._in_order(heard):
            peer = self._peers[link].get(name)
            if peer is None:
                if stream is None and not self._may_be_heard(link, name):
                    continue
                if link in self._radars:
                    instants.append(heard_at)
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
                instants.append(heard_at)
                numbers.append(peer.source.number)
                contents.append(frame)
                names.append("")
        stamps = self._stamper.stamps(instants)
        return Taken(sources, list(map(_ARRIVAL, zip(stamps, numbers, contents, names, strict=True))))

    def _take_plain(self, link: int, chunks: Chunks) -> tuple[list[Arrival], list[Head]] | None:
        """The arrivals of many datagrams that are one good frame each, of peers that are sources: almost all there are
        where thousands a second come; and their heads. None where anything else is among them.
        """
        if len(chunks.data) < MANY or chunks.stream is not None or self._allowed.systems is not None:
            return None
        numbers = list(map(self._numbers[link].get, chunks.peers))
        if None in numbers or NO_HEAD in (heads := heads_of(chunks.data).tolist()):
            return None
        stamps = self._stamper.stamps(list(accumulate(self._stamper.heard(chunks.kernel_utc_ns), max)))
        return list(map(_ARRIVAL, zip(stamps, numbers, chunks.data, repeat(""), strict=False))), heads  # type: ignore[arg-type]

    def tell(self, lines: Sequence[bytes]) -> tuple[list[Source], list[Arrival]]:
        """What people told the gateway: its source, if it is the first time, and the lines as arrivals of now."""
        new = []
        if self._told is None:
            self._told = Source(self._next_number, "told", TOLD, "the command line")
            self._next_number += 1
            new.append(self._told)
        number = self._told.number
        stamps = self._stamper.stamps([self._stamper.now()] * len(lines))
        return new, [Arrival(stamp, number, line) for stamp, line in zip(stamps, lines, strict=True)]

    def _in_order(self, heard: Sequence[tuple[int, Chunks]]) -> Iterable[tuple[int, int, str, bytes, int | None]]:
        """(heard at, link, peer, data, stream) over all links by time; what one link says keeps its order whatever its
        stamps say.
        """
        kernel = [instant for _, chunks in heard for instant in chunks.kernel_utc_ns]
        instants = iter(self._stamper.heard(kernel))
        timed: list[tuple[int, int, str, bytes, int | None]] = []
        for link, chunks in heard:
            rising = accumulate(islice(instants, len(chunks.data)), max)
            timed += zip(rising, repeat(link), chunks.peers, chunks.data, repeat(chunks.stream), strict=False)
        if len(heard) > 1:
            timed.sort(key=itemgetter(0))  # stable
        return timed

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


_ARRIVAL: Callable[[tuple[int, int, bytes, str]], Arrival] = partial(tuple.__new__, Arrival)
"""Makes an Arrival of a tuple at a third of what its constructor takes, for each of tens of thousands a second."""
