"""What residuals of filters that work axis by axis tell, and how far a residual may pull."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.axis_covariance import Three

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Innovation:
    """What measurements told n tracks, component by component (n, m): m is the axes, twice with a velocity.

    The velocity's residuals are those left after the position. Components that were not measured have residual 0 and unit
    variance, so that they add nothing anywhere.
    """

    innovation: Floats
    variance: Floats
    measured: Bools
    outlying: Bools  # (n,) so far out, on some axis, that the pull was bounded
    gamma: Floats  # (n, axes) the gain parameter

    @property
    def normalised(self) -> Floats:
        """Squared residuals over their variances, summed, (n,): chi-square with as many degrees as were measured."""
        return np.asarray((self.innovation * self.innovation / self.variance).sum(axis=-1))

    @property
    def covariance(self) -> Floats:
        """The residuals' covariance (n, m, m), diagonal."""
        return np.asarray(self.variance[..., None] * np.eye(self.variance.shape[-1]))

    @property
    def log_likelihood(self) -> Floats:
        """Natural logarithm of the density of the measured components, (n,)."""
        degrees = self.measured.sum(axis=-1)
        return np.asarray(-0.5 * (self.normalised + np.log(self.variance).sum(axis=-1) + degrees * np.log(2.0 * np.pi)))


def bounded(gain: Three, s: Floats, squared: Floats, robust: float | None) -> tuple[Three, Floats, Bools]:
    """The gains with what pulls too far held back, how much residual variances grow by it, and which tracks (n,) had one.

    `s` and `squared` (n, axes) are the residuals' variances and squares, `robust` the sigmas beyond which none pulls more.
    """
    if robust is None:
        return gain, np.ones_like(s), np.zeros(len(s), dtype=np.bool_)
    pull = robust / np.sqrt(np.maximum(squared / s, robust**2))
    outlying = np.asarray((pull < 1.0).any(axis=-1))
    return (gain[0] * pull, gain[1] * pull, gain[2] * pull), 1.0 / (pull * pull), outlying
