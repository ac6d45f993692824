"""The filter of several modes for many tracks that are measured together, as the gateway has it: small matrices, stacked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import modes
from gateway.estimators.kalman import Estimate
from gateway.estimators.mixture import Mixture, combine, stated
from gateway.estimators.mode_set import Modes

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Stacked:
    """A mixture of n tracks and the set of modes that it is by. See `tracks.Tracks`."""

    modes: Modes
    mixture: Mixture

    @classmethod
    def begin(cls, state: Estimate, chosen: Modes) -> Stacked:
        """See `modes.begin`."""
        return cls(chosen, modes.begin(state, chosen))

    @property
    def means(self) -> Floats:
        """See `Tracks`."""
        return self.mixture.each().mean

    @property
    def weights(self) -> Floats:
        """See `Tracks`."""
        return self.mixture.weight

    def predict(self, elapsed_s: Floats, transition: Floats | None = None) -> Stacked:
        """See `Tracks`."""
        return Stacked(self.modes, modes.predict(self.mixture, elapsed_s, self.modes, transition))

    def update(
        self, innovation: Floats, sensitivity: Floats, variance: Floats, robust: float | None = None
    ) -> tuple[Stacked, Floats, Floats]:
        """See `Tracks`."""
        after, told = modes.update(self.mixture, innovation, sensitivity, variance, self.modes, robust)
        return Stacked(self.modes, after), told.innovation, np.asarray(told.scatter)

    def combine(self) -> Estimate:
        """See `Tracks`."""
        return combine(self.mixture)

    def stated(self) -> Estimate:
        """See `Tracks`."""
        return stated(self.mixture)
