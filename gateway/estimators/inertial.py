"""Strapdown navigation: attitude, velocity and position carried on from gyro and accelerometer, over leading axes.

Body axes: x forward, y right, z down. Navigation axes: north, east, down at the vehicle's own place. A quaternion is (w, x, y,
z) and turns body vectors into navigation ones. Source: 002-4 2; its formulas are lost in print and are the usual ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.geodesy import ECCENTRICITY_2, FLATTENING, SEMI_MAJOR_M, meridian_radius_m, prime_vertical_radius_m

Floats = NDArray[np.float64]

EARTH_RATE_RADPS = 7.292_115e-5
_EQUATOR_MPS2, _SOMIGLIANA = 9.780_325_335_9, 1.931_852_652_41e-3
_GM_RATIO = 3.449_786_506_84e-3


@dataclass(frozen=True, slots=True)
class Motion:
    """Where vehicles are, how they move and how they stand; each (...,), vectors (..., 3), quaternions (..., 4)."""

    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats
    velocity_mps: Floats  # north, east, down
    attitude: Floats


def advanced(
    motion: Motion, rate_radps: ArrayLike, force_mps2: ArrayLike, interval_s: ArrayLike, *, harmful: bool = True
) -> Motion:
    """The motion one interval later, of the interval's mean angular rate and specific force (..., 3), along the body.

    `harmful` takes off the acceleration of the earth's turning and of its curvature (2 w_ie + w_en) x v; leaving it out, as
    simple reckoners do, costs 41 m in 199 s at 25 m/s. Second order in the interval. Source: 002-4 2.
    """
    step = np.asarray(interval_s, dtype=np.float64)[..., None]
    earth = earth_rate(motion.latitude_rad)
    frame = transport(motion) + earth
    half = turned_by(np.asarray(rate_radps, dtype=np.float64) * (0.5 * step))  # half of the interval, and again
    level = turned_by(frame * (-0.5 * step))
    middle = product(level, product(motion.attitude, half))
    attitude = product(level, product(middle, half))
    felt = rotate(middle, np.asarray(force_mps2, dtype=np.float64))
    felt[..., 2] += gravity(motion.latitude_rad, motion.height_m)
    velocity = motion.velocity_mps + felt * step
    if harmful:
        velocity = velocity - cross(frame + earth, 0.5 * (motion.velocity_mps + velocity)) * step
    metres = 0.5 * (motion.velocity_mps + velocity) * step
    latitude, longitude, height = displaced(motion.latitude_rad, motion.longitude_rad, motion.height_m, metres)
    square = np.sum(attitude * attitude, axis=-1, keepdims=True)
    return Motion(
        latitude, longitude, height, velocity, attitude * (1.5 - 0.5 * square)
    )  # a length that is 1 but for rounding


def displaced(latitude: Floats, longitude: Floats, height: Floats, metres: Floats) -> tuple[Floats, Floats, Floats]:
    """A geodetic place moved by metres north, east, down (..., 3)."""
    meridian, normal = meridian_radius_m(latitude), prime_vertical_radius_m(latitude)
    further = latitude + metres[..., 0] / (meridian + height)
    middle = 0.5 * (latitude + further)
    return further, longitude + metres[..., 1] / ((normal + height) * np.cos(middle)), height - metres[..., 2]


def between(latitude: Floats, longitude: Floats, height: Floats, motion: Motion) -> Floats:
    """Metres north, east, down (..., 3) from a motion's place to a geodetic one near to it."""
    meridian, normal = meridian_radius_m(motion.latitude_rad), prime_vertical_radius_m(motion.latitude_rad)
    middle = 0.5 * (latitude + motion.latitude_rad)
    north = (latitude - motion.latitude_rad) * (meridian + motion.height_m)
    east = (longitude - motion.longitude_rad) * (normal + motion.height_m) * np.cos(middle)
    return np.stack(np.broadcast_arrays(north, east, motion.height_m - height), axis=-1)


def earth_rate(latitude_rad: ArrayLike) -> Floats:
    """How the earth turns, north, east, down (..., 3) rad/s."""
    latitude = np.asarray(latitude_rad, dtype=np.float64)
    made = np.zeros((*latitude.shape, 3))
    made[..., 0], made[..., 2] = EARTH_RATE_RADPS * np.cos(latitude), -EARTH_RATE_RADPS * np.sin(latitude)
    return made


def transport(motion: Motion) -> Floats:
    """How north and down turn because the vehicle moves over the curved earth (..., 3) rad/s."""
    meridian, normal = meridian_radius_m(motion.latitude_rad), prime_vertical_radius_m(motion.latitude_rad)
    north, east = motion.velocity_mps[..., 0], motion.velocity_mps[..., 1]
    about_north = east / (normal + motion.height_m)
    made = np.empty((*np.shape(motion.latitude_rad), 3))
    made[..., 0], made[..., 1] = about_north, -north / (meridian + motion.height_m)
    made[..., 2] = -about_north * np.tan(motion.latitude_rad)
    return made


def gravity(latitude_rad: ArrayLike, height_m: ArrayLike) -> Floats:
    """Downward m/s2: Somigliana's on the ellipsoid, less with height."""
    square = np.sin(np.asarray(latitude_rad, dtype=np.float64)) ** 2
    height = np.asarray(height_m, dtype=np.float64) / SEMI_MAJOR_M
    below = _EQUATOR_MPS2 * (1.0 + _SOMIGLIANA * square) / np.sqrt(1.0 - ECCENTRICITY_2 * square)
    return np.asarray(
        below * (1.0 - 2.0 * (1.0 + FLATTENING + _GM_RATIO - 2.0 * FLATTENING * square) * height + 3.0 * height**2)
    )


def turned_by(angles_rad: ArrayLike) -> Floats:
    """The quaternion (..., 4) of a rotation vector (..., 3)."""
    vector = np.asarray(angles_rad, dtype=np.float64)
    half = 0.5 * np.sqrt(np.sum(vector * vector, axis=-1))
    quaternion = np.empty((*half.shape, 4))
    quaternion[..., 0] = np.cos(half)
    quaternion[..., 1:] = vector * (0.5 * np.where(half > 1e-9, np.sin(half) / np.maximum(half, 1e-9), 1.0))[..., None]
    return quaternion


def product(left: Floats, right: Floats) -> Floats:
    """Quaternions one after the other (..., 4): `right` is turned first."""
    w, x, y, z = (left[..., place] for place in range(4))
    a, b, c, d = (right[..., place] for place in range(4))
    made = np.empty(np.broadcast_shapes(left.shape, right.shape))
    made[..., 0] = w * a - x * b - y * c - z * d
    made[..., 1] = w * b + x * a + y * d - z * c
    made[..., 2] = w * c - x * d + y * a + z * b
    made[..., 3] = w * d + x * c - y * b + z * a
    return made


def cross(left: Floats, right: Floats) -> Floats:
    """The cross product of vectors (..., 3)."""
    made = np.empty(np.broadcast_shapes(left.shape, right.shape))
    for place, (one, other) in enumerate(((1, 2), (2, 0), (0, 1))):
        made[..., place] = left[..., one] * right[..., other] - left[..., other] * right[..., one]
    return made


def matrix(attitude: Floats) -> Floats:
    """The rotation matrices (..., 3, 3) of quaternions."""
    w, x, y, z = (attitude[..., place] for place in range(4))
    made = np.empty((*attitude.shape[:-1], 3, 3))
    made[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    made[..., 0, 1], made[..., 0, 2] = 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    made[..., 1, 0], made[..., 1, 2] = 2.0 * (x * y + w * z), 2.0 * (y * z - w * x)
    made[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    made[..., 2, 0], made[..., 2, 1] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x)
    made[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return made


def rotate(attitude: Floats, vectors: Floats) -> Floats:
    """Body vectors (..., 3) along the navigation axes."""
    return np.asarray((matrix(attitude) @ vectors[..., None])[..., 0])


def from_angles(roll_rad: ArrayLike, pitch_rad: ArrayLike, yaw_rad: ArrayLike) -> Floats:
    """The quaternion (..., 4) of roll (right wing down), pitch (nose up), yaw (clockwise from north)."""
    halves = [0.5 * np.asarray(one, dtype=np.float64) for one in (roll_rad, pitch_rad, yaw_rad)]
    (sr, sp, sy), (cr, cp, cy) = ([turn(half) for half in halves] for turn in (np.sin, np.cos))
    parts = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def heading_rad(attitude: Floats) -> Floats:
    """Where the nose points (...,), clockwise from north, of quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(attitude, -1, 0)
    return np.asarray(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
