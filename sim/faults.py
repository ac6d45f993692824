"""What goes wrong in a scene, from when until when, and whom it befalls.

A fault names a vehicle or a radar by its number; one that names neither befalls all that it can befall. What each kind
does to a sensor is in `sim.faulty_sensors`, to a link in `sim.faulty_links`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """Something wrong from one second of the scene until another."""

    at_s: float = 0.0
    until_s: float = math.inf
    vehicle: int | None = None  # by its system number
    radar: int | None = None  # by its number

    befalls_links: ClassVar[tuple[str, ...]] = ("mavlink", "radar")

    def lasts(self, time_s: ArrayLike) -> Bools:
        """Whether it is so at times (...), the start included."""
        time = np.asarray(time_s, dtype=np.float64)
        return np.asarray((time >= self.at_s) & (time < self.until_s))

    def befalls(self, link: str) -> bool:
        """Whether it befalls what speaks on a link such as "mavlink:3" or "radar:1"."""
        kind, _, number = link.partition(":")
        named = {"mavlink": self.vehicle, "radar": self.radar}
        all_of_them = self.vehicle is None and self.radar is None
        return kind in self.befalls_links and (all_of_them or named[kind] == int(number))


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsFault(Fault):
    """A fault of a vehicle's position source."""

    befalls_links: ClassVar[tuple[str, ...]] = ("mavlink",)


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsLost(GpsFault):
    """No positions: the receiver tells that it has no fix, or the source is silent."""

    shows: Literal["no fix", "silence"] = "no fix"


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsFrozen(GpsFault):
    """The last position and velocity again and again, with times that go on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsSpoofed(GpsFault):
    """Positions beside the true ones: by a step at once, and walking away; velocities tell of the walk."""

    step_m: float = 0.0
    walks_mps: float = 0.0
    compass_rad: float = 0.0  # where to, step and walk
    step_up_m: float = 0.0
    climbs_mps: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsNoise(GpsFault):
    """The noise an axis is another."""

    sigma_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsVelocity(GpsFault):
    """Velocities are so many times what they are: of another unit, of the wrong sign, or 0; positions are right."""

    times: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarFault(Fault):
    """A fault of a radar."""

    befalls_links: ClassVar[tuple[str, ...]] = ("radar",)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarOff(RadarFault):
    """No scans, no status."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarComponentLost(RadarFault):
    """Components of every plot are not measured; a plot of which none is left is not sent."""

    components: tuple[Literal["range", "azimuth", "elevation"], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarError(RadarFault):
    """It measures too much; azimuths to the left, as a radar counts them."""

    range_error_m: float = 0.0
    azimuth_error_rad: float = 0.0
    elevation_error_rad: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RadarMoved(RadarFault):
    """It stands elsewhere in the runway frame, or is turned, than the site says; its status may tell so, or not."""

    along_m: float = 0.0
    left_m: float = 0.0
    up_m: float = 0.0
    turned_rad: float = 0.0  # clockwise from above
    status: Literal["stale", "new"] = "stale"


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockJump(Fault):
    """A vehicle's UTC, or a radar's stamps, are wrong by so much; a vehicle's time since boot goes on."""

    by_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkCut(Fault):
    """Nothing arrives."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLossy(Fault):
    """A share of what is sent never arrives."""

    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkLate(Fault):
    """What is sent arrives later, by up to `spread_s` more at random: so also out of order."""

    by_s: float = 0.0
    spread_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkDoubled(Fault):
    """A share of what is sent arrives twice, the second time so much later."""

    share: float = 1.0
    after_s: float = 0.05
