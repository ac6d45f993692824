"""Instants as people write them. Nothing in the settings knows a calendar: this one is computed."""

from __future__ import annotations

import re

_DAYS_OF_400_YEARS, _DAYS_TO_1970 = 146_097, 719_468


def instant_ns(text: str) -> int | None:
    """A time such as 2026-03-01T12:00:00Z as ns since 1970 UTC; None for what is none. Without a zone it is UTC."""
    zone = r"(?:Z|([+-])(\d\d):(\d\d))?"
    found = re.fullmatch(rf"(\d{{4}})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(\.\d+)?)?{zone}", text)
    if found is None:
        return None
    year, month, day, hour, minute = (int(part) for part in found.groups()[:5])
    if not (1 <= month <= 12 and 1 <= day <= 31 and hour < 24 and minute < 60):
        return None
    shifted = year - (month <= 2)  # years that begin in March, so that the leap day is the last
    of_year = (153 * ((month - 3) % 12) + 2) // 5 + day - 1
    days = 365 * (shifted % 400) + shifted % 400 // 4 - shifted % 400 // 100 + of_year
    days += shifted // 400 * _DAYS_OF_400_YEARS - _DAYS_TO_1970
    seconds = ((days * 24 + hour) * 60 + minute) * 60 + int(found[6] or 0)
    if found[8]:
        seconds -= (1 if found[8] == "+" else -1) * (int(found[9]) * 60 + int(found[10])) * 60
    return seconds * 1_000_000_000 + round(float(found[7] or 0.0) * 1e9)
