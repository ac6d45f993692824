"""Published procedures and runways as arrivals are compared with them: level about the airport, heights above it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapters.reasons import reason_of
from gateway.offline.procedures import Procedure
from gateway.runtime.arrivals import onto_level
from gateway.settings.procedures import Published, parse_procedures
from gateway.settings.reading import SiteError

Floats = NDArray[np.float64]


def read_published(path: Path) -> Published:
    """What a file publishes. Raises SiteError: one plain sentence."""
    try:
        return parse_procedures(path.read_text(encoding="utf-8"), str(path))
    except FileNotFoundError as error:
        raise SiteError(f"There is no file {path}; docs/commands.md shows how procedures are written.") from error
    except (OSError, UnicodeDecodeError) as error:
        raise SiteError(f"{path} cannot be read: {reason_of(error)}.") from error


def procedures_about(
    published: Published, airport_deg: tuple[float, float], runway: str | None
) -> tuple[Procedure, ...]:
    """The procedures, those that lead to another runway left out."""
    onto, ground_m = onto_level(airport_deg), published.airport_altitude_m or 0.0
    made = []
    for one in published.procedures:
        if runway is not None and one.runway not in (None, runway):
            continue
        east, north = onto([point.longitude_deg for point in one.points], [point.latitude_deg for point in one.points])
        least, most = (
            np.array([math.nan if bound is None else bound - ground_m for bound in bounds])
            for bounds in zip(*((point.least_altitude_m, point.most_altitude_m) for point in one.points), strict=True)
        )
        names = tuple(point.name for point in one.points)
        made.append(Procedure(one.name, names, np.stack([east, north], axis=-1), least, most))
    return tuple(made)


def thresholds_about(published: Published, airport_deg: tuple[float, float]) -> tuple[Floats, Floats]:
    """The runways' thresholds (r, 2) m, and the true directions of landing (r,) rad."""
    onto = onto_level(airport_deg)
    places = [onto(runway.longitude_deg, runway.latitude_deg) for runway in published.runways]
    return np.array(places).reshape(-1, 2), np.array([runway.direction_rad for runway in published.runways])
