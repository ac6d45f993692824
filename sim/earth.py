"""Paths laid on the ellipsoid: true position, velocity, attitude and motion mode of aircraft at any times."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyproj import Geod

from gateway.geodesy import STANDARD_GRAVITY_MPS2, meridian_radius_m, prime_vertical_radius_m, wrap_rad
from gateway.settings import Runway
from sim.paths import Path

Floats = NDArray[np.float64]

TURNING_RADPS = math.radians(0.25)  # slower than this is called straight
_WGS84 = Geod(ellps="WGS84")


@dataclass(frozen=True, slots=True)
class Flown:
    """The truth about an aircraft at times (...): geodetic position, velocity there (..., 3), attitude.

    Roll is positive with the right wing down, pitch with the nose up, yaw clockwise from true north; on paths there is
    no wind, so that yaw is the course and airspeed the speed. `turn_radps`, of the course, is positive to the right.
    """

    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats  # above the ellipsoid
    velocity_mps: Floats  # (..., 3) east, north, up
    roll_rad: Floats
    pitch_rad: Floats
    yaw_rad: Floats
    turn_radps: Floats
    airspeed_mps: Floats

    @property
    def mode(self) -> NDArray[np.str_]:
        """The motion mode (...): "straight", "left" or "right" as an observer from above would call it."""
        turning = np.where(self.turn_radps > 0.0, "right", "left")
        return np.where(np.abs(self.turn_radps) < TURNING_RADPS, "straight", turning)


def fly(path: Path, runway: Runway, time_s: ArrayLike) -> Flown:
    """Lay a path on the ellipsoid at times (...), seconds of the scene.

    Positions are ends of geodesics from the runway's centre. Velocities are their exact derivatives, but for
    the length of the geodesic's sideways arc, taken on the sphere of the Gaussian radius: below 1e-6 of the
    speed at 100 km. Source: 003, the case.
    """
    motion = path.motion(time_s)
    x, y, above = (motion.position[..., axis] for axis in range(3))
    vx, vy, climb = (motion.velocity[..., axis] for axis in range(3))
    ground_m, bearing_left = np.hypot(x, y), np.arctan2(y, x)
    compass = runway.landing_compass_rad - bearing_left
    latitude, longitude, outward = _geodesic_end(runway, compass, ground_m)
    height = runway.height_m + above
    meridian, vertical = meridian_radius_m(latitude), prime_vertical_radius_m(latitude)
    radius = np.sqrt(meridian * vertical)
    outwards_mps = vx * np.cos(bearing_left) + vy * np.sin(bearing_left)
    narrowing = np.sinc(ground_m / radius / math.pi)  # geodesics from one point spread less than rays of a plane
    leftwards_mps = (vy * np.cos(bearing_left) - vx * np.sin(bearing_left)) * narrowing
    north = outwards_mps * np.cos(outward) + leftwards_mps * np.sin(outward)
    east = outwards_mps * np.sin(outward) - leftwards_mps * np.cos(outward)
    # ground distance counts on the ellipsoid; higher up, the same turn about the Earth's centre is longer
    velocity = np.stack([east * (1.0 + height / vertical), north * (1.0 + height / meridian), climb], axis=-1)
    speed = np.hypot(vx, vy)
    moves = speed > 0.0
    turn_left = vx * motion.acceleration[..., 1] - vy * motion.acceleration[..., 0]
    turn = -np.divide(turn_left, speed * speed, out=np.zeros_like(speed), where=moves)
    return Flown(
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=height,
        velocity_mps=velocity,
        roll_rad=np.arctan(speed * turn / STANDARD_GRAVITY_MPS2),
        pitch_rad=np.arctan2(climb, speed),
        yaw_rad=np.where(moves, np.arctan2(east, north), runway.landing_compass_rad) % (2.0 * math.pi),
        turn_radps=turn,
        airspeed_mps=np.linalg.norm(velocity, axis=-1),
    )


def plan_of(runway: Runway, latitude_rad: float, longitude_rad: float) -> tuple[float, float]:
    """Where a place lies on the runway's ground plan, m: along the landing direction, and left of it."""
    centre = math.degrees(runway.longitude_rad), math.degrees(runway.latitude_rad)
    compass_deg, _, ground_m = _WGS84.inv(*centre, math.degrees(longitude_rad), math.degrees(latitude_rad))
    left_rad = runway.landing_compass_rad - math.radians(compass_deg)
    return ground_m * math.cos(left_rad), ground_m * math.sin(left_rad)


def _geodesic_end(runway: Runway, compass_rad: Floats, ground_m: Floats) -> tuple[Floats, Floats, Floats]:
    """Latitude, longitude and outward direction at the ends of geodesics from the runway's centre, rad."""
    shape = ground_m.shape
    distance, bearing = ground_m.ravel(), np.degrees(compass_rad).ravel()
    longitude = np.full(distance.shape, math.degrees(runway.longitude_rad))
    latitude = np.full(distance.shape, math.degrees(runway.latitude_rad))
    ends: tuple[Floats, Floats, Floats] = _WGS84.fwd(longitude, latitude, bearing, distance)
    end_longitude, end_latitude, back = (np.radians(end).reshape(shape) for end in ends)
    return end_latitude, end_longitude, back + math.pi


class Placed(Protocol):
    """What has geodetic positions (...)."""

    @property
    def latitude_rad(self) -> Floats:
        """Geodetic."""

    @property
    def longitude_rad(self) -> Floats:
        """East."""

    @property
    def height_m(self) -> Floats:
        """Above the ellipsoid."""


def offset_geodetic(
    placed: Placed, east_m: ArrayLike, north_m: ArrayLike, up_m: ArrayLike
) -> tuple[Floats, Floats, Floats]:
    """Latitude, longitude (rad) and height (m) of points beside these.

    Offsets in metres east, north, up there, along the curvatures at the point: within 1 mm for 100 m.
    """
    latitude, height = placed.latitude_rad, placed.height_m
    east, north = np.asarray(east_m, dtype=np.float64), np.asarray(north_m, dtype=np.float64)
    northward = north / (meridian_radius_m(latitude) + height)
    eastward = east / ((prime_vertical_radius_m(latitude) + height) * np.cos(latitude))
    longitude = wrap_rad(placed.longitude_rad + eastward)
    return latitude + northward, longitude, height + np.asarray(up_m, dtype=np.float64)
