"""What a session learnt of its site's radars, as session.json has it, and whether it is of the same place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from gateway.register import Remembered, RememberedRadar
from gateway.settings import Site

_SAME_PLACE_RAD = 2e-6  # ten metres
_SAME_DIRECTION_RAD = math.radians(0.01)


def is_of(remembered: Remembered, site: Site) -> bool:
    """Whether it was learnt at this site's runway."""
    runway = site.runway
    off = (
        abs(remembered.latitude_rad - runway.latitude_rad),
        abs(math.remainder(remembered.longitude_rad - runway.longitude_rad, 2.0 * math.pi)),
    )
    turned = math.remainder(remembered.landing_compass_rad - runway.landing_compass_rad, 2.0 * math.pi)
    return max(off) <= _SAME_PLACE_RAD and abs(turned) <= _SAME_DIRECTION_RAD


def read_remembered(stored: Mapping[str, Any] | None) -> Remembered | None:
    """What stands in session.json. Raises KeyError, TypeError, ValueError for what cannot be so."""
    if stored is None:
        return None
    rows = tuple(
        RememberedRadar(**{**row, "error": tuple(row["error"]), "sigma": tuple(row["sigma"])})
        for row in stored["radars"]
    )
    for row in rows:
        pairs = list(zip(row.error, row.sigma, strict=True))
        if len(pairs) != 4 or any((error is None) != (sigma is None) for error, sigma in pairs):
            raise ValueError(f"what is remembered of radar {row.number} cannot be so")
        if any(sigma is not None and not sigma > 0.0 for sigma in row.sigma):
            raise ValueError(f"what is remembered of radar {row.number} cannot be so sure")
    return Remembered(**{**stored, "radars": rows})
