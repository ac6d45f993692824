"""The clock of one source: from its time since boot to UTC, as a pure function of the frames so far.

A frame's arrival says little about when it was measured: radio links hold frames back for seconds. So the time of a
measurement is the source's own time since boot, brought to UTC by the median offset of its SYSTEM_TIME messages. A source
that has told no UTC runs on the lower envelope of (received - boot): the least delayed frame lately heard sets its clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from statistics import median_low

from gateway.observation import Timing

SECOND = 10**9
LIMIT_NS = 5 * SECOND  # a source whose clock is further from the session's is foreign
_MILLISECOND = 10**6
_WRAP_MS = 1 << 32  # 49.7 days
_NEAR_WRAP_MS = 3_600_000
_REBOOT_MS = 1000
_LATE_MS = 10_000  # a step back by less can be a frame that was held back
_LEAST_UTC_NS = 10**18  # 2001: a smaller "UTC" is a time since boot
_GREATEST_UTC_NS = 7_258_118_400 * SECOND  # 2200
_OFFSETS = 31
_STEP_NS = SECOND // 2
_BUCKET_NS = 30 * SECOND
_SPEED_WINDOW_NS = 2 * SECOND
_ENVELOPE_AFTER_NS = 15 * SECOND


@dataclass(slots=True)
class Envelope:
    """The least of a value over the last 30 to 60 s."""

    _since: int = 0
    _least: int | None = None
    _before: int | None = None

    def hear(self, at: int, value: int) -> int:
        """Take a value in; the least one lately heard."""
        if self._least is None:
            self._since, self._least = at, value
        elif at - self._since >= _BUCKET_NS:
            self._since, self._before, self._least = at, self._least, value
        elif value < self._least:
            self._least = value
        return self._least if self._before is None else min(self._least, self._before)


@dataclass(slots=True)
class SpeedMeter:
    """How fast a source's clock runs against ours: 1, or what two windows of 2 s agree on; None while not known.

    A link that stalls and then delivers everything at once makes one window slow and the next fast; a simulator that
    runs at another speed makes them alike. So windows have to agree before a speed other than 1 is believed.
    """

    needed: int = 2
    speed: float | None = None
    _begin: tuple[int, int] | None = None
    _ratios: deque[float] = field(default_factory=lambda: deque(maxlen=3))

    def hear(self, received_at: int, source_ns: int) -> None:
        """Take in a pair of our time and the source's."""
        if self._begin is None or source_ns < self._begin[1]:
            self._begin = (received_at, source_ns)
            return
        elapsed = received_at - self._begin[0]
        if elapsed < _SPEED_WINDOW_NS:
            return
        ratio = (source_ns - self._begin[1]) / elapsed
        self._begin = (received_at, source_ns)
        self._ratios.append(ratio)
        lately = list(self._ratios)[-self.needed :]
        if 0.8 <= ratio <= 1.25:
            self.speed = 1.0
        elif len(lately) == self.needed and max(lately) <= 1.25 * min(lately):
            self.speed = sum(lately) / len(lately)
            self.needed = 3  # once settled, a change needs more


@dataclass(slots=True)
class SourceClock:
    """The clock of one (source, system, component)."""

    utc_offset: int | None = None  # UTC minus time since boot, ns
    reboots: int = 0
    speed: SpeedMeter = field(default_factory=SpeedMeter)
    _first_heard: int | None = None
    _last_ms: int = -1
    _wraps: int = 0
    _last: tuple[int, int] = (0, 0)  # time since boot and stamp of the newest frame
    _suspects: list[tuple[int, int]] = field(default_factory=list)
    _offsets: deque[int] = field(default_factory=lambda: deque(maxlen=_OFFSETS))
    _envelope: Envelope = field(default_factory=Envelope)
    _least: int = 0

    def hear(self, boot_ms: int, received_at: int) -> int | None:
        """Time since boot (ns, unwrapped) of a frame; None while it cannot be told whether the source has rebooted.

        A step back is a wrap at 49.7 days, a frame that was held back, or a reboot: the latter once more frames agree.
        """
        if self._first_heard is None:
            self._first_heard = received_at
        wrapped = False
        step = boot_ms - self._last_ms
        if self._last_ms >= 0 and step < -_REBOOT_MS:
            wrapped = self._last_ms > _WRAP_MS - _NEAR_WRAP_MS and boot_ms < _NEAR_WRAP_MS
            if wrapped:
                self._wraps += 1
            else:
                placed = self._step_back(boot_ms, received_at)
                if placed is not None or self._last_ms >= 0:
                    return placed
        elif step > _WRAP_MS // 2 and self._wraps:  # held back from before the wrap
            return (boot_ms + (self._wraps - 1) * _WRAP_MS) * _MILLISECOND
        else:
            self._suspects.clear()
        boot_ns = (boot_ms + self._wraps * _WRAP_MS) * _MILLISECOND
        if boot_ms > self._last_ms or wrapped:
            self._last_ms, self._last = boot_ms, (boot_ns, received_at)
            self.speed.hear(received_at, boot_ns)
        self._least = self._envelope.hear(received_at, received_at - boot_ns)
        return boot_ns

    def _step_back(self, boot_ms: int, received_at: int) -> int | None:
        """A time more than a second before the newest: placed by the old clock, or kept as a suspect of a reboot."""
        back_ms = self._last_ms - boot_ms
        offset = received_at // _MILLISECOND - boot_ms
        if self._suspects and abs(offset - self._suspects[-1][1]) > 500:
            self._suspects.clear()
        self._suspects.append((received_at, offset))
        span = received_at - self._suspects[0][0]
        if len(self._suspects) >= 3 if back_ms > _LATE_MS else len(self._suspects) >= 5 and span >= SECOND:
            self._reboot()
            return None
        return None if back_ms > _LATE_MS else (boot_ms + self._wraps * _WRAP_MS) * _MILLISECOND

    def _reboot(self) -> None:
        self.reboots += 1
        self.utc_offset, self._last_ms, self._wraps = None, -1, 0
        self._first_heard = self._suspects[0][0]
        self._suspects.clear()
        self._offsets.clear()
        self._envelope, self.speed = Envelope(), SpeedMeter()

    def set_utc(self, boot_ns: int, unix_ns: int) -> bool:
        """What a SYSTEM_TIME says; whether it said a UTC at all. Two that agree set the clock.

        A single one could be what a receiver believes before its fix.
        """
        if not _LEAST_UTC_NS <= unix_ns < _GREATEST_UTC_NS:
            return False
        offset = unix_ns - boot_ns
        if self._offsets and abs(offset - self._offsets[-1]) > _STEP_NS:
            self._offsets.clear()  # the source set its clock, or did before: only one of them is right
        self._offsets.append(offset)
        if len(self._offsets) >= 2:
            self.utc_offset = median_low(self._offsets)
        return True

    def boot_at(self, received_at: int) -> int:
        """Time since boot of a frame that carries none: the newest one heard, and the time since then."""
        return self._last[0] + min(max(received_at - self._last[1], 0), SECOND)

    def utc(self, boot_ns: int) -> int | None:
        """UTC by the source's own clock; None as long as it is not set."""
        return None if self.utc_offset is None else boot_ns + self.utc_offset

    def by_envelope(self, boot_ns: int) -> int:
        """The receiver's time when this was so, by the least delayed frame lately heard."""
        return boot_ns + self._least

    def is_old(self, received_at: int) -> bool:
        """Whether it has been heard for 15 s: then the envelope is as good as it gets."""
        return self._first_heard is not None and received_at - self._first_heard >= _ENVELOPE_AFTER_NS

    def is_settled(self, received_at: int) -> bool:
        """Whether it has been heard for 5 s: other messages of the same vehicle would have come by then."""
        return self._first_heard is not None and received_at - self._first_heard >= 5 * SECOND

    def has_been_heard(self) -> bool:
        """Whether any frame has carried a time since boot."""
        return self._last_ms >= 0


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
        if source == self.reference:
            self._follow(utc, received_at, speed or 1.0)
        envelope = self._envelopes.setdefault(source, Envelope())
        self._lag[source] = envelope.hear(received_at, self.session_time(received_at) - utc)
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
        if source == self.reference or abs(lag - self._lag[self.reference]) < LIMIT_NS:
            return Timing.UTC
        return Timing.FOREIGN

    def lag_s(self, source: object) -> float:
        """How far a source's clock is behind the session's."""
        return self._lag.get(source, 0) / SECOND
