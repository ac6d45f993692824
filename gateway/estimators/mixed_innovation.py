"""What measurements told filters of several modes, in all."""

from __future__ import annotations

from dataclasses import dataclass

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
    error: Floats  # (n, d, d) of the mixtures before it, as `actual_error` has it
    unmixed: Floats  # (n, m) the weights before the modes mixed

    @property
    def innovation(self) -> Floats:
        """(n, k), 0 where nothing was measured."""
        return np.asarray((self.prior[:, None, :] @ self._shaped(self.each.innovation))[:, 0])

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
    def scatter(self) -> Floats:
        """What innovations scatter by, (n, k, k): by the error that the filter really makes. Where not measured, 1.

        Modes that have not begun are no part of it: they are begun far more often by the filter than by aircraft.
        """
        first = self.sensitivity
        scatter = first @ self.error @ first.transpose(0, 2, 1)
        along = np.arange(scatter.shape[-1])
        scatter[:, along, along] += self.each.noise[:: self.prior.shape[1]]
        off = self._shaped(self.each.innovation) - self.innovation[:, None]
        apart = self.unmixed[:, :, None, None] * (off[..., :, None] * off[..., None, :])
        return np.asarray(scatter + apart.sum(axis=1))

    @property
    def sensitivity(self) -> Floats:
        """(n, k, d) of the first mode; the modes' own hardly differ."""
        each = self.each.sensitivity
        return np.broadcast_to(each, (self.prior.size, *each.shape[1:]))[:: self.prior.shape[1]]

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
