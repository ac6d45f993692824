"""Fields of told lines: of JSON that anybody may have written nothing is believed before it was looked at."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

HIGHEST_M = 100_000.0
"""No altitude is farther from the sea's level."""


def json_object(line: bytes, longest: int) -> dict[str, Any] | None:
    """The JSON object that a line of at most so many bytes is; None for anything else. Never raises."""
    if len(line) > longest:
        return None
    try:
        told = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def number(told: object, most: float) -> float | None:
    """A finite number within plus and minus `most`; None for anything else."""
    if isinstance(told, bool) or not isinstance(told, int | float):
        return None
    return float(told) if abs(told) <= most else None


def place_rad(told: Mapping[str, Any]) -> tuple[float, float] | None:
    """The latitude and longitude of `latitude_deg` and `longitude_deg`; None where one is missing, or none."""
    latitude, longitude = number(told.get("latitude_deg"), 90.0), number(told.get("longitude_deg"), 180.0)
    return None if latitude is None or longitude is None else (math.radians(latitude), math.radians(longitude))
