"""What measurements told filters of several modes, in all."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import Innovation

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Told:
    """What measurements of k components told n tracks, in all: the modes' innovations as one Gaussian."""

    prior: Floats  # (n, m) the modes' weights before it
    each: Innovation  # of every mode, n m rows
    mode_log_likelihood: Floats  # (n, m)
    sensitivity: Floats  # (n, k, d) or (1, k, d) of the first mode; the modes' own hardly differ
    innovation: Floats  # (n, k), 0 where nothing was measured
    scatter: Floats  # (n, k, k) what innovations scatter by: by the error that the filter really makes; where not measured, 1

    @classmethod
    def of(cls, prior: Floats, each: Innovation, mode_log_likelihood: Floats, error: Floats, counted: Floats) -> Told:
        """From the errors (n, d, d) of the mixtures before it and how much the modes' disagreement counts, (n, m).

        Modes that have not begun are no part of the scatter: they are begun far more often by the filter than by aircraft.
        """
        n, m = prior.shape
        shaped = each.innovation.reshape(n, m, -1)
        innovation = prior[:, None, :] @ shaped
        off = shaped - innovation
        first = each.sensitivity[:: m if len(each.sensitivity) > 1 else 1]
        scatter = first @ error @ first.transpose(0, 2, 1)
        size = scatter.shape[-1]
        along = scatter.reshape(n, size * size)[:, :: size + 1]
        along += each.noise[::m]
        scatter += (counted[:, :, None] * off).transpose(0, 2, 1) @ off
        return cls(prior, each, mode_log_likelihood, first, innovation[:, 0], scatter)

    def lagging(self, lag: Floats) -> Told:
        """The same of tracks that lag behind, which adds `lag` (n, d, d) to their errors."""
        first = self.sensitivity
        return replace(self, scatter=self.scatter + first @ lag @ first.transpose(0, 2, 1))

    @property
    def covariance(self) -> Floats:
        """(n, k, k), with the spread between the modes."""
        off = self._shaped(self.each.innovation) - self.innovation[:, None]
        spread = self._shaped(self.each.covariance) + off[..., :, None] * off[..., None, :]
        return np.asarray((self.prior[:, :, None, None] * spread).sum(axis=1))

    @property
    def normalised(self) -> Floats:
        """Squared, y' S^-1 y, (n,)."""
        y = self.innovation[:, :, None]
        return np.asarray((y.transpose(0, 2, 1) @ np.linalg.inv(self.covariance) @ y)[:, 0, 0])

    @property
    def outlying(self) -> Bools:
        """Whether no mode expected it, (n,), so that its noise was raised."""
        return self.each.outlying.reshape(self.prior.shape)[:, 0]

    @property
    def log_likelihood(self) -> Floats:
        """Natural logarithm of the density of the measured components, (n,), under the mixture."""
        log = np.log(self.prior) + self.mode_log_likelihood
        greatest = log.max(axis=1)
        return np.asarray(greatest + np.log(np.exp(log - greatest[:, None]).sum(axis=1)))

    def _shaped(self, rows: Floats) -> Floats:
        return rows.reshape(*self.prior.shape, *rows.shape[1:])
