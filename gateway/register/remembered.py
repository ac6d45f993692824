"""What was learnt of a site's radars, to be kept, and taken up when the program is started again: the older, the less sure."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.settings import RadarSite

Floats = NDArray[np.float64]

DAY_S = 86_400.0
# By how much a radar's errors may wander in a day that nobody watched, 1 sigma; in four days twice that.
WANDER = np.array([5.0, math.radians(0.02), math.radians(0.02), 0.01])
_SAME_PLACE_M, _SAME_DIRECTION_RAD = 1.0, math.radians(0.01)


@dataclass(frozen=True, slots=True)
class RememberedRadar:
    """One radar where it stood: by how much it measures too much (range m, azimuth rad, elevation rad, time s), and sigmas.

    None = not known.
    """

    number: int
    along_m: float
    left_m: float
    antenna_height_m: float
    compass_boresight_rad: float
    error: tuple[float | None, ...]
    sigma: tuple[float | None, ...]

    def is_at(self, radar: RadarSite) -> bool:
        """Whether a radar stands and looks as this one did."""
        off_m = math.dist(
            (self.along_m, self.left_m, self.antenna_height_m), (radar.along_m, radar.left_m, radar.antenna_height_m)
        )
        turned = math.remainder(self.compass_boresight_rad - radar.compass_boresight_rad, 2.0 * math.pi)
        return off_m <= _SAME_PLACE_M and abs(turned) <= _SAME_DIRECTION_RAD


@dataclass(frozen=True, slots=True)
class Remembered:
    """What was known of a site's radars at an instant, ns since 1970 UTC, and where the runway is."""

    at: int
    latitude_rad: float
    longitude_rad: float
    landing_compass_rad: float
    radars: tuple[RememberedRadar, ...]

    def age_s(self, now: int) -> float:
        """How long ago that was; never negative."""
        return max(now - self.at, 0) / SECOND

    def knows(self, number: int) -> bool:
        """Whether there was a radar of this number."""
        return any(one.number == number for one in self.radars)

    def of(self, radar: RadarSite, age_s: float) -> tuple[Floats, Floats] | None:
        """Errors (4,) of a radar that stands where it stood, and their sigmas after so long; NaN = not known."""
        known = next((one for one in self.radars if one.number == radar.number and one.is_at(radar)), None)
        if known is None:
            return None
        error, sigma = (
            np.array([math.nan if part is None else part for part in values]) for values in (known.error, known.sigma)
        )
        return error, np.hypot(sigma, WANDER * math.sqrt(age_s / DAY_S))


def in_words(age_s: float) -> str:
    """An age, for people."""
    for least, unit_s, unit in ((2 * DAY_S, DAY_S, "days"), (7200.0, 3600.0, "hours"), (120.0, 60.0, "minutes")):
        if age_s >= least:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{age_s:.0f} s"
