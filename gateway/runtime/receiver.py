"""The receiving thread: drains the links, stamps what came and hands it over through a bounded queue.

While it rests, because much comes, who asks for what came takes the newest by himself, so that it waits for no rest and for
no turn at the interpreter: of a hundred vehicles that was 4 of the 15 ms from an arrival to its picture.

What does not fit into the queue is counted, never silent; what is handed over stays in the order of its stamps. A
watermark comes with every hand-over: nothing that was stamped at or before it is still to come.
"""

from __future__ import annotations

import selectors
import threading
import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from adapters import Source
from adapters.arrivals import Arrivals
from gateway.runtime.allowed import Allowed
from gateway.runtime.intake import Intake
from gateway.runtime.links import Link
from gateway.runtime.stamps import Stamper

_SELECTOR = getattr(selectors, "PollSelector", selectors.SelectSelector)
_WAIT_S = 0.02  # how long the thread waits for bytes before it looks at its links and moves the watermark
_LAST_TURNS = 100  # what the kernel still holds at the end, but never a peer that sends without pause
_REST_S = 0.008  # between turns that brought something; a tick takes what came meanwhile
_MUCH = 100  # chunks a turn from which on it may rest longer: few large turns cost less than many small ones
_VERY_MUCH = 400  # from here on twice as long: what is taken sooner waits for its tick
_OUTBOX_AT_MOST = 1000
QUEUE_ARRIVALS = 200_000  # some 60 MB, and 20 s of the fastest stream measured


@dataclass(frozen=True, slots=True)
class Delivery:
    """What came since the last hand-over. `notes` are (level, text), to be told to a person once."""

    watermark: int
    sources: tuple[Source, ...] = ()
    arrivals: Arrivals = field(default_factory=lambda: Arrivals.of(()))
    notes: tuple[tuple[str, str], ...] = ()


class Receiver:
    """Owns the links from `start` to `close`; `drain` may be called from one other thread."""

    def __init__(
        self,
        mavlink: Sequence[Link],
        radar: Sequence[Link],
        *,
        stamper: Stamper | None = None,
        capacity: int = QUEUE_ARRIVALS,
        allowed: Allowed | None = None,
    ) -> None:
        self._links = [*mavlink, *radar]
        self._stamper = stamper or Stamper()
        origins = [str(link.url) for link in mavlink], [str(link.url) for link in radar]
        self._intake = Intake(self._stamper, *origins, allowed)
        self._capacity = capacity
        self._lock = threading.Lock()
        self._taking = threading.Lock()  # whoever has it may touch the links
        self._closing = threading.Event()
        self._failure: BaseException | None = None
        self._overflow = 0
        self._overflow_told = False
        self._rest_s = 0.0
        self._outbox: deque[tuple[int, bytes]] = deque()
        self._unsent: Counter[str] = Counter()
        self._told: deque[bytes] = deque()
        self._new_sources: list[Source] = []
        self._arrivals: list[Arrivals] = []
        self._waiting = 0  # arrivals
        self._notes: list[tuple[str, str]] = []
        self.started_at = self._watermark = self._stamper.watermark()  # before the first arrival, ns since 1970 UTC
        self._thread = threading.Thread(target=self._run, name="receiver", daemon=True)

    def start(self) -> None:
        """Begin to receive."""
        self._thread.start()

    def drain(self) -> Delivery:
        """What came since the last call. Raises what ended the receiving thread, if something did."""
        if self._failure is not None:
            raise self._failure
        if self._rest_s and not self._closing.is_set() and self._taking.acquire(blocking=False):
            try:
                self._take()
            finally:
                self._taking.release()
        with self._lock:
            sources, notes = tuple(self._new_sources), tuple(self._notes)
            watermark, arrivals = self._watermark, self._arrivals
            self._new_sources, self._arrivals, self._waiting, self._notes = [], [], 0, []
        return Delivery(watermark, sources, Arrivals.joined(arrivals), notes)

    def close(self) -> None:
        """Stop receiving, take in what the kernel still holds, let go of the ports; `drain` once more after this."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        for link in self._links:
            link.close()

    def send(self, source: int, data: bytes) -> bool:
        """Have the receiving thread send bytes to the peer of a MAVLink source within a turn; any thread may ask.

        False, and counted as "not sent", where the source is unknown or a radar, or where too much waits already.
        """
        if self._intake.way_to(source) is None or len(self._outbox) >= _OUTBOX_AT_MOST or self._closing.is_set():
            with self._lock:
                self._unsent["not sent"] += 1
            return False
        self._outbox.append((source, data))
        return True

    def tell(self, line: bytes) -> None:
        """Take in what a person told the gateway, one JSON object, as if it had just come in; any thread may."""
        self._told.append(line)

    def counters(self) -> dict[str, int]:
        """Everything that was lost or odd before decoding, by link and reason."""
        counted: Counter[str] = Counter()
        by_link = [*self._intake.counters.items(), *((str(link.url), link.counters) for link in self._links)]
        for origin, counters in by_link:
            for reason, number in list(counters.items()):
                counted[f"{origin} {reason}"] += number
        counted.update(self._unsent)
        if self._overflow:
            counted["queue overflow"] = self._overflow
        return {reason: number for reason, number in sorted(counted.items()) if number}

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._turn(_WAIT_S)
            for link in self._links:
                link.finish()
            for _ in range(_LAST_TURNS):
                if not self._turn(0.0):
                    break
        except BaseException as error:  # raised again by drain, in the thread that can end the session
            self._failure = error

    def _turn(self, wait_s: float) -> int:
        """Wait for bytes, take in what all links have; how many chunks came."""
        self._wait(wait_s)
        with self._taking:
            count = self._take()
        self._rest_s = self._rest(count)
        return count

    def _take(self) -> int:
        """Send what waits, take in what all links have, move the watermark; how many chunks came."""
        now_ns = time.monotonic_ns()
        for link in self._links:
            link.tend(now_ns)
        self._send_what_waits()
        heard = [(number, chunks) for number, link in enumerate(self._links) if (chunks := link.receive()).data]
        taken = [self._intake.take(heard)]
        if self._told:
            taken.append(self._intake.tell([self._told.popleft() for _ in range(len(self._told))]))
        notes = [note for link in self._links for note in link.news]
        for link in self._links:
            link.news.clear()
        with self._lock:
            for sources, arrivals in taken:
                self._new_sources += sources
                self._put(arrivals, notes)
            self._notes += notes
            self._watermark = self._stamper.watermark()
        return sum(len(chunks.data) for _, chunks in heard)

    def _put(self, arrivals: Arrivals, notes: list[tuple[str, str]]) -> None:
        """Into the queue, as far as there is room."""
        kept = arrivals[: self._capacity - self._waiting]
        if kept:
            self._arrivals.append(kept)
            self._waiting += len(kept)
        self._overflow += len(arrivals) - len(kept)
        if self._overflow and not self._overflow_told:
            self._overflow_told = True
            notes.append(("error", "This machine is too slow for what comes in: arrivals are being lost (counted)."))

    def _send_what_waits(self) -> None:
        while self._outbox:
            source, data = self._outbox.popleft()
            way = self._intake.way_to(source)
            if way is not None:
                number, peer = way
                self._links[number].send(data, peer)

    def _rest(self, heard: int) -> float:
        """How long to rest after a turn that brought so many chunks, s."""
        patience_s = min((link.patience_s for link in self._links), default=_REST_S)
        if heard >= _MUCH:
            return 2 * patience_s if heard >= _VERY_MUCH else patience_s
        return min(_REST_S, patience_s) if heard else 0.0

    def _wait(self, wait_s: float) -> None:
        if self._rest_s and wait_s:
            # Waiting for the next of many would wake us for each; so the kernel keeps them, and one turn takes them all.
            time.sleep(self._rest_s)
            return
        # A selector a turn follows links that close and come back without any book-keeping; poll needs no system call for it.
        with _SELECTOR() as selector:
            for link in self._links:
                descriptor = link.fileno()
                if descriptor is not None:
                    selector.register(descriptor, selectors.EVENT_READ)
            if selector.get_map():
                selector.select(wait_s)
            else:
                time.sleep(wait_s)
