"""Which of the archived sessions are meant, and in which order: dates, ages, lengths and sizes as people write them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli.failures import UsageError

if TYPE_CHECKING:
    from gateway.runtime.listing import Listed

_LENGTHS_S = {"s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0, "y": 31_557_600.0}
_SIZES = {"": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}
_DATE = re.compile(r"(\d{4})-?(\d\d)(?:-?(\d\d)(?:[T ]?(\d\d):?(\d\d)(?::?(\d\d))?Z?)?)?")


class Sorting(StrEnum):
    """What sessions are ordered by."""

    time = "time"
    length = "length"
    size = "size"
    site = "site"
    ended = "ended"
    vehicles = "vehicles"


_KEYS: dict[Sorting, Callable[[Listed], Any]] = {
    Sorting.time: lambda one: one.started_at,
    Sorting.length: lambda one: one.length_s or 0.0,
    Sorting.size: lambda one: one.size_bytes,
    Sorting.site: lambda one: one.site.casefold(),
    Sorting.ended: lambda one: one.ended,
    Sorting.vehicles: lambda one: len(one.vehicles),
}


def _text(name: str, metavar: str, says: str) -> Any:
    return typer.Option(name, metavar=metavar, help=says, show_default=False)


@dataclass(frozen=True, slots=True)
class Filters:
    """Which sessions are meant: those for which everything that was said holds."""

    vehicle: Annotated[
        str | None, _text("--vehicle", "NAME", "With this vehicle: mavlink:1, or a pattern such as icao:4840*.")
    ] = None
    site: Annotated[str | None, _text("--site", "TEXT", "At a site whose name holds this.")] = None
    since: Annotated[
        str | None,
        _text("--since", "WHEN", "Begun then or later, UTC: 2026-03-01, 2026-03-01T12:00, today, or 7d ago."),
    ] = None
    until: Annotated[str | None, _text("--until", "WHEN", "Begun before then; a date's day is included.")] = None
    ended: Annotated[
        str | None, _text("--ended", "HOW", "That ended so: done, stopped, failed, killed, running, unreadable.")
    ] = None
    longer: Annotated[str | None, _text("--longer", "T", "That lasted at least so long: 90, 10m, 1:30:00.")] = None
    larger: Annotated[str | None, _text("--larger", "SIZE", "At least so large: 500kB, 20MB, 1GB.")] = None
    broken: Annotated[bool, typer.Option("--broken", help="Only those with something wrong.")] = False
    sort: Annotated[Sorting, typer.Option("--sort", help="By what the list is ordered.")] = Sorting.time
    reverse: Annotated[bool, typer.Option("--reverse", help="The other way round.")] = False

    def chosen(self, sessions: Iterable[Listed], now: datetime) -> list[Listed]:
        """Those that are meant, in order. Raises UsageError for what cannot be understood."""
        tests = self._tests(now)
        return sorted(
            (one for one in sessions if all(test(one) for test in tests)), key=_KEYS[self.sort], reverse=self.reverse
        )

    def _tests(self, now: datetime) -> list[Callable[[Listed], bool]]:
        tests: list[Callable[[Listed], bool]] = []
        if (vehicle := self.vehicle) is not None:
            tests.append(lambda one: any(fnmatchcase(name, vehicle) for name in one.vehicles))
        if (site := self.site) is not None:
            tests.append(lambda one: site.casefold() in one.site.casefold())
        if self.since is not None:
            since = read_when(self.since, now, "--since")[0]
            tests.append(lambda one: one.started_at >= since)
        if self.until is not None:
            until = read_when(self.until, now, "--until")[1]
            tests.append(lambda one: one.started_at < until)
        if (ended := self.ended) is not None:
            tests.append(lambda one: one.ended.casefold().startswith(ended.casefold()))
        if self.longer is not None:
            longer = read_length(self.longer, "--longer")
            tests.append(lambda one: (one.length_s or 0.0) >= longer)
        if self.larger is not None:
            larger = _read_size(self.larger)
            tests.append(lambda one: one.size_bytes >= larger)
        if self.broken:
            tests.append(lambda one: bool(one.faults))
        return tests


def read_when(text: str, now: datetime, option: str) -> tuple[int, int]:
    """From when to when (ns since 1970 UTC) a date goes: a day, a month, a minute; an age is an instant. Raises UsageError."""
    today = now.replace(hour=0, minute=0, second=0, microsecond=0)
    if text in ("today", "yesterday"):
        begin = today - timedelta(days=text == "yesterday")
        return _ns(begin), _ns(begin + timedelta(days=1))
    if re.fullmatch(r"[\d.]+[a-z]+", text):
        instant = _ns(now) - round(read_length(text, option) * 1e9)
        return instant, instant
    match = _DATE.fullmatch(text)
    try:
        if match is None:
            raise ValueError
        year, month, day, hour, minute, second = (None if one is None else int(one) for one in match.groups())
        begin = datetime(year or 0, month or 0, day or 1, hour or 0, minute or 0, second or 0, tzinfo=UTC)
    except ValueError as error:
        raise UsageError(
            f"{option} {text!r} is no date: write 2026-03-01, 2026-03-01T12:00, today, yesterday, or 7d for so long ago."
        ) from error
    if day is None:
        return _ns(begin), _ns((begin + timedelta(days=31)).replace(day=1))
    lasts = timedelta(days=1) if hour is None else timedelta(minutes=1) if second is None else timedelta(seconds=1)
    return _ns(begin), _ns(begin + lasts)


def read_length(text: str, option: str) -> float:
    """Seconds: 90, 1:30, 1:02:03, 10m, 2h, 7d. Raises UsageError."""
    match = re.fullmatch(r"([\d.]+)([a-z]*)", text)
    try:
        if match is not None:
            length = float(match[1]) * _LENGTHS_S[match[2] or "s"]
        else:
            parts = [float(part) for part in text.split(":")]
            length = sum(part * 60.0**power for power, part in enumerate(reversed(parts)))
        if not (math.isfinite(length) and length >= 0.0 and text.count(":") <= 2):
            raise ValueError
    except (ValueError, KeyError) as error:
        raise UsageError(f"{option} {text!r} is no length of time: write 90, 1:30, 10m, 2h or 30d.") from error
    return length


def _read_size(text: str) -> float:
    match = re.fullmatch(r"([\d.]+) ?(|kB|MB|GB|TB)", text)
    try:
        if match is None:
            raise ValueError
        return float(match[1]) * _SIZES[match[2]]
    except ValueError as error:
        raise UsageError(f"--larger {text!r} is no size: write 500kB, 20MB or 1GB.") from error


def _ns(moment: datetime) -> int:
    return round(moment.timestamp() * 1e9)
