"""A scene: a site, aircraft on their paths, the sensors that see them, and how all of it is said on the wires."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.settings import PositionSource, RadarSite, Site
from sim.earth import Flown, fly
from sim.faults import Fault
from sim.faulty_sensors import clock_error_s
from sim.flown_way import Craft, FlownWay
from sim.paths import Path
from sim.sensors import GpsParameters, ImuParameters, RadarParameters

Floats = NDArray[np.float64]

STAMP_STEP_NS = 4_000  # stamps are multiples of 4 us, so that the low two bits of a tlog's microseconds are 0
LEAST_STATED = 0.1  # m, m/s: what is simulated without noise still has to be weighed
LARGEST_SYSTEM = 250  # system ids above belong to ground stations


@dataclass(frozen=True, slots=True)
class SayParameters:
    """How often an aircraft says what on its MAVLink link, apart from its positions."""

    heartbeat_period_s: float = 1.0
    clock_period_s: float = 1.0  # SYSTEM_TIME
    attitude_period_s: float = 0.25
    truth_period_s: float = 0.25  # SIM_STATE; 0 = never
    latency_s: float = 0.0  # of all of these
    booted_before_s: float = 30.0  # how long before it appears its autopilot was switched on


@dataclass(frozen=True, slots=True)
class Aircraft:
    """One aircraft: its MAVLink system number, the way it flies, and a word for people on what it is doing."""

    system: int
    path: Path | FlownWay
    kind: str = "approach"
    craft: Craft = "aeroplane"
    gps: GpsParameters | None = None  # its own position source; None: as the scene's

    @property
    def name(self) -> str:
        """As the gateway calls it."""
        return f"mavlink:{self.system}"


@dataclass(frozen=True, slots=True)
class SceneRadar:
    """One radar: where it stands, how it measures, and the key that it signs with, if it has one."""

    site: RadarSite
    parameters: RadarParameters
    key: bytes | None = None

    @property
    def name(self) -> str:
        """As the link is called."""
        return f"radar:{self.site.number}"


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything that decides a simulated world: the same scene gives the same bytes.

    `start_ns` is the session's beginning, ns since 1970 UTC, second 0 of the scene.
    """

    name: str
    site: Site
    seed: int
    start_ns: int
    duration_s: float
    aircraft: tuple[Aircraft, ...]
    gps: GpsParameters
    radars: tuple[SceneRadar, ...]
    say: SayParameters = SayParameters()
    imu: ImuParameters = ImuParameters()
    faults: tuple[Fault, ...] = ()

    @property
    def stated_site(self) -> Site:
        """The site as somebody states it who knows what its position sources are worth, unless it states that itself."""
        if self.site.position != PositionSource():
            return self.site
        gps = self.gps
        worth = replace(
            self.site.position,
            sigma_m=max(gps.sigma_m, LEAST_STATED),
            velocity_sigma_mps=max(gps.velocity_sigma_mps, LEAST_STATED),
        )
        return replace(self.site, position=worth)

    def present(self, aircraft: Aircraft) -> tuple[float, float]:
        """From when until before when an aircraft is in the scene, s; the same twice if never."""
        way = aircraft.path
        start = max(way.start_s, 0.0)
        end = way.end_before(self.duration_s) if isinstance(way, FlownWay) else min(way.end_s, self.duration_s)
        return start, max(end, start)

    def flown(self, aircraft: Aircraft, time_s: ArrayLike) -> Flown:
        """The truth about an aircraft at times (...), which must be within its presence."""
        way = aircraft.path
        return way.flown(time_s) if isinstance(way, FlownWay) else fly(way, self.site.runway, time_s)

    def at_ns(self, time_s: float) -> int:
        """A time of the scene as ns since 1970 UTC."""
        return self.start_ns + round(time_s * 1e9)

    def told_ns(self, link: str, time_s: float) -> int:
        """The same by the clock behind a link, which may have jumped."""
        return self.at_ns(time_s + float(clock_error_s(self.faults, link, time_s)))

    def faults_of(self, link: str) -> tuple[Fault, ...]:
        """What befalls who speaks on a link."""
        return tuple(fault for fault in self.faults if fault.befalls(link))

    @property
    def links(self) -> tuple[str, ...]:
        """Every link of the scene: one for each aircraft, one for each radar."""
        return (*(one.name for one in self.aircraft), *(radar.name for radar in self.radars))

    @property
    def geoid_separation_m(self) -> float:
        """Height of the geoid above the ellipsoid that this world's altitudes are counted with."""
        return self.site.runway.geoid_separation_m or 0.0


@dataclass(frozen=True, slots=True)
class Sent:
    """One arrival at the gateway: when (ns since 1970 UTC), on which link of the scene, and the bytes."""

    at: int
    link: str
    data: bytes
