"""Dead reckoning: an error-state filter about strapdown navigation, that goes on while no position comes.

Seventeen error states: place (3) m and velocity (3) m/s north, east, down; attitude (3) rad about the same axes; gyro bias (3)
rad/s and accelerometer bias (3) m/s2 along the body; wind (2) m/s, where the air moves to, north and east. Of what hangs from
rotors and has no unit there is an eighteenth, its drag (`medium`). What a vehicle tells beside its inertial unit ties them:
positions, velocities, the autopilot's own attitude, airspeed, height by pressure; and that wheels and keels do not move
sideways. All over leading axes: one vehicle or a hundred.

Source: 002-4 2 and 3. Deviation: the printed filter estimates positions and accelerations of a plane; it is kept beside this
one in `plane_reckoning`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.estimators.inertial import Motion, advanced, between, cross, displaced, matrix, product, turned_by

Floats = NDArray[np.float64]

STATES, STATES_WITH_DRAG = 17, 18
PLACE, VELOCITY, ATTITUDE = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO, FORCE, WIND = slice(9, 12), slice(12, 15), slice(15, 17)
DRAG = 17
_EYE = {count: np.eye(count) for count in (STATES, STATES_WITH_DRAG)}


@dataclass(frozen=True, slots=True)
class Unit:
    """How good an inertial unit is, and how the wind changes. Defaults: the MEMS unit of a small autopilot."""

    rate_noise: float = 2e-4  # rad/s in a root Hz; vibration included
    force_noise: float = 0.03  # m/s2 in a root Hz
    rate_bias_radps: float = 0.01  # 1 sigma when switched on
    force_bias_mps2: float = 0.3
    rate_bias_wanders: float = 2e-5  # rad/s in a root second
    force_bias_wanders: float = 1e-3  # m/s2 in a root second
    wind_mps: float = 10.0  # 1 sigma before anything is known
    wind_wanders: float = 0.15  # m/s in a root second


@dataclass(frozen=True, slots=True)
class Reckoning:
    """What is known of vehicles (...): their motion, the biases (..., 3), the wind (..., 2), the covariance (..., 17, 17) or,
    where drag is one of the states, (..., 18, 18).
    """

    motion: Motion
    rate_bias_radps: Floats
    force_bias_mps2: Floats
    wind_mps: Floats
    covariance: Floats
    # (...,) the share of its airspeed lost in a second
    drag_per_s: Floats = field(default_factory=lambda: np.zeros(()))

    @property
    def one(self) -> Floats:
        """The unit matrix of its states."""
        return _EYE[self.covariance.shape[-1]]


@dataclass(frozen=True, slots=True)
class Innovation:
    """What a measurement said beyond what was expected (..., m), and its covariance (..., m, m)."""

    off: Floats
    covariance: Floats


def started(
    motion: Motion,
    place_sigma_m: ArrayLike,
    velocity_sigma_mps: ArrayLike,
    attitude_sigma_rad: ArrayLike,
    unit: Unit = Unit(),
    drag_per_s: tuple[float, float] | None = None,
) -> Reckoning:
    """The state of vehicles whose motion is known so well; sigmas (3,) or (..., 3). `drag_per_s`: about what their drag is,
    and its sigma, where it is one of the states.
    """
    shape = np.shape(motion.height_m)
    drag, drag_sigma = drag_per_s or (0.0, 0.0)
    count = STATES if drag_per_s is None else STATES_WITH_DRAG
    sigma = np.zeros((*shape, count))
    sigma[..., PLACE], sigma[..., VELOCITY] = place_sigma_m, velocity_sigma_mps
    sigma[..., ATTITUDE] = attitude_sigma_rad
    sigma[..., GYRO], sigma[..., FORCE] = unit.rate_bias_radps, unit.force_bias_mps2
    sigma[..., WIND], sigma[..., DRAG:] = unit.wind_mps, drag_sigma
    covariance = sigma[..., None] ** 2 * _EYE[count]
    bias, wind = np.zeros((*shape, 3)), np.zeros((*shape, 2))
    return Reckoning(motion, bias, bias, wind, covariance, np.full(shape, drag))


def carried_on(
    state: Reckoning, rate_radps: ArrayLike, force_mps2: ArrayLike, interval_s: ArrayLike, unit: Unit = Unit()
) -> Reckoning:
    """One interval later, of its mean angular rate and specific force (..., 3) as the unit measured them."""
    rate, force = np.asarray(rate_radps, dtype=np.float64), np.asarray(force_mps2, dtype=np.float64)
    return carried_through(state, rate[..., None, :], force[..., None, :], interval_s, unit)


def carried_through(
    state: Reckoning,
    rates_radps: Floats,
    forces_mps2: Floats,
    interval_s: ArrayLike,
    unit: Unit = Unit(),
    more: tuple[Floats, Floats] | None = None,
    gyro: ArrayLike = 1.0,
) -> Reckoning:
    """Some equal intervals later, of each one's mean rate and force (..., m, 3): motion by motion, the covariance at once.

    `more`: noises of rate and force (..., 3) in a root Hz, along the body, beyond the unit's. `gyro` (...,): 1 where the
    rates are a gyro's, 0 where they are another's, which the gyro's bias is not in.
    """
    biased = np.asarray(gyro, dtype=np.float64)[..., None]
    count = rates_radps.shape[-2]
    step = np.broadcast_to(np.asarray(interval_s, dtype=np.float64), np.shape(state.motion.height_m))
    motion, body, felt = state.motion, np.zeros(()), np.zeros(())
    for place in range(count):
        rate = rates_radps[..., place, :] - biased * state.rate_bias_radps
        force = forces_mps2[..., place, :] - state.force_bias_mps2
        turned = matrix(motion.attitude)
        body, felt = body + turned / count, felt + (turned @ force[..., None])[..., 0] / count
        motion = advanced(motion, rate, force, step)
    covariance = _covariance_after(state.covariance, body, felt, biased, step * count, unit)
    if more is not None:
        for part, noise in ((ATTITUDE, more[0]), (VELOCITY, more[1])):
            whole = body * (noise**2 * (step * count)[..., None])[..., None, :]
            covariance[..., part, part] += whole @ np.swapaxes(body, -1, -2)
    return replace(state, motion=motion, covariance=covariance)


def _covariance_after(
    covariance: Floats, body: Floats, felt: Floats, biased: Floats, step: Floats, unit: Unit
) -> Floats:
    """The covariance a while (...,) later, of the mean attitude (..., 3, 3) and the mean force felt (..., 3) in it."""
    count = covariance.shape[-1]
    across = np.zeros((*step.shape, count, count))
    across[..., :, :] = _EYE[count]
    whole, half = step[..., None, None], 0.5 * step[..., None, None]
    tilt, lean = -skew(felt) * whole, -body * whole
    across[..., PLACE, VELOCITY] = np.eye(3) * whole
    across[..., PLACE, ATTITUDE], across[..., PLACE, FORCE] = tilt * half, lean * half
    across[..., VELOCITY, ATTITUDE], across[..., VELOCITY, FORCE] = tilt, lean
    across[..., ATTITUDE, GYRO] = biased[..., None] * lean
    later = across @ covariance @ np.swapaxes(across, -1, -2)
    later[..., range(STATES), range(STATES)] += _shaken(unit) * step[..., None]
    later[..., range(3), range(3)] += unit.force_noise**2 * step[..., None] ** 3 / 3.0
    return np.asarray(later)


def _shaken(unit: Unit) -> Floats:
    """Variance a second of each state (17,)."""
    parts = ((0.0, 3), (unit.force_noise, 3), (unit.rate_noise, 3), (unit.rate_bias_wanders, 3))
    more = ((unit.force_bias_wanders, 3), (unit.wind_wanders, 2))
    return np.concatenate([np.full(count, sigma**2) for sigma, count in (*parts, *more)])


# What ties it ---------------------------------------------------------------------------------------------------------


def with_place(
    state: Reckoning, latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike, sigma_m: ArrayLike
) -> tuple[Reckoning, Innovation]:
    """With a position; sigmas (..., 3) north, east, down."""
    latitude, longitude, height = (np.asarray(one, dtype=np.float64) for one in (latitude_rad, longitude_rad, height_m))
    return _with(state, between(latitude, longitude, height, state.motion), state.one[PLACE], sigma_m)


def with_velocity(state: Reckoning, velocity_mps: ArrayLike, sigma_mps: ArrayLike) -> tuple[Reckoning, Innovation]:
    """With a velocity over the ground (..., 3) north, east, down; nought for what stands still."""
    return _with(state, np.asarray(velocity_mps) - state.motion.velocity_mps, state.one[VELOCITY], sigma_mps)


def with_measured(state: Reckoning, off: ArrayLike, sigma: ArrayLike) -> Reckoning:
    """With place and velocity that are off by so much (..., 6) m and m/s, north, east, down; sigmas (..., 6)."""
    return _with(state, np.asarray(off, dtype=np.float64), state.one[:6], sigma)[0]


def with_attitude(state: Reckoning, attitude: Floats, sigma_rad: ArrayLike) -> tuple[Reckoning, Innovation]:
    """With the autopilot's own attitude, a quaternion (..., 4); sigmas (..., 3) about north, east, down.

    Its errors last for seconds: what comes ten times a second must be given sigmas that say so.
    """
    conjugate = state.motion.attitude * [1.0, -1.0, -1.0, -1.0]
    apart = product(attitude, conjugate)
    apart = apart * np.where(apart[..., :1] < 0.0, -1.0, 1.0)
    return _with(state, 2.0 * apart[..., 1:], state.one[ATTITUDE], sigma_rad)


def with_gyro_bias(state: Reckoning, bias_radps: ArrayLike, sigma_radps: ArrayLike) -> tuple[Reckoning, Innovation]:
    """With what the gyro's bias is seen to be (..., 3), by another that tells how it turned; sigmas (..., 3)."""
    return _with(state, np.asarray(bias_radps) - state.rate_bias_radps, state.one[GYRO], sigma_radps)


def with_airspeed(
    state: Reckoning, true_airspeed_mps: ArrayLike, sigma_mps: ArrayLike, sideslip_sigma_mps: ArrayLike
) -> tuple[Reckoning, Innovation]:
    """With an airspeed along the nose and none across it: that tells the wind, and by the wind, held, the velocity."""
    through = state.motion.velocity_mps.copy()
    through[..., :2] -= state.wind_mps
    body = matrix(state.motion.attitude)
    along = (np.swapaxes(body, -1, -2) @ through[..., None])[..., 0]
    speed = np.maximum(np.linalg.norm(through, axis=-1), 1.0)
    observed = np.zeros((*speed.shape, 2, len(state.one)))
    forward = through / speed[..., None]
    observed[..., 0, VELOCITY], observed[..., 0, WIND] = forward, -forward[..., :2]
    right = body[..., :, 1]
    observed[..., 1, VELOCITY], observed[..., 1, WIND] = right, -right[..., :2]
    observed[..., 1, ATTITUDE] = cross(right, through)
    off = np.stack(np.broadcast_arrays(np.asarray(true_airspeed_mps) - speed, -along[..., 1]), axis=-1)
    return _with(state, off, observed, np.stack(np.broadcast_arrays(sigma_mps, sideslip_sigma_mps), axis=-1))


def with_wheels(state: Reckoning, sigma_mps: ArrayLike) -> tuple[Reckoning, Innovation]:
    """With no velocity to the side and none through the floor, sigmas (..., 2): ground vehicles and, to the side, ships."""
    body = matrix(state.motion.attitude)
    sides = np.swapaxes(body[..., :, 1:], -1, -2)
    observed = np.zeros((*np.shape(state.motion.height_m), 2, len(state.one)))
    observed[..., VELOCITY] = sides
    observed[..., ATTITUDE] = cross(sides, state.motion.velocity_mps[..., None, :])
    return _with(state, -(sides @ state.motion.velocity_mps[..., None])[..., 0], observed, sigma_mps)


def _with(state: Reckoning, off: Floats, observed: Floats, sigma: ArrayLike) -> tuple[Reckoning, Innovation]:
    """The state after a measurement: Joseph's form, then the errors go into the motion and are nought again."""
    noise = np.broadcast_to(np.asarray(sigma, dtype=np.float64), off.shape) ** 2
    turned = np.swapaxes(observed, -1, -2)
    before = state.covariance @ turned
    innovation = observed @ before
    innovation = 0.5 * (innovation + np.swapaxes(innovation, -1, -2)) + noise[..., None] * np.eye(off.shape[-1])
    gain = np.swapaxes(np.linalg.solve(innovation, np.swapaxes(before, -1, -2)), -1, -2)
    kept = state.one - gain @ observed
    covariance = kept @ state.covariance @ np.swapaxes(kept, -1, -2) + (gain * noise[..., None, :]) @ np.swapaxes(
        gain, -1, -2
    )
    covariance = 0.5 * (covariance + np.swapaxes(covariance, -1, -2))
    return _corrected(state, (gain @ off[..., None])[..., 0], covariance), Innovation(off, innovation)


def _corrected(state: Reckoning, error: Floats, covariance: Floats) -> Reckoning:
    motion = state.motion
    place = displaced(motion.latitude_rad, motion.longitude_rad, motion.height_m, error[..., PLACE])
    attitude = product(turned_by(error[..., ATTITUDE]), motion.attitude)
    return Reckoning(
        Motion(*place, motion.velocity_mps + error[..., VELOCITY], attitude),
        state.rate_bias_radps + error[..., GYRO],
        state.force_bias_mps2 + error[..., FORCE],
        state.wind_mps + error[..., WIND],
        covariance,
        state.drag_per_s + (error[..., DRAG] if error.shape[-1] > DRAG else 0.0),
    )


def skew(vector: Floats) -> Floats:
    """(..., 3, 3): the matrix that makes the cross product with vectors (..., 3)."""
    x, y, z = (vector[..., place] for place in range(3))
    zero = np.zeros_like(x)
    rows = ((zero, -z, y), (z, zero, -x), (-y, x, zero))
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
