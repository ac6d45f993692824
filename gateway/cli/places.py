"""Places as people write them on the command line."""

from __future__ import annotations

import math

from gateway.cli.failures import UsageError


def read_place_deg(text: str, option: str) -> tuple[float, float]:
    """Latitude and longitude in degrees, written LAT,LON. Raises UsageError, which names the option."""
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        latitude = longitude = math.nan
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise UsageError(f"{option} {text!r} is not understood: write degrees as in 49.01,2.55.")
    return latitude, longitude
