"""WGS-84: geodetic coordinates to earth-centred ones and back, over arrays.

Only elementwise operations are used, so a batch gives the same bits as its elements one by one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

STANDARD_GRAVITY_MPS2 = 9.80665
SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
SEMI_MINOR_M = SEMI_MAJOR_M * (1.0 - FLATTENING)
ECCENTRICITY_2 = FLATTENING * (2.0 - FLATTENING)
SECOND_ECCENTRICITY_2 = ECCENTRICITY_2 / (1.0 - ECCENTRICITY_2)


def prime_vertical_radius_m(latitude_rad: ArrayLike) -> Floats:
    """Radius of curvature in the prime vertical (the papers' N), metres, of the shape of the latitude."""
    sine = np.sin(np.asarray(latitude_rad, dtype=np.float64))
    return np.asarray(SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_2 * sine * sine))


def meridian_radius_m(latitude_rad: ArrayLike) -> Floats:
    """Radius of curvature along the meridian (M), metres, of the shape of the latitude."""
    sine = np.sin(np.asarray(latitude_rad, dtype=np.float64))
    return np.asarray(SEMI_MAJOR_M * (1.0 - ECCENTRICITY_2) / (1.0 - ECCENTRICITY_2 * sine * sine) ** 1.5)


def geodetic_to_ecef(latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike) -> Floats:
    """Earth-centred, earth-fixed position (..., 3) in metres of geodetic positions (...).

    Source: 003 2.2 eq 1.
    """
    latitude = np.asarray(latitude_rad, dtype=np.float64)
    longitude = np.asarray(longitude_rad, dtype=np.float64)
    height = np.asarray(height_m, dtype=np.float64)
    normal = prime_vertical_radius_m(latitude)
    from_axis = (normal + height) * np.cos(latitude)
    x, y = from_axis * np.cos(longitude), from_axis * np.sin(longitude)
    z = (normal * (1.0 - ECCENTRICITY_2) + height) * np.sin(latitude)
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def ecef_to_geodetic(ecef_m: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Latitude, longitude (rad) and height above the ellipsoid (m), each (...), of ECEF positions (..., 3).

    Bowring's parametric-latitude iteration, three rounds: below 1e-14 rad for heights of -10 to +100 km, poles and
    equator included. The height uses the form that is singular nowhere.
    Source: 004 eq 8. Deviation: its printed height form is singular at the equator (the numerator of its latitude lacks e'^2).
    """
    ecef = np.asarray(ecef_m, dtype=np.float64)
    x, y, z = (ecef[..., axis].copy() for axis in range(3))
    from_axis = np.sqrt(x * x + y * y)
    reduced = np.arctan2(z, (1.0 - FLATTENING) * from_axis)
    for _ in range(3):
        sine, cosine = np.sin(reduced), np.cos(reduced)
        latitude = np.arctan2(
            z + SECOND_ECCENTRICITY_2 * SEMI_MINOR_M * sine * sine * sine,
            from_axis - ECCENTRICITY_2 * SEMI_MAJOR_M * cosine * cosine * cosine,
        )
        reduced = np.arctan2((1.0 - FLATTENING) * np.sin(latitude), np.cos(latitude))
    sine = np.sin(latitude)
    height = from_axis * np.cos(latitude) + z * sine - SEMI_MAJOR_M * np.sqrt(1.0 - ECCENTRICITY_2 * sine * sine)
    return latitude, np.arctan2(y, x), height


def enu_axes(latitude_rad: float, longitude_rad: float) -> Floats:
    """The matrix `enu_from_ecef` (3, 3) at one place: rows are east, north, up.

    Source: 003 2.2 eq 2.
    """
    sin_lat, cos_lat = math.sin(latitude_rad), math.cos(latitude_rad)
    sin_lon, cos_lon = math.sin(longitude_rad), math.cos(longitude_rad)
    return np.array(
        [
            [-sin_lon, cos_lon, 0.0],
            [-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat],
            [cos_lat * cos_lon, cos_lat * sin_lon, sin_lat],
        ]
    )


def wrap_rad(angle_rad: ArrayLike) -> Floats:
    """The same angle in (-pi, pi], elementwise; angles already there keep their bits."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    turned = angle - 2.0 * math.pi * np.ceil((angle - math.pi) / (2.0 * math.pi))
    return np.where((angle > -math.pi) & (angle <= math.pi), angle, turned)
