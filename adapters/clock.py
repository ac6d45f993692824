"""The clock of one source: from its time since boot to UTC, as a pure function of the frames so far.

A frame's arrival says little about when it was measured: radio links hold frames back for seconds. So the time of a
measurement is the source's own time since boot, brought to UTC by the median offset of its SYSTEM_TIME messages. A source
that has told no UTC runs on the lower envelope of (received - boot): the least delayed frame lately heard sets its clock.

When a source passes from the envelope to UTC (GPS lock in the middle of a flight), or sets its date anew, its times step.
What falls into times that it has already told by the clock before is marked FOREIGN: shown, not fused, so that no track
is pulled to and fro. A source that gave the session its epoch and then sets another date keeps the date it began with.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median, median_low

from adapters.meters import SECOND as SECOND
from adapters.meters import Delays, Envelope, SpeedMeter

LIMIT_NS = 5 * SECOND  # a source whose clock is further from the session's is foreign
_MILLISECOND = 10**6
_WRAP_MS = 1 << 32  # 49.7 days
_NEAR_WRAP_MS = 3_600_000
_REBOOT_MS = 1000
_LATE_MS = 10_000  # a step back by less can be a frame that was held back
_LEAST_UTC_NS = (
    1_230_768_000 * SECOND
)  # 2009, when MAVLink began: less is a time since boot, or a GPS week that rolled over
_GREATEST_UTC_NS = 7_258_118_400 * SECOND  # 2200
_OFFSETS = 31
_STEP_NS = SECOND // 2
_ENVELOPE_AFTER_NS = 15 * SECOND
_YOUNG_MS = 60_000  # a small step back is a reboot only where the time since boot is this short
_STRAGGLER_MS = 10_000
_SAME_BASE_NS = 50 * _MILLISECOND
_LEAST_SIGMA_S = 1e-3  # times are told in whole ms
_SIBLINGS_APART_NS = 2 * SECOND


@dataclass(slots=True)
class SourceClock:
    """The clock of one (source, system, component). `siblings`: clocks of the same component heard over other links."""

    key: object = None
    utc_offset: int | None = None  # UTC minus time since boot, ns
    reboots: int = 0
    pinned: bool = False  # the session runs on its date: a new date is not followed
    date_steps: int = 0  # new dates that were not followed
    speed: SpeedMeter = field(default_factory=SpeedMeter)
    delays: Delays = field(default_factory=Delays)
    siblings: list[SourceClock] = field(default_factory=list)
    _first_heard: int | None = None
    _last_ms: int = -1
    _wraps: int = 0
    _last: tuple[int, int] = (0, 0)  # time since boot and stamp of the newest frame
    _suspects: list[tuple[int, int]] = field(default_factory=list)
    _before: tuple[int, int, int] | None = None  # before the reboot: newest ms, least delay, and when it was noticed
    _offsets: deque[int] = field(default_factory=lambda: deque(maxlen=_OFFSETS))
    _told_utc: int = -1  # time since boot of the last SYSTEM_TIME
    _envelope: Envelope = field(default_factory=Envelope)
    _least: int = 0
    _base: int | None = None  # what was last added to the time since boot
    _newest: int = 0  # the newest time that was made with it
    _floor: int = 0  # the newest time that was made with the one before

    def hear(self, boot_ms: int, received_at: int) -> int | None:
        """Time since boot (ns, unwrapped) of a frame; None while it cannot be told whether the source has rebooted.

        A step back is a wrap at 49.7 days, a frame that was held back, or a reboot: the latter once more frames agree.
        """
        if self._first_heard is None:
            self._first_heard = received_at
        wrapped = False
        step = boot_ms - self._last_ms
        if step < -_REBOOT_MS and self._last_ms >= 0:
            wrapped = self._last_ms > _WRAP_MS - _NEAR_WRAP_MS and boot_ms < _NEAR_WRAP_MS
            if wrapped:
                self._wraps += 1
            else:
                placed = self._step_back(boot_ms, received_at)
                if placed is not None or self._last_ms >= 0:
                    return placed
        elif step > _STRAGGLER_MS and self._wraps and step > _WRAP_MS // 2:  # held back from before the wrap
            return (boot_ms + (self._wraps - 1) * _WRAP_MS) * _MILLISECOND
        elif step > _STRAGGLER_MS and self._before and self._is_straggler(boot_ms, received_at):
            return None
        elif self._suspects:
            self._suspects.clear()
        boot_ns = (boot_ms + self._wraps * _WRAP_MS) * _MILLISECOND
        if step > 0 or wrapped or self._last_ms < 0:
            self._last_ms, self._last = boot_ms, (boot_ns, received_at)
            self.speed.hear(received_at, boot_ns)
        delay = received_at - boot_ns
        self._least = least = self._envelope.hear(received_at, delay)
        self.delays.hear(received_at, delay - least)
        return boot_ns

    def _step_back(self, boot_ms: int, received_at: int) -> int | None:
        """A time more than a second before the newest: placed by the old clock, or kept as a suspect of a reboot."""
        back_ms = self._last_ms - boot_ms
        placed = (boot_ms + self._wraps * _WRAP_MS) * _MILLISECOND
        if back_ms <= _LATE_MS and boot_ms >= _YOUNG_MS:
            return placed  # over a slower path of the same link
        offset = received_at // _MILLISECOND - boot_ms
        if self._suspects and abs(offset - self._suspects[-1][1]) > 500:
            self._suspects.clear()
        if len(self._suspects) < 5:
            self._suspects.append((received_at, offset))
        span = received_at - self._suspects[0][0]
        if len(self._suspects) >= 3 if back_ms > _LATE_MS else len(self._suspects) >= 5 and span >= SECOND:
            self._reboot(received_at)
            return None
        return None if back_ms > _LATE_MS else placed

    def _reboot(self, received_at: int) -> None:
        self.reboots += 1
        self._before = (self._last_ms, self._least, received_at)
        self.utc_offset, self._last_ms, self._wraps, self._told_utc = None, -1, 0, -1
        self._first_heard = self._suspects[0][0]
        self._suspects.clear()
        self._offsets.clear()
        self._envelope, self.speed, self.delays = Envelope(), SpeedMeter(), Delays()

    def _is_straggler(self, boot_ms: int, received_at: int) -> bool:
        """Whether a frame that leaps ahead is one from before the reboot, held back until after it."""
        assert self._before is not None
        newest_ms, least, noticed = self._before
        if received_at - noticed > 60 * SECOND:
            self._before = None
            return False
        return boot_ms <= newest_ms + _STRAGGLER_MS and received_at - boot_ms * _MILLISECOND >= least - SECOND

    def set_utc(self, boot_ns: int, unix_ns: int) -> bool:
        """What a SYSTEM_TIME says; whether it said a UTC at all. Two that agree set the clock.

        A single one could be what a receiver believes before its fix; the same one heard twice is a single one.
        """
        if not _LEAST_UTC_NS <= unix_ns < _GREATEST_UTC_NS:
            return False
        if boot_ns == self._told_utc:
            return True
        self._told_utc = boot_ns
        offset = unix_ns - boot_ns
        if self._offsets and abs(offset - self._offsets[-1]) > _STEP_NS:
            self._offsets.clear()  # the source set its clock, or did before: only one of them is right
        self._offsets.append(offset)
        if len(self._offsets) >= 2:
            self._adopt(median_low(self._offsets))
        return True

    def _adopt(self, offset: int) -> None:
        if self.pinned and self.utc_offset is not None and abs(offset - self.utc_offset) >= LIMIT_NS:
            self.date_steps += len(self._offsets) == 2
            return
        self.utc_offset = offset

    def newest(self) -> tuple[int, int] | None:
        """The newest time since boot heard, ns, and its stamp; None before the first."""
        return self._last if self._last_ms >= 0 else None

    def boot_at(self, received_at: int) -> int:
        """Time since boot of a frame that carries none: the newest one heard, and the time since then."""
        return self._last[0] + min(max(received_at - self._last[1], 0), SECOND)

    def utc(self, boot_ns: int) -> int | None:
        """UTC by the source's own clock; None as long as it is not set."""
        return None if self.utc_offset is None else boot_ns + self.utc_offset

    def by_envelope(self, boot_ns: int) -> int:
        """The receiver's time when this was so, by the least delayed frame lately heard, over whichever link."""
        least = self._least
        for sibling in self.siblings:
            if sibling._agrees_with(self):
                least = min(least, sibling._least)
        return boot_ns + least

    def _agrees_with(self, other: SourceClock) -> bool:
        """Whether both are of the same boot, as far as the delays of their links tell."""
        return self._last_ms >= 0 and abs(self._least - other._least) < _SIBLINGS_APART_NS

    def authority(self) -> SourceClock:
        """The clock that knows this boot's UTC: this one, else one of its siblings; this one where none knows it."""
        if self.utc_offset is None:
            for sibling in self.siblings:
                if sibling.utc_offset is not None and sibling._agrees_with(self):
                    return sibling
        return self

    def least_delay(self) -> int | None:
        """The least (received - boot) lately heard, ns; None before the first frame."""
        return self._least if self._last_ms >= 0 else None

    def step_to(self, valid: int, base: int) -> bool:
        """Note a time that was made by adding `base`; whether it falls into what was told by another base before.

        A step back by more than 5 s is another time altogether, and no overlap.
        """
        if self._base is None or abs(base - self._base) > _SAME_BASE_NS:
            self._floor = self._newest if self._base is not None and self._newest - valid < LIMIT_NS else 0
            self._newest = max(self._floor, valid)
        elif valid > self._newest:
            self._newest = valid
        self._base = base
        return valid <= self._floor

    def sigma_s(self) -> float:
        """How well the time is known, 1 sigma, s: by the spread of UTC offsets, else of delays; NaN = not known yet."""
        if self.utc_offset is not None and len(self._offsets) >= 2:
            middle = median_low(self._offsets)
            return max(1.4826e-9 * median(abs(one - middle) for one in self._offsets), _LEAST_SIGMA_S)
        (typical,) = self.delays.quantiles(0.5)
        return typical if math.isnan(typical) else max(typical, _LEAST_SIGMA_S)

    def is_old(self, received_at: int) -> bool:
        """Whether it has been heard for 15 s: then the envelope is as good as it gets."""
        return self._first_heard is not None and received_at - self._first_heard >= _ENVELOPE_AFTER_NS

    def is_settled(self, received_at: int) -> bool:
        """Whether it has been heard for 5 s: other messages of the same vehicle would have come by then."""
        return self._first_heard is not None and received_at - self._first_heard >= 5 * SECOND

    def has_been_heard(self) -> bool:
        """Whether any frame has carried a time since boot."""
        return self._last_ms >= 0
