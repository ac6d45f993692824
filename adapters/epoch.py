"""The session's time: which source's UTC it follows, and whose clock is another's.

A source that gave the session its epoch and then sets another date keeps the date it began with (see SourceClock.pinned).
"""

from __future__ import annotations

from dataclasses import dataclass, field

from adapters.clock import LIMIT_NS, SourceClock
from adapters.meters import SECOND, Envelope
from gateway.observation import Timing


def foreign_clock(name: str, lag_s: float) -> str:
    """The sentence on a source whose clock is this far behind the session's (< 0: ahead of it), and what to do."""
    side = "behind" if lag_s > 0 else "ahead of"
    return (
        f"The clock of {name} is {abs(lag_s):.0f} s {side} the session's: it is shown, not fused; "
        f"set that clock, or begin a new session."
    )


@dataclass(slots=True)
class SessionEpoch:
    """The session's time: the receiver's stamps, brought to the time that the sources live in.

    Sources within 5 s of the receiver's clock leave it alone. The first source beyond that whose clock has settled gives
    the session one offset in whole seconds, for good. Where that source's clock runs at another speed than ours, the
    session's time runs with it.
    """

    offset_s: int | None = None  # None as long as no source's clock has settled
    reference: object = None
    speed: float = 1.0
    _anchor: tuple[int, int] = (0, 0)  # (stamp, session time)
    _lag: dict[object, int] = field(default_factory=dict)
    _agreed: int = 0  # the reference's lag, as far as it never leapt
    _envelopes: dict[object, Envelope] = field(default_factory=dict)

    def session_time(self, received_at: int) -> int:
        """The session's time of a stamp, ns since 1970 UTC."""
        if self.speed == 1.0:
            return received_at + self._anchor[1] - self._anchor[0]
        return self._anchor[1] + round((received_at - self._anchor[0]) * self.speed)

    def hear(self, source: object, utc: int, received_at: int, speed: float | None) -> bool:
        """A source's own UTC at a stamp; whether this settled the session's epoch.

        `speed`: of the source's clock against ours, None while not known.
        """
        settled = False
        if self.offset_s is None:
            difference = utc - received_at
            if abs(difference) >= LIMIT_NS and speed is None:
                return False  # whether its clock runs as ours does must be known before the session follows it
            self.offset_s = 0 if abs(difference) < LIMIT_NS else round(difference / SECOND)
            self._anchor = (received_at, received_at + self.offset_s * SECOND)
            self.reference, settled = source, True
        is_far = self._lag.get(source) is not None and self.timing(source) is Timing.FOREIGN
        if source == self.reference and not is_far:
            self._follow(utc, received_at, speed or 1.0)
        envelope = self._envelopes.setdefault(source, Envelope())
        self._lag[source] = lag = envelope.hear(received_at, self.session_time(received_at) - utc)
        if source == self.reference and (settled or abs(lag - self._agreed) < LIMIT_NS):
            self._agreed = lag
        return settled

    def _follow(self, utc: int, received_at: int, speed: float) -> None:
        """At a speed other than ours the session keeps up with its reference, and never goes back."""
        if speed == 1.0 and self.speed == 1.0:
            return
        now = self.session_time(received_at)
        behind_s = (utc - now) / SECOND
        if speed == 1.0:
            self.speed = 1.0
            now = max(now, utc) if abs(behind_s) >= 5 else now
        elif abs(behind_s) > 5 * max(speed, 1.0):
            self.speed, now = speed, max(now, utc)
        else:
            self.speed = min(max(speed + behind_s, 0.1 * speed), 2 * speed)
        self._anchor = (received_at, now)

    def timing(self, source: object) -> Timing:
        """What a source's UTC is worth: FOREIGN when more than 5 s from the session's, PROVISIONAL before that is known."""
        lag = self._lag.get(source)
        if lag is None:
            return Timing.PROVISIONAL
        return Timing.UTC if abs(lag - self._agreed) < LIMIT_NS else Timing.FOREIGN

    def lag_s(self, source: object) -> float:
        """How far a source's clock is behind the session's."""
        return self._lag.get(source, 0) / SECOND

    def added(self, clock: SourceClock, received_at: int) -> int:
        """What a source's time since boot needs to be the session's time: as `when`, for what is shown and not fused. Such
        things may be told late and in any order; they leave no trace in the clock.
        """
        told = clock if clock.utc_offset is not None else clock.authority()
        if told.utc_offset is not None and told.key in self._lag:
            return told.utc_offset
        return clock.by_envelope(0) + self.session_time(received_at) - received_at

    @property
    def anchor(self) -> tuple[int, int]:
        """A stamp and its session time: where it changes, the session's time has leapt, or runs at another speed."""
        return self._anchor

    def when(self, clock: SourceClock, boot_ns: int, received_at: int) -> tuple[int, Timing]:
        """The session's time of a source's time since boot, and how far that can be trusted."""
        told = clock if clock.utc_offset is not None else clock.authority()  # tens of thousands of times a second
        utc = None if told.utc_offset is None else boot_ns + told.utc_offset
        timing = Timing.PROVISIONAL if utc is None else self.timing(told.key)
        if utc is None or timing is Timing.PROVISIONAL:
            utc = clock.by_envelope(boot_ns) + self.session_time(received_at) - received_at
            timing = Timing.ENVELOPE if clock.is_old(received_at) else Timing.PROVISIONAL
        else:
            told.pinned = told.key == self.reference
        return utc, (Timing.FOREIGN if clock.step_to(utc, utc - boot_ns) else timing)
