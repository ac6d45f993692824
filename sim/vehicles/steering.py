"""Where a vehicle is on its way, and which way to turn: over a plane about home, north and east in metres.

`follow` is the L1 law (Park, Deyst, How): the lateral acceleration that brings the velocity onto a point a fixed time ahead
on the leg. It works with the velocity over the ground, so that wind leaves no offset. `circle` follows a field of courses that
wind into the circle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from gateway.geodesy import meridian_radius_m, prime_vertical_radius_m
from sim.vehicles.body import Body, wrapped
from sim.vehicles.motion import Home

_DAMPING = 0.75
_STEEPEST = math.sin(math.radians(45.0))  # at which a leg is approached from afar


class Spot(NamedTuple):
    """A place on the plane, m, and its height above the ellipsoid."""

    north_m: float
    east_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Plane:
    """Lengths of arc north and east of home."""

    latitude_rad: float
    longitude_rad: float
    north_m: float  # of one radian of latitude
    east_m: float  # of one radian of longitude

    @classmethod
    def about(cls, home: Home) -> Plane:
        """The plane of one home."""
        latitude = home.latitude_rad
        parallel = float(prime_vertical_radius_m(latitude)) + home.height_m
        meridian = float(meridian_radius_m(latitude)) + home.height_m
        return cls(latitude, home.longitude_rad, meridian, parallel * math.cos(latitude))

    def spot(self, latitude_rad: float, longitude_rad: float, height_m: float) -> Spot:
        """A geodetic place."""
        further = wrapped(longitude_rad - self.longitude_rad)
        return Spot((latitude_rad - self.latitude_rad) * self.north_m, further * self.east_m, height_m)

    def beside(self, home: Home, right_m: float) -> Home:
        """Another home, so far to the right of one that is on this plane."""
        north, east = -right_m * math.sin(home.heading_rad), right_m * math.cos(home.heading_rad)
        latitude, longitude = home.latitude_rad + north / self.north_m, home.longitude_rad + east / self.east_m
        return replace(home, latitude_rad=latitude, longitude_rad=longitude)

    def of(self, body: Body) -> Spot:
        """Where a body is."""
        return self.spot(body.latitude_rad, body.longitude_rad, body.height_m)


class Leg(NamedTuple):
    """From one place to another."""

    start: Spot
    end: Spot

    @property
    def length_m(self) -> float:
        """Level."""
        return math.hypot(self.end.north_m - self.start.north_m, self.end.east_m - self.start.east_m)


class OnLeg(NamedTuple):
    """How far along a leg, how far to its right, and its course."""

    along_m: float
    right_m: float
    course_rad: float


def place_on(leg: Leg, here: Spot) -> OnLeg:
    """Where a vehicle is on a leg; one without length points to its end."""
    north, east = leg.end.north_m - leg.start.north_m, leg.end.east_m - leg.start.east_m
    length = math.hypot(north, east)
    if length < 1.0:
        return OnLeg(0.0, 0.0, math.atan2(leg.end.east_m - here.east_m, leg.end.north_m - here.north_m))
    n, e = here.north_m - leg.start.north_m, here.east_m - leg.start.east_m
    return OnLeg((n * north + e * east) / length, (e * north - n * east) / length, math.atan2(east, north))


def height_on(leg: Leg, on: OnLeg, speed_mps: float) -> tuple[float, float]:
    """Where the leg's straight line is beside a vehicle, and how fast that climbs for one that goes along it, m, m/s."""
    start, end, length = leg.start.height_m, leg.end.height_m, leg.length_m
    if not 0.0 < on.along_m < length:
        return (end if on.along_m > 0.0 or length < 1.0 else start), 0.0
    return start + (end - start) * on.along_m / length, (end - start) / length * speed_mps


def distance_m(here: Spot, there: Spot) -> float:
    """Level."""
    return math.hypot(there.north_m - here.north_m, there.east_m - here.east_m)


def bearing_rad(here: Spot, there: Spot) -> float:
    """From here to there."""
    return math.atan2(there.east_m - here.east_m, there.north_m - here.north_m)


def follow(on_leg: OnLeg, north_mps: float, east_mps: float, period_s: float) -> float:
    """The acceleration to the right that follows a leg, m/s2; `period_s` is how quickly."""
    speed = max(math.hypot(north_mps, east_mps), 1.0)
    ahead_m = _DAMPING * period_s * speed / math.pi
    aside = math.asin(min(max(on_leg.right_m / ahead_m, -_STEEPEST), _STEEPEST))
    off = wrapped(on_leg.course_rad - aside - math.atan2(east_mps, north_mps))
    pull = math.sin(min(max(off, -0.5 * math.pi), 0.5 * math.pi))
    return 4.0 * _DAMPING**2 * speed * speed / ahead_m * pull


def circle(
    here: Spot, centre: Spot, radius_m: float, north_mps: float, east_mps: float, period_s: float
) -> tuple[float, float]:
    """The acceleration to the right that flies a circle (radius positive: to the right), m/s2, and the distance outside it, m."""
    hand = 1.0 if radius_m > 0.0 else -1.0
    out, speed = distance_m(centre, here), max(math.hypot(north_mps, east_mps), 1.0)
    outside = out - abs(radius_m)
    ahead_m = _DAMPING * period_s * speed / math.pi
    wanted = bearing_rad(centre, here) + hand * (0.5 * math.pi + math.atan(2.0 * outside / ahead_m))
    off = wrapped(wanted - math.atan2(east_mps, north_mps))
    return hand * speed * speed / max(out, abs(radius_m)) + 2.0 * speed * speed / ahead_m * math.sin(off / 2.0), outside
