"""One source as it is listened to: its counters, its rate, and the frames that only have to be counted.

Most frames of an autopilot mean nothing to the gateway. Their checksums and sequence numbers still count, since a loss is
a loss whatever was lost; that much is done here without taking the frame apart.
"""

from __future__ import annotations

import struct
from collections import Counter, deque
from dataclasses import dataclass, field

from fastcrc.crc16 import mcrf4xx

from adapters import Source
from adapters.frame_batches import NO_HEAD, Head
from adapters.mavlink_frames import CRC_WORDS, V2, definitions
from adapters.meters import SECOND
from adapters.vehicles import Component
from gateway.picture import SourceHealth

_RATE_S = 10
_HEADER = struct.Struct("<BBBxBBBHB").unpack_from
_EXTRA = {number: message.crc_extra for number, message in definitions().items()}


@dataclass(slots=True)
class Listened:
    """One source. `components`: those heard, by 256 x component + system."""

    source: Source
    counters: Counter[str] = field(default_factory=Counter)
    known_good: set[int] = field(default_factory=set)  # message ids that have passed their checksum
    components: dict[int, Component] = field(default_factory=dict)
    advised: set[str] = field(default_factory=set)  # refusals that were explained
    last_heard: int | None = None
    lately: deque[list[int]] = field(default_factory=lambda: deque(maxlen=_RATE_S + 1))  # [second, observations]

    def passes(self, frame: bytes, head: Head, wanted: frozenset[int], received_at: int) -> bool:
        """Whether this was a good, unsigned MAVLink 2 frame of a known component that nobody wants: then it is counted.

        With a `head` it is known to be good, and that nobody wants it.
        """
        if head != NO_HEAD:
            message, sequence = head >> 24, head & 255
            component = self.components.get(head >> 8 & 0xFFFF)
            if component is None:
                return False
        else:
            if len(frame) < 12:
                return False
            magic, length, flags, sequence, system, number, low, high = _HEADER(frame)
            message = low | high << 16
            if magic != V2 or flags or message in wanted or len(frame) != length + 12:
                return False
            component, extra = self.components.get(number << 8 | system), _EXTRA.get(message)
            if component is None or extra is None:
                return False
            crc = mcrf4xx(frame[1:-2])
            if CRC_WORDS[crc & 255 ^ extra] ^ crc >> 8 != frame[-2] | frame[-1] << 8:
                return False
        self.counters["frames"] += 1
        self.known_good.add(message)
        component.sequence.hear(sequence, message, self.counters)
        rates = component.rates
        if received_at >= rates.until:
            rates.turn(received_at)
        rates.now[message] = rates.now.get(message, 0) + 1
        return True

    def count(self, received_at: int, number: int) -> None:
        """Take note of observations for the rate."""
        second = received_at // SECOND
        if self.lately and self.lately[-1][0] == second:
            self.lately[-1][1] += number
        else:
            self.lately.append([second, number])

    def health(self, received_at: int) -> SourceHealth:
        """How the source is doing at a stamp."""
        now = received_at // SECOND
        number = sum(count for second, count in self.lately if now - _RATE_S <= second < now)
        age_s = 0.0 if self.last_heard is None else max(received_at - self.last_heard, 0) / SECOND
        reasons = tuple(
            sorted((reason, total) for reason, total in self.counters.items() if total and reason != "lost")
        )
        source = self.source
        return SourceHealth(source.name, source.kind, age_s, number / _RATE_S, max(self.counters["lost"], 0), reasons)
