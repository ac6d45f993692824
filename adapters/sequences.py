"""MAVLink sequence numbers: what was lost, doubled or late, and where a source has begun anew."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

_REORDERED = 56
_RECENT = (1 << (_REORDERED + 1)) - 1
_CONVINCING = 8  # gaps that another component's number fills, and nine in ten of all; by chance one in 256 would be


@dataclass(slots=True)
class Siblings:
    """The components of one system on one link. `newest`: the check of the one that was heard last."""

    newest: SequenceCheck | None = None


@dataclass(slots=True)
class SequenceCheck:
    """The sequence numbers of one (link, system, component), modulo 256.

    Counts "lost", "duplicate" (the same number and message again), "reordered" (late; it is lost no longer), "restarted" (a
    number heard lately comes with another message: the source has begun anew), and "unsequenced" for a source whose
    number never changes. Numbers ahead by 200 and more are late ones. What numbers cannot tell: a restart that looks like a
    step ahead reads as lost, and whole turns of 256 that were lost read as nothing.

    With `siblings`: components of one system that count with one counter, as those behind one program do, are found out by
    numbers that go on where the other stopped. What was taken for lost until then is taken back, and both are checked as one.
    """

    siblings: Siblings | None = None
    last: int = -1
    message: int = -1
    recent: int = 0  # bit d: the number `last - d` was heard
    missing: int = 0  # bit d: the number `last - d` was counted as lost
    moved: bool = False
    messages: list[int] = field(default_factory=lambda: [-1] * 256)  # of each number; -1: more than one
    joined: SequenceCheck | None = None  # the check of the counter that this component shares
    filled: int = 0  # gaps that a sibling's numbers fill
    filled_lost: int = 0  # and what was counted as lost in them, here:
    filled_in: Counter[str] | None = None
    open: int = 0  # gaps that they do not

    def hear(self, sequence: int, message: int, counters: Counter[str]) -> None:
        """Take the next frame's number into account."""
        if self.joined is not None:
            self.joined.hear(sequence, message, counters)
            return
        ahead = (sequence - self.last) & 255
        if self.siblings is not None:
            if ahead > 1 and self.last >= 0 and self._is_filled(sequence, ahead, message, counters):
                return
            self.siblings.newest = self
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

    def goes_on(self, first: int) -> bool:
        """Whether this is the number after the last one, by a counter of its own."""
        return self.joined is None and self.last >= 0 and (first - self.last) & 255 == 1

    def run_on(self, first: int, messages: Sequence[int]) -> None:
        """Take in messages whose numbers run on from `first`, which `goes_on`: the same as to hear each of them."""
        count = len(messages)
        shift = min(count, _REORDERED + 1)
        self.recent = (self.recent << shift | (1 << shift) - 1) & _RECENT
        self.missing = self.missing << shift & _RECENT
        self.moved = True
        self.last, self.message = (first + count - 1) & 255, messages[-1]
        lately = messages[-256:]
        at = (self.last + 1 - len(lately)) & 255
        before_wrap, after_wrap = lately[: 256 - at], lately[256 - at :]
        self.messages[at : at + len(before_wrap)] = before_wrap
        self.messages[: len(after_wrap)] = after_wrap

    def be_newest(self) -> None:
        """Of its siblings this was heard last."""
        if self.siblings is not None:
            self.siblings.newest = self

    def _is_filled(self, sequence: int, ahead: int, message: int, counters: Counter[str]) -> bool:
        """Whether a gap is none, because a sibling used the numbers in it; counted as lost until that is sure."""
        assert self.siblings is not None
        other = self.siblings.newest
        while other is not None and other.joined is not None:
            other = other.joined
        if other is None or other is self or (sequence - other.last) & 255 != 1:
            self.open += 1
            return False
        self.filled += 1
        self.filled_lost += ahead - 1
        self.filled_in = counters
        counters["lost"] += ahead - 1
        if self.filled >= _CONVINCING and self.filled >= 9 * self.open:
            for one in (self, other):
                if one.filled_in is not None:
                    one.filled_in["lost"] -= one.filled_lost
                one.filled_lost = 0
            self.joined = other
            other.hear(sequence, message, counters)
        else:
            self.siblings.newest = self
            self.last, self.message, self.messages[sequence] = sequence, message, message
            self.recent, self.missing, self.moved = 1, 0, True
        return True

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
