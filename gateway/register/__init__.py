"""Register: the systematic errors of radars, which the next align takes off.

What the site file says of them is taken off; while a session runs nothing is learnt yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Correction
from gateway.register.registered import EACH, Registered, Residuals
from gateway.settings import RadarSite

Floats = NDArray[np.float64]

__all__ = ["Registered", "Registration", "Residuals"]


@dataclass(frozen=True, slots=True)
class Registration:
    """What is known of the radars' errors; used by the next align."""

    def of(self, radar: RadarSite) -> Correction:
        """What is taken off this radar's measurements."""
        return radar.range_error_m, radar.azimuth_error_rad, radar.elevation_error_rad, radar.time_error_s

    def table(self, radars: Mapping[int, RadarSite]) -> Registered:
        """What is taken off, as columns."""
        numbers = tuple(sorted(radars))
        correction: Floats = np.array([self.of(radars[number]) for number in numbers]).reshape(-1, EACH)
        return Registered.untold(numbers, correction)
