"""Are two that say the same system number one vehicle, heard over two links? Judged by what they say of their motion.

An autopilot sends different frames on each of its ports, with sequence numbers and a schedule of their own. But its time
since boot is one, and so is where it is at that time. For a pair of links:

    apart                                              one flight of the two, at the same time since boot, is more than
                                                       20 m (or 0.1 rad of attitude) from the other's: two vehicles
    UTC of boot agrees within 50 ms, and the places    one
    UTC of boot differs by more than 0.5 s             two
    no UTC: boot (by the least delayed frames) agrees  one
    within 0.3 s, and the places within 5 m
    no UTC, and boot differs by more than 10 s         two: no link holds frames back for so long
    none of these for 10 s                             one where both were at the same places (5 m) at the same times since
                                                       boot over more than 50 m of flight, else two

Two simulators that stand at one place and booted within 50 ms of one another cannot be told apart until they move.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from itertools import islice, pairwise
from statistics import median
from struct import Struct

from adapters.meters import SECOND, Envelope

ATTITUDE, GLOBAL_POSITION_INT = 30, 33
_POSITION = Struct("<Iiii")
_ATTITUDE = Struct("<Ifff")
_MILLISECOND = 10**6
_REMEMBERED = 256
_WIDEST_GAP_MS = {GLOBAL_POSITION_INT: 2500, ATTITUDE: 300}
_BACK_MS = 10_000
_LIKE_M, _UNLIKE_M, _SPLIT_M = 5.0, 20.0, 50.0
_LIKE_RAD, _UNLIKE_RAD = 0.05, 0.1
_LIKE_UTC_NS, _UNLIKE_UTC_NS = 50 * _MILLISECOND, 500 * _MILLISECOND
_LIKE_BOOT_NS, _UNLIKE_BOOT_NS = 300 * _MILLISECOND, 10 * SECOND
_POSITIONS, _ATTITUDES = 5, 10
_SHORTEST_NS, _PATIENCE_NS = 1_500_000_000, 10 * SECOND
_MOVED_M = 50.0
_SPLIT_MS = 3000
_M_PER_DEGE7 = math.radians(1e-7) * 6_371_000

Sample = tuple[int, float, float, float]  # time since boot, ms; then dege7, dege7, mm or roll, pitch, yaw


@dataclass(slots=True)
class Trace:
    """What one system number on one source lately said of its motion, by time since boot, and of its UTC."""

    since: int  # stamp
    moves: dict[int, deque[Sample]] = field(default_factory=dict)
    heard: Counter[int] = field(default_factory=Counter)  # how many of each message were taken in
    least: int | None = None  # (received - boot), ns
    utc_offset: int | None = None
    _told: tuple[int, int] | None = None
    _envelope: Envelope = field(default_factory=Envelope)

    def hear(self, message: int, payload: bytes, received_at: int) -> None:
        """Take in an ATTITUDE or a GLOBAL_POSITION_INT. Without a place, or out of order, it is left out."""
        layout = _POSITION if message == GLOBAL_POSITION_INT else _ATTITUDE
        sample: Sample = layout.unpack(payload[:16].ljust(16, b"\0"))
        boot_ms = sample[0]
        self.least = self._envelope.hear(received_at, received_at - boot_ms * _MILLISECOND)
        if (message == GLOBAL_POSITION_INT and sample[1] == sample[2] == 0) or not math.isfinite(sum(sample[1:])):
            return
        told = self.moves.get(message)
        if told is None:
            told = self.moves[message] = deque(maxlen=_REMEMBERED)
        if told and boot_ms <= told[-1][0]:
            if told[-1][0] - boot_ms < _BACK_MS:
                return
            self._begin_anew()
        told.append(sample)
        self.heard[message] += 1

    def _begin_anew(self) -> None:
        for samples in self.moves.values():
            samples.clear()
        self._envelope, self.utc_offset, self._told = Envelope(), None, None

    def hear_utc(self, unix_ns: int, boot_ms: int) -> None:
        """Take in a SYSTEM_TIME that tells a UTC; two of them that agree are believed."""
        offset = unix_ns - boot_ms * _MILLISECOND
        if self._told is not None and boot_ms != self._told[0] and abs(offset - self._told[1]) < _LIKE_UTC_NS:
            self.utc_offset = offset
        self._told = (boot_ms, offset)


@dataclass(slots=True)
class Likeness:
    """How one trace compares with another, of which it was said that they are the same vehicle."""

    one: Trace
    other: Trace
    apart_m: deque[float] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))
    apart_rad: deque[float] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))
    _compared: Counter[int] = field(default_factory=Counter)  # of what `one` has heard
    _first: Sample | None = None
    _last: Sample | None = None
    _far_since: int | None = None  # time since boot, ms
    _far: int = 0

    def compare(self) -> None:
        """Compare what has come of `one`, as far as `other` has told of the same times since boot."""
        for message, told in self.one.moves.items():
            there = self.other.moves.get(message)
            waiting = min(self.one.heard[message] - self._compared[message], len(told))
            self._compared[message] = self.one.heard[message] - waiting
            for sample in list(islice(told, len(told) - waiting, None)):
                if not there or sample[0] > there[-1][0]:
                    break
                self._compared[message] += 1
                then = _at(there, sample[0], message)
                if then is None:
                    continue
                if message == GLOBAL_POSITION_INT:
                    self._note(sample, _distance_m(sample, then))
                else:
                    self.apart_rad.append(_turn_rad(sample, then))

    def _note(self, sample: Sample, apart_m: float) -> None:
        self.apart_m.append(apart_m)
        self._first, self._last = self._first or sample, sample
        if apart_m <= _SPLIT_M:
            self._far_since, self._far = None, 0
        else:
            self._far_since = sample[0] if self._far_since is None else self._far_since
            self._far += 1

    def have_parted(self) -> bool:
        """Whether two that were taken for one have been more than 50 m apart for 3 s and five positions."""
        if self._far_since is None or self._last is None:
            return False
        return self._far >= _POSITIONS and self._last[0] - self._far_since >= _SPLIT_MS

    def verdict(self, received_at: int) -> bool | None:
        """True: one vehicle. False: two. None: it cannot be told yet. Who never tells of its motion is taken for the other."""
        waited = received_at - max(self.one.since, self.other.since)
        if self.one.least is None or self.other.least is None:
            return True if waited >= _PATIENCE_NS else None
        if waited < _SHORTEST_NS:
            return None
        apart_m = median(self.apart_m) if len(self.apart_m) >= _POSITIONS else math.nan
        apart_rad = median(self.apart_rad) if len(self.apart_rad) >= _ATTITUDES else math.nan
        if apart_m > _UNLIKE_M or apart_rad > _UNLIKE_RAD:
            return False
        alike = apart_m <= _LIKE_M or (not self.apart_m and apart_rad <= _LIKE_RAD)
        same_boot = self._same_boot(self.one.least - self.other.least)
        if same_boot is False or (same_boot and alike):
            return same_boot
        if waited < _PATIENCE_NS:
            return None
        return apart_m <= _LIKE_M and self._moved_m() > _MOVED_M

    def _same_boot(self, apart_ns: int) -> bool | None:
        if self.one.utc_offset is not None and self.other.utc_offset is not None:
            apart_ns, like, unlike = self.one.utc_offset - self.other.utc_offset, _LIKE_UTC_NS, _UNLIKE_UTC_NS
        else:
            like, unlike = _LIKE_BOOT_NS, _UNLIKE_BOOT_NS
        return True if abs(apart_ns) <= like else False if abs(apart_ns) > unlike else None

    def _moved_m(self) -> float:
        return 0.0 if self._first is None or self._last is None else _distance_m(self._first, self._last)


def _at(samples: deque[Sample], boot_ms: int, message: int) -> Sample | None:
    """What was so at a time since boot, between the two samples about it; None where they are too far apart."""
    for after, before in pairwise(reversed(samples)):
        if before[0] <= boot_ms <= after[0]:
            span = after[0] - before[0]
            if span > _WIDEST_GAP_MS[message]:
                return None
            part = (boot_ms - before[0]) / span
            steps = [a - b for a, b in zip(after[1:], before[1:], strict=True)]
            if message == ATTITUDE:
                steps = [_short_way(step) for step in steps]
            first, second, third = (b + part * step for b, step in zip(before[1:], steps, strict=True))
            return boot_ms, first, second, third
    return None


def _short_way(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _distance_m(one: Sample, other: Sample) -> float:
    north = (one[1] - other[1]) * _M_PER_DEGE7
    east = (one[2] - other[2] + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
    return math.hypot(north, east * _M_PER_DEGE7 * math.cos(math.radians(one[1] * 1e-7)), (one[3] - other[3]) / 1000)


def _turn_rad(one: Sample, other: Sample) -> float:
    return max(abs(_short_way(a - b)) for a, b in zip(one[1:], other[1:], strict=True))
