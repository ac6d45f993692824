"""The receiver's stamps: strictly increasing multiples of 4 microseconds over all links of a session.

A stamp is when we heard, in ns since 1970 UTC. Multiples of 4 us leave the low two bits of a .tlog's microseconds 0,
and a stamp that no other arrival has makes the order of a replay the order it was live.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

STAMP_STEP_NS = 4_000
_BELIEVED_AGE_NS = 1_000_000_000  # a kernel time older than this is a clock that was set, not a datagram that waited


class Stamper:
    """Gives out stamps. UTC is read once, at the start; from there it runs on the monotonic clock.

    So a clock that is set while a session runs (NTP after boot) moves no stamp.
    """

    def __init__(
        self,
        utc_ns: Callable[[], int] = time.time_ns,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._utc_ns = utc_ns
        self._monotonic_ns = monotonic_ns
        self._utc_of_monotonic_zero = utc_ns() - monotonic_ns()
        self._last = 0

    def now(self) -> int:
        """The present time, ns since 1970 UTC, by the session's own clock."""
        return self._utc_of_monotonic_zero + self._monotonic_ns()

    def heard(self, kernel_utc_ns: Sequence[int | None]) -> list[int]:
        """When each was heard: what the kernel says, brought to the session's clock, else now.

        Both clocks are read once for all: read for each, their jitter would turn datagrams around.
        """
        now, utc = self.now(), self._utc_ns()
        return [
            now if kernel is None or not 0 <= utc - kernel < _BELIEVED_AGE_NS else now - (utc - kernel)
            for kernel in kernel_utc_ns
        ]

    def stamp(self, heard_at: int) -> int:
        """A stamp for what was heard then: at or just before it, later than every stamp and watermark given before."""
        self._last = max(heard_at // STAMP_STEP_NS * STAMP_STEP_NS, self._last + STAMP_STEP_NS)
        return self._last

    def watermark(self) -> int:
        """A time at or before which nothing will be stamped any more."""
        self._last = max(self.now() // STAMP_STEP_NS * STAMP_STEP_NS, self._last)
        return self._last
