"""The four ways to weigh a position source against a radar, and what each measurement says of a state.

`bias` (default)  updates at each observation's own time, with three states for the position source's own error
`covariance`      the same without them: each source weighed by the noise it is said to have
`innovation`      the position source's noise is what its last innovations show
`literal`         the paper's: weights from the squares of two single residuals (eq 11 to 14)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Local
from gateway.estimators.alpha_beta_gamma import Tuning
from gateway.estimators.kalman import ERROR, POSITION, SIZE, VELOCITY, Estimate, Innovation, Motion, update
from gateway.estimators.modes import Modes
from gateway.frames import RadarFrame, polar_from_xyz, polar_jacobian
from gateway.fuse.flying import modes_of
from gateway.settings import Estimation, Options, PositionSource, Weighting

Floats = NDArray[np.float64]

ROBUST_SIGMA = 3.0  # beyond this (for each degree of freedom) a measurement's pull is bounded
WINDOW = 8  # innovations remembered by `innovation`
LEAST_RESIDUAL = 1e-3  # sigmas; the literal weights are singular at a residual of 0

# Three sigmas for each degree of freedom, for the three of a position: all of them may lie in one axis.
# An aircraft that flies straight for minutes must not teach the light filter that it never turns.
LIGHT = Tuning(robust=math.sqrt(3.0) * ROBUST_SIGMA, least_density=0.01)

AXES = np.arange(3)
# What a GPS report measures of the state: position (and, where the source may be wrong, its error), and velocity.
_FIX = np.eye(6, SIZE)[None]
_FIX_WITH_ERROR = _FIX + np.eye(6, SIZE, 6)


@dataclass(frozen=True, slots=True)
class Model:
    """How tracks move and how sources are weighed: the settings of a run in the filter's terms."""

    weighting: Weighting
    motion: Motion
    radars: Mapping[int, RadarFrame]
    modes: Modes | None = None  # with them, states come as rows of `together` guesses at each track
    confirm_score: float = math.log(1e4)  # logarithm of the odds that confirm a track
    light: Tuning | None = None  # of the alpha-beta-gamma filter, which asks nothing of `motion` but the source's error

    @classmethod
    def of(
        cls,
        options: Options,
        position: PositionSource,
        radars: Mapping[int, RadarFrame],
        fly: Estimation = Estimation(),
    ) -> Model:
        """The model that the options, the site's position source and how aircraft fly there ask for."""
        level = options.acceleration_sigma_mps2**2 * options.acceleration_time_s
        upright = options.vertical_acceleration_sigma_mps2**2 * options.acceleration_time_s
        error = position.systematic_m / math.sqrt(3.0) if options.weighting == "bias" else 0.0
        motion = Motion((level, level, upright), error)
        confirm_score = math.log(options.confirm_odds)
        light = LIGHT if options.estimator == "alpha-beta-gamma" else None
        return cls(options.weighting, motion, radars, modes_of(options, motion, fly), confirm_score, light)

    @property
    def together(self) -> int:
        """How many states of one track there are."""
        return 1 if self.modes is None else self.modes.count

    @property
    def memory(self) -> int:
        """How many innovations each track remembers."""
        return WINDOW if self.weighting == "innovation" else 0


def update_with_fixes(
    state: Estimate,
    position: Floats,
    sigma: Floats,
    velocity: Floats,
    velocity_sigma: Floats,
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """States after GPS reports; arrays as in `start_from_fixes`; memory (n, w, 3) of past position innovations."""
    innovation, sensitivity = told_by_fixes(state.mean, position, velocity, model)
    return _weighed(state, innovation, sensitivity, sigma, velocity_sigma, memory, model)


def told_by_fixes(mean: Floats, position: Floats, velocity: Floats, model: Model) -> tuple[Floats, Floats]:
    """Innovations (n, 6) of GPS reports of tracks whose means (n, 9) are, and their derivative (1, 6, 9) by the state."""
    sensitivity = _FIX_WITH_ERROR if model.motion.error_sigma_m else _FIX
    return np.concatenate([position - _expected(mean, model), velocity - mean[:, VELOCITY]], axis=1), sensitivity


def _expected(mean: Floats, model: Model) -> Floats:
    """Where position sources should say that the tracks are, (n, 3): with their error, where one is allowed."""
    place = mean[:, POSITION]
    return place + mean[:, ERROR] if model.motion.error_sigma_m else place


def _weighed(
    state: Estimate,
    innovation: Floats,
    sensitivity: Floats,
    sigma: Floats,
    velocity_sigma: Floats,
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """States after innovations (n, 6) of position and velocity, with the noise that the weighting gives them."""
    speed_variance = np.broadcast_to((velocity_sigma * velocity_sigma)[:, None], (len(sigma), 3))
    variance = np.concatenate([sigma * sigma, speed_variance], axis=1)
    if model.memory:
        known = np.concatenate([memory, innovation[:, None, :3]], axis=1)
        square = np.where(np.isnan(known), 0.0, known * known)
        mean_square = square.sum(axis=1) / np.maximum((~np.isnan(known)).sum(axis=1), 1)
        variance[:, :3] = np.maximum(variance[:, :3], mean_square - state.covariance[:, AXES, AXES])
        memory = known[:, 1:]
    after, told = update(state, innovation, sensitivity, variance, ROBUST_SIGMA, model.together)
    return after, told, memory


def update_in_part(
    state: Estimate,
    position: Floats,
    sigma: Floats,
    local: Sequence[Local],
    velocity_sigma: Floats,
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """States after reports that lack components: what there is counts along the axes at the reported points.

    A latitude and a longitude name a straight line along the vertical there, so what the guessed height is changes nothing
    in the horizontal. Where the vertical is less sure than the guess, it is brought to the guess's own sigma and no
    further, however often the guess is repeated: it is always wrong in the same way.
    """
    axes = np.array([one.from_enu for one in local])
    velocity = np.array([one.velocity_mps for one in local])
    has_height = np.array([one.has_height for one in local])
    sensitivity = np.zeros((len(local), 6, SIZE))
    sensitivity[:, :3, POSITION] = sensitivity[:, 3:, VELOCITY] = axes
    if model.motion.error_sigma_m:
        sensitivity[:, :3, ERROR] = axes
    off = np.concatenate(
        [_along(axes, position - _expected(state.mean, model)), velocity - _along(axes, state.mean[:, VELOCITY])],
        axis=1,
    )
    off[~has_height, 2] = math.nan
    after, told, memory = _weighed(state, off, sensitivity, sigma, velocity_sigma, memory, model)
    up = axes[:, 2:, :]
    spread = (up @ after.covariance[:, POSITION, POSITION] @ up.transpose(0, 2, 1))[:, 0, 0]
    guess = sigma[:, 2] * sigma[:, 2]
    loose = np.flatnonzero(~has_height & (spread > guess))
    if len(loose):
        above = np.zeros((len(loose), 1, SIZE))
        above[:, :, POSITION] = up[loose]
        height_off = _along(up[loose], position[loose] - after.mean[loose, POSITION])
        noise = spread[loose] * guess[loose] / (spread[loose] - guess[loose])
        bound, _ = update(Estimate(after.mean[loose], after.covariance[loose]), height_off, above, noise[:, None])
        after.mean[loose], after.covariance[loose] = bound.mean, bound.covariance
    return after, told, memory


def _along(axes: Floats, vectors: Floats) -> Floats:
    """Vectors (n, 3) along axes (n, k, 3), as (n, k)."""
    return np.asarray((axes @ vectors[:, :, None])[:, :, 0])


def update_with_plots(
    state: Estimate, polar: Floats, sigma: Floats, frame: RadarFrame, together: int = 1
) -> tuple[Estimate, Innovation]:
    """States after plots of one radar: polar and sigma (n, 3), NaN components are left out. Source: 003 2.4 eq 17 to 20."""
    innovation, sensitivity = told_by_plots(state.mean, polar, frame)
    return update(state, innovation, sensitivity, sigma * sigma, ROBUST_SIGMA, together)


def told_by_plots(mean: Floats, polar: Floats, frame: RadarFrame) -> tuple[Floats, Floats]:
    """Innovations (n, 3) of one radar's plots of tracks whose means (n, 9) are, and their derivatives (n, 3, 9) by the state."""
    xyz = frame.from_enu(mean[:, POSITION])
    sensitivity = np.zeros((len(polar), 3, SIZE))
    sensitivity[:, :, POSITION] = polar_jacobian(xyz) @ frame.radar_from_enu
    return polar_difference(polar, polar_from_xyz(xyz)), sensitivity


def update_literally(
    state: Estimate,
    position: Floats,
    position_sigma: Floats,
    polar: Floats,
    sigma: Floats,
    frame: RadarFrame,
    together: int = 1,
) -> tuple[Estimate, Innovation]:
    """States after GPS reports (n, 3) with the radar's plot at the same time, as printed.

    Source: 003 2.4 eq 11 to 14, 17 to 20.
    """
    fused, variance, jacobian = weigh_literally(state.mean[:, POSITION], position, position_sigma, polar, sigma, frame)
    sensitivity = np.zeros((len(polar), 3, SIZE))
    sensitivity[:, :, POSITION] = jacobian
    return update(state, fused, sensitivity, variance, ROBUST_SIGMA, together)


def weigh_literally(
    predicted: Floats, position: Floats, position_sigma: Floats, polar: Floats, sigma: Floats, frame: RadarFrame
) -> tuple[Floats, Floats, Floats]:
    """Residuals in range, azimuth and elevation (n, 3), their variances, and their derivatives by the position (n, 3, 3).

    Each component's weight is the inverse square of that source's residual; the noise is weighed likewise; where the radar
    gives nothing the position source stands alone.
    Source: 003 2.4 eq 11 to 14. Deviation: a residual below 1e-3 sigma counts as that.
    """
    xyz = frame.from_enu(predicted)
    expected = polar_from_xyz(xyz)
    jacobian = polar_jacobian(xyz) @ frame.radar_from_enu
    gps = polar_from_xyz(frame.from_enu(position))
    gps_variance = (jacobian * jacobian * (position_sigma * position_sigma)[:, None, :]).sum(axis=2)
    radar_variance = sigma * sigma
    by_radar, by_gps = polar_difference(polar, expected), polar_difference(gps, expected)
    weight_radar = 1.0 / np.maximum(by_radar * by_radar, LEAST_RESIDUAL**2 * radar_variance)
    weight_gps = 1.0 / np.maximum(by_gps * by_gps, LEAST_RESIDUAL**2 * gps_variance)
    total = weight_radar + weight_gps
    both = ~np.isnan(by_radar)
    fused = np.where(both, (weight_radar * by_radar + weight_gps * by_gps) / total, by_gps)
    variance = np.where(both, (weight_radar * radar_variance + weight_gps * gps_variance) / total, gps_variance)
    return fused, variance, jacobian


def polar_difference(one: Floats, other: Floats) -> Floats:
    """Range, azimuth, elevation of one less those of another, (..., 3), azimuth in (-pi, pi]."""
    difference = one - other
    azimuth = difference[..., 1]
    difference[..., 1] = azimuth - 2.0 * math.pi * np.round(azimuth / (2.0 * math.pi))
    return difference
