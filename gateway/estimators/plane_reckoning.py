"""Dead reckoning in the plane as printed: positions, velocities and accelerations north and east, tied by a gyro.

The state is [north, its velocity, its acceleration, east, its velocity, its acceleration]. Between positions it observes the
rate of turn about the vertical and both accelerations, which strapdown navigation has brought into navigation axes.

Source: 002-4 3. `dead_reckoning` measures better and is what the gateway uses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.estimators.inertial import Motion, cross, earth_rate, gravity, product, rotate, transport, turned_by

Floats = NDArray[np.float64]

SLOWEST_MPS = 2.0  # below it a course has no rate: the rate of turn is left out


@dataclass(frozen=True, slots=True)
class Noise:
    """Of the model and of what is observed."""

    jerk: float = 2.0  # m/s3 in a root Hz
    rate_radps: float = 0.01
    acceleration_mps2: float = 0.5  # an attitude that is half a degree off counts as acceleration, and lasts
    place_m: float = 1.5


@dataclass(frozen=True, slots=True)
class Plane:
    """The state (..., 6) and its covariance (..., 6, 6)."""

    state: Floats
    covariance: Floats


def turn_rate(state: Floats) -> Floats:
    """What the vertical gyro should show (...,): (vN aE - vE aN) / v^2."""
    vn, an, ve, ae = state[..., 1], state[..., 2], state[..., 4], state[..., 5]
    return np.asarray((vn * ae - ve * an) / (vn * vn + ve * ve))


def turn_rate_slopes(state: Floats) -> Floats:
    """Its derivatives by the state (..., 6)."""
    vn, an, ve, ae = state[..., 1], state[..., 2], state[..., 4], state[..., 5]
    square = vn * vn + ve * ve
    rate = (vn * ae - ve * an) / square
    zero = np.zeros_like(vn)
    return np.stack(
        [zero, (ae - 2.0 * rate * vn) / square, -ve / square, zero, (-an - 2.0 * rate * ve) / square, vn / square],
        axis=-1,
    )


def predicted(plane: Plane, interval_s: float, noise: Noise = Noise()) -> Plane:
    """One interval later: constant acceleration, shaken by white jerk."""
    t = interval_s
    block = np.array([[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    shaken = noise.jerk**2 * np.array(
        [[t**5 / 20.0, t**4 / 8.0, t**3 / 6.0], [t**4 / 8.0, t**3 / 3.0, t * t / 2.0], [t**3 / 6.0, t * t / 2.0, t]]
    )
    carry, process = np.kron(np.eye(2), block), np.kron(np.eye(2), shaken)
    state = (carry @ plane.state[..., None])[..., 0]
    return Plane(state, carry @ plane.covariance @ carry.T + process)


def with_inertial(plane: Plane, rate_radps: ArrayLike, acceleration_mps2: ArrayLike, noise: Noise = Noise()) -> Plane:
    """With the rate of turn about the vertical (...,), clockwise, and the accelerations north and east (..., 2)."""
    state = plane.state
    fast = np.hypot(state[..., 1], state[..., 4]) > SLOWEST_MPS
    moving = np.where(fast[..., None], state, np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    observed = np.zeros((*fast.shape, 3, 6))
    observed[..., 0, :] = np.where(fast[..., None], turn_rate_slopes(moving), 0.0)
    observed[..., 1, 2] = observed[..., 2, 5] = 1.0
    off = np.zeros((*fast.shape, 3))
    off[..., 0] = np.where(fast, np.asarray(rate_radps) - turn_rate(moving), 0.0)
    off[..., 1:] = np.asarray(acceleration_mps2) - state[..., [2, 5]]
    return _with(plane, off, observed, np.array([noise.rate_radps, *[noise.acceleration_mps2] * 2]))


def with_place(plane: Plane, place_m: ArrayLike, noise: Noise = Noise()) -> Plane:
    """With a position, north and east (..., 2)."""
    observed = np.zeros((*plane.state.shape[:-1], 2, 6))
    observed[..., 0, 0] = observed[..., 1, 3] = 1.0
    off = np.asarray(place_m) - plane.state[..., [0, 3]]
    return _with(plane, off, observed, np.full(2, noise.place_m))


def _with(plane: Plane, off: Floats, observed: Floats, sigma: Floats) -> Plane:
    turned = np.swapaxes(observed, -1, -2)
    noise = np.diag(sigma**2)
    innovation = observed @ plane.covariance @ turned + noise
    gain = np.swapaxes(np.linalg.solve(innovation, observed @ plane.covariance), -1, -2)
    kept = np.eye(6) - gain @ observed
    covariance = kept @ plane.covariance @ np.swapaxes(kept, -1, -2) + gain @ noise @ np.swapaxes(gain, -1, -2)
    return Plane(plane.state + (gain @ off[..., None])[..., 0], 0.5 * (covariance + np.swapaxes(covariance, -1, -2)))


def attitude_after(motion: Motion, rate_radps: Floats, interval_s: float) -> Floats:
    """The attitude carried on by the gyro alone: its rate less the earth's and the transport's. Source: 002-4 2 (1, 2)."""
    frame = earth_rate(motion.latitude_rad) + transport(motion)
    turned = product(motion.attitude, turned_by(rate_radps * interval_s))
    attitude = product(turned_by(-frame * interval_s), turned)
    return np.asarray(attitude / np.linalg.norm(attitude, axis=-1, keepdims=True))


def acceleration(motion: Motion, force_mps2: Floats) -> Floats:
    """Accelerations north and east (..., 2) of a specific force along the body, less gravity and the harmful part."""
    felt = rotate(motion.attitude, force_mps2)
    felt[..., 2] += gravity(motion.latitude_rad, motion.height_m)
    harmful = cross(2.0 * earth_rate(motion.latitude_rad) + transport(motion), motion.velocity_mps)
    return np.asarray((felt - harmful)[..., :2])
