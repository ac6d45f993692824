"""What is measured of a source's link as its frames come in: the least delay, how the delays spread, the clock's speed.

Each is bounded in memory and takes a frame in constant time.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field

SECOND = 10**9
BUCKET_NS = 30 * SECOND
_MILLISECOND = 10**6
_SPEED_WINDOW_NS = 2 * SECOND
_FASTEST = 1000.0  # faster than any simulator: times that are none
_FINE = 16  # delays below 16 ms are counted by the millisecond, longer ones in eighths of an octave
_CELLS = 152  # up to 2^21 ms, 35 minutes
_LEAST_DELAYS = 20
_RATE_NS = 5 * SECOND


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
        elif at - self._since >= BUCKET_NS:
            self._since, self._before, self._least = at, self._least, value
        elif value < self._least:
            self._least = value
        return self._least if self._before is None else min(self._least, self._before)


@dataclass(slots=True)
class Delays:
    """How much longer than the fastest a link's frames took, over the last 30 to 60 s.

    A histogram whose cells are 1 ms wide, and above 16 ms an eighth of an octave: quantiles are good to 1 ms or 9 %.
    """

    _since: int = 0
    _now: list[int] = field(default_factory=lambda: [0] * _CELLS)
    _before: list[int] = field(default_factory=lambda: [0] * _CELLS)

    def hear(self, at: int, excess_ns: int) -> None:
        """Take in one frame's delay above the least, ns (never negative), at a stamp."""
        if at - self._since >= BUCKET_NS:
            late = at - self._since >= 2 * BUCKET_NS
            self._since, self._now, self._before = at, [0] * _CELLS, [0] * _CELLS if late else self._now
        cell = excess_ns // _MILLISECOND
        if cell >= _FINE:
            shift = cell.bit_length() - 4
            cell = (shift << 3) + (cell >> shift)
            if cell >= _CELLS:
                cell = _CELLS - 1
        self._now[cell] += 1

    def quantiles(self, *parts: float) -> tuple[float, ...]:
        """The quantiles (0..1) in s; NaN where fewer than 20 frames were heard lately."""
        cells = [now + before for now, before in zip(self._now, self._before, strict=True)]
        total = sum(cells)
        if total < _LEAST_DELAYS:
            return (math.nan,) * len(parts)
        return tuple(_quantile(cells, part * total) for part in parts)


def _quantile(cells: list[int], wanted: float) -> float:
    passed = 0
    for cell, number in enumerate(cells):
        passed += number
        if passed >= wanted and number:
            return _middle_ms(cell) / 1000
    return math.nan


def _middle_ms(cell: int) -> float:
    """The middle of a cell; the frames in the first one are the fastest."""
    if cell < _FINE:
        return float(cell)
    shift, eighth = (cell >> 3) - 1, cell % 8 + 8
    return (eighth + 0.5) * (1 << shift)


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
        if ratio > _FASTEST:
            return
        self._ratios.append(ratio)
        lately = list(self._ratios)[-self.needed :]
        if 0.8 <= ratio <= 1.25:
            self.speed = 1.0
        elif len(lately) == self.needed and max(lately) <= 1.25 * min(lately):
            self.speed = sum(lately) / len(lately)
            self.needed = 3  # once settled, a change needs more


@dataclass(slots=True)
class Rates:
    """How often each kind of message comes: counted in two buckets of 5 s."""

    until: int = 0  # the stamp at which the bucket ends
    now: dict[int, int] = field(default_factory=dict)
    _before: dict[int, int] = field(default_factory=dict)

    def hear(self, kind: int, at: int) -> None:
        """Count one message of a kind at a stamp."""
        if at >= self.until:
            self.turn(at)
        self.now[kind] = self.now.get(kind, 0) + 1

    def hear_all(self, kinds: Iterable[int]) -> None:
        """Count one message of each of these kinds, in the bucket that goes on."""
        now = self.now
        for kind, count in Counter(kinds).items():
            now[kind] = now.get(kind, 0) + count

    def turn(self, at: int) -> None:
        """Begin the next bucket."""
        self._before = self.now if at < self.until + _RATE_NS else {}
        self.until, self.now = at + _RATE_NS, {}

    def per_second(self, at: int) -> dict[int, float]:
        """Messages a second by kind, over the last 5 to 10 s; kinds that were not heard then are left out."""
        behind = at - (self.until - _RATE_NS)
        if behind > 2 * _RATE_NS:
            return {}
        span_s = max(behind + _RATE_NS * bool(self._before), SECOND) / SECOND
        kinds = sorted(self.now.keys() | self._before.keys())
        return {kind: (self.now.get(kind, 0) + self._before.get(kind, 0)) / span_s for kind in kinds}
