"""The three coordinate systems in which a radar and a position source can be compared, with their derivatives.

ecef       both as earth-centred positions                      004 eq 1 to 6
geodetic   the radar carried on to longitude, latitude, height  004 eq 8 to 10
polar      the position source carried to the radar             004 eq 11, 12
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.geodesy import (
    ecef_to_geodetic,
    geodetic_to_ecef,
    meridian_radius_m,
    prime_vertical_radius_m,
    wrap_rad,
)

Floats = NDArray[np.float64]
System = Literal["ecef", "geodetic", "polar"]
SYSTEMS: tuple[System, ...] = ("ecef", "geodetic", "polar")


@dataclass(frozen=True, slots=True)
class Difference:
    """Position source less radar in one system, (..., n, 3), and derivatives (..., n, 3, 3).

    `by_radar`: of the radar's place by range m, azimuth rad, elevation rad; `by_source`: of the source's by longitude rad,
    latitude rad, height m; `by_ecef`: of a place in this system by its earth-centred coordinates.
    """

    off: Floats
    by_radar: Floats
    by_source: Floats
    by_ecef: Floats


def difference(
    system: System, radar: Floats, polar: Floats, geodetic: Floats, level: Floats | None = None
) -> Difference:
    """Radars at `radar` (n, 3) latitude, longitude, height against geodetic (..., n, 3) longitude, latitude, height.

    `level`: (n, 2) latitude and longitude of the place with whose horizon and north they are aligned; None: their own.
    """
    aligned = radar if level is None else level
    turn = _ecef_from_local(aligned[..., 1], aligned[..., 0])
    origin = geodetic_to_ecef(radar[..., 0], radar[..., 1], radar[..., 2])
    local, by_polar = _local(polar)
    seen = origin + (turn @ local[..., None])[..., 0]
    told = geodetic_to_ecef(geodetic[..., 1], geodetic[..., 0], geodetic[..., 2])
    axes = _ecef_from_local(geodetic[..., 0], geodetic[..., 1])
    by_source = axes / per_metre(geodetic, each=True)[..., None, :]
    if system == "ecef":
        unit = np.broadcast_to(np.eye(3), by_source.shape)
        return Difference(told - seen, turn @ by_polar, by_source, unit)
    if system == "geodetic":
        latitude, longitude, height = ecef_to_geodetic(seen)
        carried = np.stack([longitude, latitude, height], axis=-1)
        back = _ecef_from_local(longitude, latitude).swapaxes(-1, -2)
        by_ecef = back * per_metre(carried, each=True)[..., :, None]
        off = geodetic - carried
        off[..., 0] = wrap_rad(off[..., 0])
        return Difference(off, by_ecef @ turn @ by_polar, np.broadcast_to(np.eye(3), by_source.shape), by_ecef)
    carried = (turn.swapaxes(-1, -2) @ (told - origin)[..., None])[..., 0]
    distance = np.sqrt((carried * carried).sum(axis=-1))
    azimuth, elevation = np.arctan2(carried[..., 0], carried[..., 1]), np.arcsin(carried[..., 2] / distance)
    at_radar = np.stack([distance, azimuth, elevation], axis=-1)
    by_local = _polar_by_local(at_radar)
    by_ecef = by_local @ turn.swapaxes(-1, -2)
    off = at_radar - polar
    off[..., 1] = wrap_rad(off[..., 1])
    return Difference(off, np.broadcast_to(np.eye(3), by_source.shape), by_ecef @ by_source, by_ecef)


def per_metre(geodetic: Floats, *, each: bool = False) -> Floats:
    """How much longitude rad, latitude rad, height m a metre to the east, north, up is: (..., 3), at the middle of the places
    (..., n, 3), or with `each` (..., n, 3) at each.
    """
    place = geodetic if each else geodetic.mean(axis=-2)
    latitude, height = place[..., 1], place[..., 2]
    east = 1.0 / np.maximum((prime_vertical_radius_m(latitude) + height) * np.cos(latitude), 1.0)
    return np.stack([east, 1.0 / (meridian_radius_m(latitude) + height), np.ones_like(east)], axis=-1)


def _local(polar: Floats) -> tuple[Floats, Floats]:
    """East, north, up (..., 3) of range, azimuth clockwise from north, elevation; and its derivatives. Source: 004 eq 1."""
    distance = polar[..., 0]
    sin_az, cos_az = np.sin(polar[..., 1]), np.cos(polar[..., 1])
    sin_el, cos_el = np.sin(polar[..., 2]), np.cos(polar[..., 2])
    towards = np.stack([sin_az * cos_el, cos_az * cos_el, sin_el], axis=-1)
    across = distance[..., None] * np.stack([cos_az * cos_el, -sin_az * cos_el, np.zeros_like(sin_el)], axis=-1)
    upward = distance[..., None] * np.stack([-sin_az * sin_el, -cos_az * sin_el, cos_el], axis=-1)
    return distance[..., None] * towards, np.stack([towards, across, upward], axis=-1)


def _polar_by_local(polar: Floats) -> Floats:
    """Derivatives of range, azimuth, elevation by east, north, up."""
    distance = np.maximum(polar[..., 0], 1.0)
    sin_az, cos_az = np.sin(polar[..., 1]), np.cos(polar[..., 1])
    sin_el, cos_el = np.sin(polar[..., 2]), np.cos(polar[..., 2])
    towards = np.stack([sin_az * cos_el, cos_az * cos_el, sin_el], axis=-1)
    level = np.maximum(distance * np.abs(cos_el), 1.0)  # at the zenith azimuth has no derivative
    across = np.stack([cos_az, -sin_az, np.zeros_like(sin_el)], axis=-1) / level[..., None]
    upward = np.stack([-sin_az * sin_el, -cos_az * sin_el, cos_el], axis=-1) / distance[..., None]
    return np.stack([towards, across, upward], axis=-2)


def _ecef_from_local(longitude_rad: Floats, latitude_rad: Floats) -> Floats:
    """Matrices (..., 3, 3) from east, north, up at places. Source: 004 eq 2."""
    sin_lat, cos_lat, sin_lon, cos_lon = (
        np.sin(latitude_rad),
        np.cos(latitude_rad),
        np.sin(longitude_rad),
        np.cos(longitude_rad),
    )
    east = np.stack([-sin_lon, cos_lon, np.zeros_like(sin_lon)], axis=-1)
    north = np.stack([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat], axis=-1)
    up = np.stack([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat], axis=-1)
    return np.stack([east, north, up], axis=-1)
