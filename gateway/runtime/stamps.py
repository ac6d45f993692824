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
        oldest, ahead = utc - _BELIEVED_AGE_NS, now - utc
        return [kernel + ahead if kernel and oldest < kernel <= utc else now for kernel in kernel_utc_ns]

    def stamps(self, heard_at: Sequence[int]) -> list[int]:
        """Stamps for what was heard then: each at or just before it, later than every stamp and watermark given before."""
        last, given = self._last, []
        for at in heard_at:
            at -= at % STAMP_STEP_NS
            last = at if at > last else last + STAMP_STEP_NS
            given.append(last)
        self._last = last
        return given

    def watermark(self) -> int:
        """A time at or before which nothing will be stamped any more."""
        self._last = max(self.now() // STAMP_STEP_NS * STAMP_STEP_NS, self._last)
        return self._last
