"""MAVLink sequence numbers: what was lost, doubled or late, and where a source has begun anew."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

_REORDERED = 56
_RECENT = (1 << (_REORDERED + 1)) - 1


@dataclass(slots=True)
class SequenceCheck:
    """The sequence numbers of one (link, system, component), modulo 256.

    Counts "lost", "duplicate" (the same number and message again), "reordered" (late; it is lost no longer), "restarted" (a
    number heard lately comes with another message: the source has begun anew), and "unsequenced" for a source whose
    number never changes. Numbers ahead by 200 and more are late ones. What numbers cannot tell: a restart that looks like a
    step ahead reads as lost, and whole turns of 256 that were lost read as nothing.
    """

    last: int = -1
    message: int = -1
    recent: int = 0  # bit d: the number `last - d` was heard
    missing: int = 0  # bit d: the number `last - d` was counted as lost
    moved: bool = False
    messages: list[int] = field(default_factory=lambda: [-1] * 256)  # of each number; -1: more than one

    def hear(self, sequence: int, message: int, counters: Counter[str]) -> None:
        """Take the next frame's number into account."""
        ahead = (sequence - self.last) & 255
        if ahead == 1 and self.last >= 0:
            self.recent = (self.recent << 1 | 1) & _RECENT
            self.missing = self.missing << 1 & _RECENT
            self.moved = True
        elif self.last < 0:
            self.recent = 1
        elif ahead == 0:
            if message == self.message or (not self.moved and self.messages[sequence] == -1):
                counters["duplicate" if self.moved else "unsequenced"] += 1
            else:  # a radio's two status messages share their number
                self.message, self.messages[sequence] = message, -1
            return
        elif 256 - ahead <= _REORDERED:
            if not self._hear_late(256 - ahead, sequence, message, counters):
                return
        else:
            counters["lost"] += ahead - 1
            self.recent = (self.recent << ahead | 1) & _RECENT
            self.missing = (self.missing << ahead | (1 << ahead) - 2) & _RECENT
            self.moved = True
        self.last, self.message = sequence, message
        self.messages[sequence] = message

    def _hear_late(self, behind: int, sequence: int, message: int, counters: Counter[str]) -> bool:
        """A number from before the newest; whether it is a restart's."""
        bit = 1 << behind
        if not self.recent & bit:
            counters["reordered"] += 1
            counters["lost"] -= self.missing & bit != 0  # what came before the first that was heard was never counted
            self.recent |= bit
            self.missing &= ~bit
            self.messages[sequence] = message
        elif self.messages[sequence] in (message, -1):
            counters["duplicate"] += 1
        else:
            counters["restarted"] += 1
            self.recent, self.missing = 1, 0
            return True
        return False
