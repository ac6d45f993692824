"""A case to plan: where from, by which points and where to, threats and areas, on a plane about an origin on the earth.

Places are metres east and north of the origin; heights are above home, where the vehicle sets out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyproj import Proj

from gateway.settings import DEMO_SITE, Runway
from sim.planning.areas import Area
from sim.planning.scenes import GOAL_M, SIDE_M, START_M, draw_threats
from sim.planning.task import PlanError, box_about

Floats = NDArray[np.float64]
End = Floats | Literal["runway"]

DEMO_ORIGIN_DEG = (
    math.degrees(DEMO_SITE.runway.latitude_rad),
    math.degrees(DEMO_SITE.runway.longitude_rad),
)  # where (0, 0) is when nobody says


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane that touches the earth at an origin: directions and distances from there are true (azimuthal equidistant)."""

    latitude_deg: float
    longitude_deg: float

    def place_m(self, place_deg: ArrayLike) -> Floats:
        """Metres east and north (..., 2) of latitudes and longitudes in degrees (..., 2)."""
        place = np.asarray(place_deg, dtype=np.float64)
        return np.stack(self._map()(place[..., 1], place[..., 0]), axis=-1)

    def place_deg(self, place_m: ArrayLike) -> Floats:
        """Latitudes and longitudes in degrees (..., 2) of metres east and north (..., 2)."""
        place = np.asarray(place_m, dtype=np.float64)
        return np.stack(self._map()(place[..., 0], place[..., 1], inverse=True)[::-1], axis=-1)

    def _map(self) -> Proj:
        return Proj(proj="aeqd", lat_0=self.latitude_deg, lon_0=self.longitude_deg, datum="WGS84")


@dataclass(frozen=True, slots=True)
class Case:
    """What a file or a seed says. `threat_height_m` (n,): NaN where a threat's distance counts on the level.

    `box_m` (2, 2): the low and the high corner of where the route stays. `altitude_msl_m`: of home.
    """

    name: str
    plane: Plane
    start: End
    goal: End
    threat_m: Floats
    threat_height_m: Floats
    areas: tuple[Area, ...] = ()
    via_m: tuple[Floats, ...] = ()
    box_m: Floats | None = None
    altitude_msl_m: float = 0.0
    is_placed: bool = False  # whether it says where on the earth it is

    def box(self, *ends_m: Floats) -> Floats:
        """Where the route stays: as said, else about everything that is there."""
        if self.box_m is not None:
            if (np.stack(ends_m) < self.box_m[0]).any() or (np.stack(ends_m) > self.box_m[1]).any():
                raise PlanError("A point of the route is outside of the bounds; widen them.")
            return self.box_m
        outlines = [area.outline() for area in self.areas]
        return box_about(np.stack([*ends_m, *self.via_m]), self.threat_m, *outlines)

    def with_end(self, end: str, place_deg: tuple[float, float] | None) -> Case:
        """The same case with another "start" or "goal": latitude and longitude in degrees, None for the runway."""
        place: End = "runway" if place_deg is None else self.plane.place_m(place_deg)
        changed = replace(self, start=place) if end == "start" else replace(self, goal=place)
        return replace(changed, is_placed=self.is_placed or place_deg is not None)

    def moved_to(self, runway: Runway) -> Case:
        """The same case with its goal on the runway: its plane touches the earth there, threats lie about it as before.

        For cases that do not say where on the earth they are.
        """
        if isinstance(self.goal, str):
            return self
        by = -self.goal
        return replace(
            self,
            plane=Plane(math.degrees(runway.latitude_rad), math.degrees(runway.longitude_rad)),
            start=self.start if isinstance(self.start, str) else self.start + by,
            goal="runway",
            threat_m=self.threat_m + by,
            areas=tuple(replace(area, corners_m=area.corners_m + by) for area in self.areas),
            via_m=tuple(one + by for one in self.via_m),
            box_m=None,
        )


def drawn_case(seed: int) -> Case:
    """The paper's case with the threats of a seed."""
    threats = draw_threats(seed)
    return Case(
        name=f"seed {seed}",
        plane=Plane(*DEMO_ORIGIN_DEG),
        start=START_M,
        goal=GOAL_M,
        threat_m=threats,
        threat_height_m=np.full(len(threats), np.nan),
        box_m=np.array([[0.0, 0.0], [SIDE_M, SIDE_M]]),
    )
