"""Instants and mutes as people write them, for a recording that goes from one stamp to another.

90    1:30    1:02:03               from the recording's start
00:05:00Z                           UTC, the first time that the recording comes by there
2026-01-01T00:05:00Z                UTC; without Z or an offset it is UTC too

gps    gps:60:90    gps:1:60:90     all positions, those of vehicle 1; the same for radar
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import cast

from gateway.settings.options import Mute, MutedSource

SECOND = 10**9
_DAY_NS = 86_400 * SECOND
_STEP_NS = 4_000
_LONGEST_S = 1e9
_ELAPSED = r"\d+(?:\.\d+)?"
_OF_DAY = r"\d\d:\d\d(?::\d\d(?:\.\d+)?)?Z"
_DATED = r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:\d\d)?"
_TOKEN = re.compile(f"({_DATED}|{_OF_DAY}|{_ELAPSED})(?::|$)")
_HOW = "write 90, 1:30 or 1:02:03 from the start, or 2026-01-01T00:05:00Z"
_HOW_MUTE = "write gps, gps:60:90, gps:1:60:90 for vehicle 1, radar:60:90, or radar:1:30:40 for radar 1"


class SeekError(ValueError):
    """An instant that cannot be read, or that the recording does not hold; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class Span:
    """From when to when a recording goes: receiver's stamps, and what has to be added to them for UTC (ns)."""

    first: int
    last: int
    utc_offset: int = 0

    def __str__(self) -> str:
        seconds = (self.last - self.first) / SECOND
        return (
            f"the recording goes from {_clock(self.first + self.utc_offset)} for {seconds:.1f} s ({_elapsed(seconds)})"
        )

    def instant(self, text: str, option: str) -> int:
        """The stamp of an instant within the recording. Raises SeekError."""
        stamp = self._read(text, option)
        if not self.first <= stamp <= self.last:
            raise SeekError(f"{option} {text} is outside: {self}.")
        return stamp

    def mute(self, text: str) -> Mute:
        """What is muted when. Times beyond the recording's end are its end. Raises SeekError."""
        option = "--mute"
        what, *tokens = _mute_tokens(text)
        number = int(tokens.pop(0)) if len(tokens) in (1, 3) else None
        source = cast(MutedSource, what)
        if not tokens:
            return Mute(source, number, self.first, self.last + _STEP_NS)
        since, until = (self._read(token, option) for token in tokens)
        if not since < until:
            raise SeekError(f"--mute {text} ends before it begins.")
        if until <= self.first or since > self.last:
            raise SeekError(f"--mute {text} is outside: {self}.")
        return Mute(source, number, since, until)

    def _read(self, text: str, option: str) -> int:
        if re.fullmatch(_DATED, text):
            return self._of_date(text, option)
        if re.fullmatch(_OF_DAY, text):
            begin = datetime.fromtimestamp((self.first + self.utc_offset) // SECOND, UTC)
            stamp = self._of_date(f"{begin:%Y-%m-%d}T{text}", option)
            return stamp + _DAY_NS if stamp < self.first - SECOND else max(stamp, self.first)
        parts = text.split(":")
        if not 1 <= len(parts) <= 3 or not all(re.fullmatch(_ELAPSED, part) for part in parts):
            raise SeekError(f"{option} {text!r} is no time: {_HOW}.")
        seconds = 0.0
        for part in parts:
            seconds = seconds * 60 + float(part)
        return self.first + round(min(seconds, _LONGEST_S) * SECOND) // _STEP_NS * _STEP_NS

    def _of_date(self, text: str, option: str) -> int:
        try:
            moment = datetime.fromisoformat(text)
        except ValueError as error:
            raise SeekError(f"{option} {text!r} is no time: {_HOW}.") from error
        moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        since_1970 = moment - datetime(1970, 1, 1, tzinfo=UTC)
        return since_1970 // timedelta(microseconds=1) * 1000 // _STEP_NS * _STEP_NS - self.utc_offset


def _mute_tokens(text: str) -> list[str]:
    """What, perhaps a number, perhaps two instants. Raises SeekError."""
    what, _, rest = text.partition(":")
    tokens = _TOKEN.findall(rest)
    if what not in ("gps", "radar") or "".join(f"{token}:" for token in tokens) != (f"{rest}:" if rest else ""):
        raise SeekError(f"--mute {text!r} is not understood: {_HOW_MUTE}.")
    if any(":" in token for token in tokens):
        parts = tokens  # instants that need no joining
    else:
        numbered = len(tokens) % 2
        size = len(tokens) // 2  # of an instant: seconds, minutes and seconds, or hours too
        ends = (tokens[numbered : numbered + size], tokens[numbered + size :])
        parts = [*tokens[:numbered], *(":".join(end) for end in ends if end)]
    has_number = len(parts) in (1, 3)
    if len(parts) > 3 or len(tokens) > 7 or (has_number and not parts[0].isdecimal()):
        raise SeekError(f"--mute {text!r} is not understood: {_HOW_MUTE}.")
    return [what, *parts]


def _clock(stamp: int) -> str:
    return datetime.fromtimestamp(stamp // SECOND, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _elapsed(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
