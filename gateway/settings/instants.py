"""Instants as people write them."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np

_WRITTEN = re.compile(r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d)(?:(:\d\d)(\.\d+)?)?(?:Z|([+-])(\d\d):(\d\d))?")


@lru_cache(maxsize=256)
def instant_ns(text: str) -> int | None:
    """A time such as 2026-03-01T12:00:00Z as ns since 1970 UTC; None for what is none. Without a zone it is UTC."""
    found = _WRITTEN.fullmatch(text)
    if found is None:
        return None
    day, clock, second, fraction, side, hours, minutes = found.groups()
    try:
        # whole seconds: ns would not reach beyond the year 2262
        seconds = int(np.datetime64(f"{day}T{clock}{second or ''}", "s").astype(np.int64))
    except ValueError:
        return None
    if side is not None:
        seconds -= (1 if side == "+" else -1) * (int(hours) * 60 + int(minutes)) * 60
    return seconds * 1_000_000_000 + round(float(fraction or 0.0) * 1e9)
