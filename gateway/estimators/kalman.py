"""The extended Kalman filter of one aircraft and its position source: constant velocity, and a slowly varying source error.

State, nine numbers: position (east, north, up at the runway centre, m), velocity (m/s), and the position source's own
error (m). With no error allowed its covariance is zero and the filter is the plain constant-velocity one.

Every function works on n tracks at once with stacked 9 x 9 products, in which no track is a matrix axis: the bits of one
track do not depend on how many come along.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIZE = 9
POSITION, VELOCITY, ERROR = slice(0, 3), slice(3, 6), slice(6, 9)
SURE = 1e4  # S against R: beyond it P - K H P has lost more than four of sixteen digits


@dataclass(frozen=True, slots=True)
class Estimate:
    """n Gaussian states: mean (n, 9), covariance (n, 9, 9), symmetric."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True)
class Innovation:
    """What m-dimensional measurements told n tracks: innovation (n, m), its covariance (n, m, m), which were measured (n, m).

    Components that were not measured have innovation 0 and unit variance, so that they add nothing anywhere.
    """

    innovation: Floats
    covariance: Floats
    measured: Bools
    normalised: Floats  # (n,) squared, y' S^-1 y, chi-square with as many degrees as were measured
    outlying: Bools  # (n,) so far out that the noise was raised
    sensitivity: Floats  # (n, m, 9) or (1, m, 9), the measurement's derivative by the state, 0 where not measured
    inverse: Floats  # (n, m, m) of the covariance
    gain: Floats  # (n, 9, m)
    noise: Floats  # (n, m) variances of the measurement's noise, raised where it lay too far out
    fit: Floats  # (n,) y' S^-1 y with the noise raised

    @property
    def log_likelihood(self) -> Floats:
        """Natural logarithm of the density of the measured components, (n,)."""
        _, log_determinant = np.linalg.slogdet(self.covariance)
        degrees = self.measured.sum(axis=-1)
        return np.asarray(-0.5 * (self.normalised + log_determinant + degrees * np.log(2.0 * np.pi)))


@dataclass(frozen=True, slots=True)
class Motion:
    """How the state moves: white acceleration, and a source error that forgets with a time constant (Gauss-Markov)."""

    acceleration_density: tuple[float, float, float]  # m2/s3 east, north, up: growth of velocity's variance a second
    error_sigma_m: float  # an axis; 0 = the position source is taken to have no constant error
    error_time_constant_s: float = 1e6

    def noise(self, elapsed_s: Floats, keep: Floats) -> Floats:
        """Process noise (n, 9, 9) over times (n, 1, 1) >= 0, of which the source errors keep a share (n, 1, 1)."""
        density = np.array(self.acceleration_density * 3)[:, None]  # by rows: each block's rows are east, north, up
        t = elapsed_s
        moving: Floats = (t * density) * (t * (t * _OF_POSITION + _OF_BOTH) + _OF_VELOCITY)
        if not self.error_sigma_m:
            return moving
        moving += (self.error_sigma_m**2 * (1.0 - keep * keep)) * _ERROR_STAYS
        return moving


def predict(state: Estimate, elapsed_s: Floats, motion: Motion) -> Estimate:
    """The states `elapsed_s` (n,), not negative, later. White-noise acceleration, so that two short steps equal one long one.

    Source: 003 2.4 eq 17, 18.
    """
    if len(elapsed_s) == 1:  # one track worked again after late data sees the same intervals again
        carry, noise = _over(motion, float(elapsed_s[0]))
    else:
        carry, noise = carried(motion, elapsed_s)
    mean = (carry @ state.mean[:, :, None])[:, :, 0]
    return Estimate(mean, carry @ state.covariance @ carry.transpose(0, 2, 1) + noise)


def carried(motion: Motion, elapsed_s: Floats) -> tuple[Floats, Floats]:
    """Transition and noise matrices (n, 9, 9) over times (n,), not negative."""
    t = elapsed_s[:, None, None]
    keep = np.exp(t / -motion.error_time_constant_s)
    return _UNCHANGED + t * _VELOCITY_MOVES + keep * _ERROR_STAYS, motion.noise(t, keep)


@lru_cache(maxsize=4096)
def _over(motion: Motion, elapsed_s: float) -> tuple[Floats, Floats]:
    """The same over one time, remembered; nobody may write into them."""
    carry, noise = carried(motion, np.array([elapsed_s]))
    carry.setflags(write=False)
    noise.setflags(write=False)
    return carry, noise


def _blocks(*places: tuple[slice, slice], scale: float = 1.0) -> Floats:
    """A 9 x 9 matrix with scaled identities in some of its 3 x 3 blocks."""
    matrix = np.zeros((SIZE, SIZE))
    for rows, columns in places:
        matrix[rows, columns] = scale * np.eye(3)
    return matrix


_UNCHANGED = _blocks((POSITION, POSITION), (VELOCITY, VELOCITY))
_VELOCITY_MOVES = _blocks((POSITION, VELOCITY))
_ERROR_STAYS = _blocks((ERROR, ERROR))
_OF_POSITION = _blocks((POSITION, POSITION), scale=1.0 / 3.0)
_OF_BOTH = _blocks((POSITION, VELOCITY), (VELOCITY, POSITION), scale=0.5)
_OF_VELOCITY = _blocks((VELOCITY, VELOCITY))


def update(
    state: Estimate,
    innovation: Floats,
    sensitivity: Floats,
    variance: Floats,
    robust: float | None = None,
    together: int = 1,
) -> tuple[Estimate, Innovation]:
    """One measurement for each of n tracks; components that are NaN in `innovation` (n, m) are left out.

    `sensitivity` (n, m, 9) or (1, m, 9) is the measurement's derivative by the state, `variance` (n, m) that of its
    independent noise. States may have more than nine numbers (`holding`); of the rest nothing is measured.

    With `robust` (sigmas for each degree of freedom), what lies further out has its noise raised until it is just there
    (Huber's weight): an outlier pulls no more than a bounded amount, and a source that really has jumped is followed.
    Rows in groups of `together` are guesses at one track (`modes`): the noise is raised in all of them by what the nearest
    asks for, so that an outlier does not tell them apart.
    The covariance is P - K H P, made symmetric. Where a measurement is so much surer than the state that this loses digits it
    is Joseph's form (`SURE`): it stays positive whatever the rounding.
    Source: 003 2.4 eq 19, 20.
    """
    missing = np.isnan(innovation)
    measured = ~missing
    h, y, r = sensitivity, innovation, variance
    size = state.mean.shape[1]
    if h.shape[2] < size:
        h = np.concatenate([h, np.zeros((*h.shape[:2], size - h.shape[2]))], axis=2)
    if missing.any():
        y, r = np.where(missing, 0.0, y), np.where(missing, 1.0, r)
        h = np.where(missing[:, :, None], 0.0, h)
    across = h.transpose(0, 2, 1)
    cross = state.covariance @ across
    m = y.shape[1]
    s = h @ cross
    along = s.reshape(-1, m * m)[:, :: m + 1]
    along += r
    inverse = np.asarray(np.linalg.inv(s))
    column = y[:, :, None]
    fit = normalised = _square(column, inverse)
    outlying = np.zeros(len(y), dtype=np.bool_)
    if robust is not None:
        limit = robust * robust * np.maximum(measured.sum(axis=1), 1)
        outlying, growth = _growth(normalised, limit, s, missing, together)
        if growth is not None:
            r = r + growth
            along += growth
            inverse = np.asarray(np.linalg.inv(s))
            fit = _square(column, inverse)
    gain = cross @ inverse
    mean = state.mean + (gain @ column)[:, :, 0]
    less = gain @ cross.transpose(0, 2, 1)
    np.subtract(state.covariance, less, out=less)
    sure = along > SURE * r
    if sure.any():
        some = np.flatnonzero(sure.any(axis=1))
        less[some] = _josephs(state.covariance[some], gain[some], h if len(h) == 1 else h[some], r[some])
    covariance = less + less.transpose(0, 2, 1)
    covariance *= 0.5
    told = Innovation(y, s, measured, normalised, outlying, h, inverse, gain, r, fit)
    return Estimate(mean, covariance), told


def _josephs(covariance: Floats, gain: Floats, h: Floats, r: Floats) -> Floats:
    """(I - K H) P (I - K H)' + K R K', which stays positive whatever the rounding."""
    reduced = IDENTITIES[covariance.shape[1]] - gain @ h
    noise = (gain * r[:, None, :]) @ gain.transpose(0, 2, 1)
    return np.asarray(reduced @ covariance @ reduced.transpose(0, 2, 1) + noise)


def _square(column: Floats, inverse: Floats) -> Floats:
    """y' S^-1 y, (n,), of columns (n, m, 1), never less than 0."""
    return np.maximum((column.transpose(0, 2, 1) @ inverse @ column)[:, 0, 0], 0.0)


def _growth(
    normalised: Floats, limit: Floats, s: Floats, missing: NDArray[np.bool_], together: int
) -> tuple[NDArray[np.bool_], Floats | None]:
    """Which rows (n,) lie further out than their limit, and by what (n, m) their noise grows until they are just there.

    S must grow by the factor, not R: a confident prediction would otherwise hold out for ever. None where no row does.
    """
    nearest: slice | NDArray[np.int64] = slice(None)
    if together > 1:
        first = np.arange(0, len(normalised), together)
        nearest = np.repeat(first + normalised.reshape(-1, together).argmin(axis=1), together)
    best = normalised[nearest]
    outlying = best > limit
    if not outlying.any():
        return outlying, None
    measures = missing.shape[1]
    spread = s[:, _ALONG[:measures], _ALONG[:measures]][nearest]
    growth = (np.where(outlying, best / limit, 1.0)[:, None] - 1.0) * spread
    return outlying, np.where(missing, 0.0, growth)


IDENTITIES = {size: np.eye(size) for size in (SIZE, SIZE + 2)}  # `holding` has two numbers more
_ALONG = np.arange(SIZE)


def start(
    position: Floats, position_covariance: Floats, velocity: Floats, velocity_sigma: Floats, error_sigma_m: float
) -> Estimate:
    """First states of n tracks from a position (n, 3) with covariance (n, 3, 3) and a velocity (n, 3), sigma (n,)."""
    n = position.shape[0]
    mean = np.concatenate([position, velocity, np.zeros((n, 3))], axis=1)
    covariance = np.zeros((n, SIZE, SIZE))
    covariance[:, POSITION, POSITION] = position_covariance
    axis = np.arange(3)
    covariance[:, axis + 3, axis + 3] = (velocity_sigma * velocity_sigma)[:, None]
    covariance[:, axis + 6, axis + 6] = error_sigma_m * error_sigma_m
    return Estimate(mean, covariance)
