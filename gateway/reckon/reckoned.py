"""Where dead reckoning has a vehicle at an instant: a tip, carried on or back."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.inertial import displaced
from gateway.reckon.cells import CELL_NS, SECOND
from gateway.reckon.judging import TRUSTED_AFTER
from gateway.reckon.proving import is_proved
from gateway.reckon.tip import Tip
from gateway.reckon.walking import WANDERS_M

Floats = NDArray[np.float64]

JERKED_MPS2 = 3.0  # by a second later the acceleration may be another by this
WIND_KNOWN_MPS = 3.0  # a wind that is less sure than this is not told
WORDS = (
    "believed",
    "refused: they jumped",
    "refused: they walk off",
    "refused: they leave their velocity",
    "refused: their velocity jumped",
    "believed, without their velocity",
)


@dataclass(frozen=True, slots=True, eq=False)
class Reckoned:
    """Where dead reckoning has a vehicle at an instant. Vectors north, east, down; the wind is where the air moves to."""

    aircraft: str
    at: int
    latitude_rad: float
    longitude_rad: float
    height_m: float
    velocity_mps: Floats  # (3,)
    sigma_m: Floats  # (3,) with what good position sources wander by, which it has followed
    velocity_sigma_mps: Floats  # (3,)
    wind_mps: Floats  # (2,) NaN = not known
    scatter_m: float  # of its position source, level, an axis
    denied: int  # what is refused of its positions, and why: `tip.NOTHING`, JUMPED, …
    heard_at: int  # when a position was worked in last
    told_from_mps: float  # the slowest walk with velocities to match that it denies; NaN = not known
    trusted: bool  # it has learnt its own errors
    ahead_s: float  # since what vehicles told last

    @property
    def level_sigma_m(self) -> float:
        """An axis."""
        return math.sqrt(0.5 * float(self.sigma_m[0] ** 2 + self.sigma_m[1] ** 2))

    def shown(self) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[str, str], ...]]:
        """What people are shown of it: readings with their units, and words."""
        readings = [("dead reckoning sigma, m", self.level_sigma_m)]
        if not math.isnan(self.wind_mps[0]):
            north, east = self.wind_mps.tolist()
            readings.append(("wind found, m/s", math.hypot(north, east)))
            readings.append(("wind found from, degrees", math.degrees(math.atan2(-east, -north)) % 360.0))
        if not math.isnan(self.told_from_mps):
            readings.append(("tells walks from, m/s", self.told_from_mps))
        return tuple(readings), (("positions", WORDS[self.denied]),)


def reckoned(aircraft: str, tip: Tip, at: int, denied: int) -> Reckoned:
    """A tip carried on, or back, to an instant; `denied`: why the vehicle's positions are refused by now."""
    ahead_ns = at - int(tip.cell[0]) * CELL_NS
    ahead_s = ahead_ns / SECOND
    motion, accelerated = tip.state.motion, tip.accelerated_mps2[0]
    velocity = motion.velocity_mps[0, 0] + accelerated * ahead_s
    metres = (motion.velocity_mps[0, 0] + 0.5 * accelerated * ahead_s) * ahead_s
    latitude, longitude, height = displaced(
        motion.latitude_rad[0, 0], motion.longitude_rad[0, 0], motion.height_m[0, 0], metres
    )
    variance = np.diagonal(tip.state.covariance[0, 0])
    jerked = JERKED_MPS2 * ahead_s
    return Reckoned(
        aircraft,
        at,
        float(latitude),
        float(longitude),
        float(height),
        velocity,
        np.sqrt(variance[:3] + WANDERS_M**2 + variance[3:6] * ahead_s**2 + (0.5 * jerked * ahead_s) ** 2),
        np.sqrt(variance[3:6] + jerked**2),
        wind_mps(tip),
        math.sqrt(float(tip.scatter_m2[0])),
        denied,
        int(tip.heard[0]) * CELL_NS,
        told_from_mps(tip),
        bool(tip.cell[0] - tip.began[0] >= TRUSTED_AFTER),
        ahead_s,
    )


def wind_mps(tip: Tip) -> Floats:
    """The wind that a vehicle has found, north and east (2,), where the air moves to; NaN = not known."""
    is_known = tip.state.covariance[0, 0, dr.WIND, dr.WIND].max() < WIND_KNOWN_MPS**2
    return tip.state.wind_mps[0, 0] if is_known else np.full(2, math.nan)


def told_from_mps(tip: Tip) -> float:
    """The slowest walk with velocities to match that is denied, once the vehicle has proved how sure it is; NaN = not known."""
    return float(tip.told_from_mps[0]) if is_proved(tip)[0] else math.nan
