"""The site's frames: geodetic, ECEF, ENU, runway and radar, and the conversions between them, over arrays.

A matrix is named after what it makes of what, `enu_from_ecef`, so that inner names meet in a product. Vectors are turned
component by component, never by a matrix product over many of them: the bits of one do not depend on how many come along.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.geodesy import ecef_to_geodetic, enu_axes, geodetic_to_ecef
from gateway.settings import RadarSite, Runway

Floats = NDArray[np.float64]


def turn(matrix: Floats, vectors: ArrayLike) -> Floats:
    """One matrix (3, 3) applied to vectors (..., 3); the same bits for one and for many.

    A product for each vector, not one product over all of them, whose bits would change with their number.
    """
    given = np.asarray(vectors, dtype=np.float64)
    return np.asarray((matrix @ given[..., None])[..., 0])


def level_axes(compass_rad: float) -> Floats:
    """The matrix from ENU to a level frame whose x points to a compass direction and whose y is to its left.

    Source: 003 2.2 eq 3, with beta = direction - pi/2.
    """
    sine, cosine = math.sin(compass_rad), math.cos(compass_rad)
    return np.array([[sine, cosine, 0.0], [-cosine, sine, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True, eq=False)
class DeckPose:
    """Where a runway that moves, a ship's deck, is at an instant, in the ENU of the place where the site has it written."""

    at: int  # ns since 1970 UTC
    enu_m: Floats  # (3,) its centre
    velocity_mps: Floats  # (3,)
    deck_from_enu: Floats  # (3, 3): x along its landing direction, y left, z its own vertical
    compass_rad: float  # its landing direction, true
    turn_radps: float  # clockwise

    def relative(self, time: ArrayLike, enu_m: ArrayLike) -> Floats:
        """Positions (..., 3) at times (...), ns, in the deck's frame as it is then: it goes on straight and turns steadily."""
        since_s = (np.asarray(time, dtype=np.int64) - self.at) / 1e9
        centre = self.enu_m + since_s[..., None] * self.velocity_mps
        return self._turned(since_s, np.asarray(enu_m, dtype=np.float64) - centre)

    def relative_velocity(self, time: ArrayLike, velocity_mps: ArrayLike) -> Floats:
        """Velocities (..., 3) of the ENU less the deck's own, along its axes as they are at times (...).

        Deviation: what the deck's turning adds far from it is left out: an aircraft's course is judged, not a rotation.
        """
        since_s = (np.asarray(time, dtype=np.int64) - self.at) / 1e9
        return self._turned(since_s, np.asarray(velocity_mps, dtype=np.float64) - self.velocity_mps)

    def _turned(self, since_s: Floats, vectors: Floats) -> Floats:
        x, y, z = np.moveaxis(turn(self.deck_from_enu, vectors), -1, 0)
        sine, cosine = np.sin(self.turn_radps * since_s), np.cos(self.turn_radps * since_s)
        return np.stack([cosine * x - sine * y, sine * x + cosine * y, z], axis=-1)


class RunwayFrame:
    """The frames at the runway's centre: ECEF, ENU and runway (x along the main landing direction, y left, z up).

    Everything is estimated in these, which stand still. Of a runway that moves `deck` says where it is now, once that is known.
    """

    def __init__(self, runway: Runway) -> None:
        self.runway = runway
        self.origin_ecef_m = geodetic_to_ecef(runway.latitude_rad, runway.longitude_rad, runway.height_m)
        self.enu_from_ecef = enu_axes(runway.latitude_rad, runway.longitude_rad)
        self.ecef_from_enu = self.enu_from_ecef.T
        self.runway_from_enu = level_axes(runway.landing_compass_rad)
        self.enu_from_runway = self.runway_from_enu.T
        self.deck: DeckPose | None = None

    def with_deck(self, pose: DeckPose) -> RunwayFrame:
        """The same frames with the runway somewhere else."""
        moved = copy.copy(self)
        moved.deck = pose
        return moved

    def deck_pose(
        self, at: int, enu_m: Floats, velocity_mps: Floats, heading_rad: float, turn_radps: float
    ) -> DeckPose:
        """A deck at a place (3,) of the ENU, at the written height above the ellipsoid, under a ship on this heading.

        The landing direction that is written counts from the ship's bow.
        """
        latitude, longitude, _ = self.geodetic_from_enu(enu_m)
        centre = self.enu_from_geodetic(latitude, longitude, self.runway.height_m)
        compass = heading_rad + self.runway.landing_compass_rad
        axes = level_axes(compass) @ self.local_from_enu(latitude, longitude)
        return DeckPose(at, centre, velocity_mps, axes, compass, turn_radps)

    def relative(self, at: int, enu_m: Floats, velocity_mps: Floats) -> tuple[Floats, Floats]:
        """Positions and velocities (..., 3) of the ENU, from the runway as it is at an instant, along its axes."""
        if self.deck is None:
            return turn(self.runway_from_enu, enu_m), turn(self.runway_from_enu, velocity_mps)
        now = np.full(np.shape(enu_m)[:-1], at, dtype=np.int64)
        return self.deck.relative(now, enu_m), self.deck.relative_velocity(now, velocity_mps)

    def enu_from_geodetic(self, latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike) -> Floats:
        """East, north, up (..., 3) in metres at the runway's centre. Source: 003 2.2 eq 1, 2."""
        return turn(self.enu_from_ecef, geodetic_to_ecef(latitude_rad, longitude_rad, height_m) - self.origin_ecef_m)

    def geodetic_from_enu(self, enu_m: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Latitude, longitude (rad) and height (m), each (...), of ENU positions (..., 3)."""
        return ecef_to_geodetic(turn(self.ecef_from_enu, enu_m) + self.origin_ecef_m)

    def runway_from_geodetic(self, latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike) -> Floats:
        """Runway-frame position (..., 3) in metres. Source: 003 2.2 eq 1 to 3."""
        return turn(self.runway_from_enu, self.enu_from_geodetic(latitude_rad, longitude_rad, height_m))

    def geodetic_from_runway(self, runway_m: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Latitude, longitude (rad) and height (m), each (...), of runway-frame positions (..., 3)."""
        return self.geodetic_from_enu(turn(self.enu_from_runway, runway_m))

    def local_from_enu(self, latitude_rad: ArrayLike, longitude_rad: ArrayLike) -> Floats:
        """Matrices (..., 3, 3) that turn vectors of the runway's ENU into the ENU at other points (...).

        Far from the runway its horizontal is tilted: 0.45 degrees at 50 km.
        """
        latitude, longitude = np.asarray(latitude_rad, dtype=np.float64), np.asarray(longitude_rad, dtype=np.float64)
        sin_lat, cos_lat, sin_lon, cos_lon = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
        zero = np.zeros_like(latitude)
        east = np.stack([-sin_lon, cos_lon, zero], axis=-1)
        north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
        up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
        rows = [turn(self.enu_from_ecef, axis) for axis in (east, north, up)]
        return np.stack(rows, axis=-2)


@dataclass(frozen=True)
class RadarFrame:
    """One radar: origin at the antenna, x along the boresight, y left, z up, parallel to the runway's horizontal.

    Source: 003 2.2 eq 4. Deviation: the printed z_r = z + height is wrong for an antenna above the runway; z_r = z - height.
    """

    antenna_enu_m: Floats  # (3,)
    radar_from_enu: Floats  # (3, 3)

    @classmethod
    def of(cls, radar: RadarSite, frame: RunwayFrame) -> RadarFrame:
        """The frame of a radar that stands at a place of the runway frame."""
        antenna = turn(frame.enu_from_runway, [radar.along_m, radar.left_m, radar.antenna_height_m])
        return cls(antenna, level_axes(radar.compass_boresight_rad))

    @property
    def enu_from_radar(self) -> Floats:
        """The inverse turn (3, 3)."""
        return self.radar_from_enu.T

    def from_enu(self, enu_m: ArrayLike) -> Floats:
        """Radar-frame positions (..., 3) of ENU positions (..., 3), metres."""
        return turn(self.radar_from_enu, np.asarray(enu_m, dtype=np.float64) - self.antenna_enu_m)

    def to_enu(self, radar_m: ArrayLike) -> Floats:
        """ENU positions (..., 3) of radar-frame positions (..., 3), metres."""
        return turn(self.enu_from_radar, radar_m) + self.antenna_enu_m


def polar_from_xyz(radar_m: ArrayLike) -> Floats:
    """Range m, azimuth rad (positive to the left), elevation rad, stacked (..., 3), of radar-frame positions (..., 3).

    Source: 003 2.2 eq 5, with atan2.
    """
    given = np.asarray(radar_m, dtype=np.float64)
    x, y, z = given[..., 0], given[..., 1], given[..., 2]
    level = x * x + y * y
    polar = np.empty(given.shape)
    polar[..., 0], polar[..., 1], polar[..., 2] = (
        np.sqrt(level + z * z),
        np.arctan2(y, x),
        np.arctan2(z, np.sqrt(level)),
    )
    return polar


def xyz_from_polar(polar: ArrayLike) -> Floats:
    """Radar-frame positions (..., 3) of range m, azimuth rad, elevation rad (..., 3)."""
    given = np.asarray(polar, dtype=np.float64)
    distance, azimuth, elevation = given[..., 0], given[..., 1], given[..., 2]
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=-1)


def polar_jacobian(radar_m: ArrayLike) -> Floats:
    """Derivatives (..., 3, 3) of range, azimuth, elevation (rows) by radar-frame x, y, z (columns) at positions (..., 3).

    At the antenna's zenith azimuth has no derivative; the level distance is held above 1 m there.
    """
    given = np.asarray(radar_m, dtype=np.float64)
    x, y, z = given[..., 0], given[..., 1], given[..., 2]
    level_square = np.maximum(x * x + y * y, 1.0)
    square = level_square + z * z
    level = np.sqrt(level_square)
    jacobian = np.zeros((*given.shape, 3))
    jacobian[..., 0, :] = given / np.sqrt(square)[..., None]
    jacobian[..., 1, 0], jacobian[..., 1, 1] = -y / level_square, x / level_square
    steep = -z / (square * level)
    jacobian[..., 2, 0], jacobian[..., 2, 1], jacobian[..., 2, 2] = x * steep, y * steep, level / square
    return jacobian
