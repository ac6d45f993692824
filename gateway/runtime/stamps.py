"""The receiver's stamps: strictly increasing multiples of 4 microseconds over all links of a session.

A stamp is when we heard, in ns since 1970 UTC. Multiples of 4 us leave the low two bits of a .tlog's microseconds 0,
and a stamp that no other arrival has makes the order of a replay the order it was live.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Instants = NDArray[np.int64]

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

    def heard(self, kernel_utc_ns: Instants) -> Instants:
        """When each was heard: what the kernel says, brought to the session's clock; else now, as where it says 0.

        Both clocks are read once for all: read for each, their jitter would turn datagrams around.
        """
        now, utc = self.now(), self._utc_ns()
        believed = (kernel_utc_ns > max(utc - _BELIEVED_AGE_NS, 0)) & (kernel_utc_ns <= utc)
        return np.where(believed, kernel_utc_ns + (now - utc), now)

    def stamps(self, heard_at: Instants) -> Instants:
        """Stamps for what was heard then: each at or just before it, later than every stamp and watermark given before."""
        if not len(heard_at):
            return heard_at
        # Each is the later of its own time and one step after the one before: the running latest, counted without those steps.
        steps = STAMP_STEP_NS * np.arange(len(heard_at))
        earliest = heard_at - heard_at % STAMP_STEP_NS - steps
        earliest[0] = max(int(earliest[0]), self._last + STAMP_STEP_NS)
        given: Instants = np.maximum.accumulate(earliest) + steps
        self._last = int(given[-1])
        return given

    def watermark(self) -> int:
        """A time at or before which nothing will be stamped any more."""
        self._last = max(self.now() // STAMP_STEP_NS * STAMP_STEP_NS, self._last)
        return self._last
