"""What several modes make of tracks: each mode's Gaussian, how likely it is, and what is remembered of the residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import SIZE, Estimate
from gateway.estimators.lagging import lag
from gateway.estimators.matching import matched

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Mixture:
    """n tracks in m modes of d states, 9 or 11 (`holding`): mean (n, m, d), covariance (n, m, d, d), weight (n, m), in all 1.

    What is remembered of the residuals: their faded score (n, m, 3) with its information (n, m, 3, 3), those of the whole
    (n, 2, 3) and (n, 2, 3, 3), of position and of velocity, and for `literal` the last ones in metres (n, m, 5, 3), NaN
    before they are (for the other rules there is none).
    """

    mean: Floats
    covariance: Floats
    weight: Floats
    score: Floats
    information: Floats
    whole_score: Floats
    whole_information: Floats
    recent: Floats
    elapsed_s: Floats  # (n,) since the last measurement
    error: Floats  # (n, d, d) of the combined state, as `actual_error` has it
    counted: Floats  # (n, m) how much the modes' disagreement counts, by their weights before they last mixed

    @property
    def size(self) -> int:
        """How many states a mode has."""
        return int(self.mean.shape[-1])

    def each(self) -> Estimate:
        """The modes' states as n m rows, those of one track together."""
        size = self.size
        return Estimate(self.mean.reshape(-1, size), self.covariance.reshape(-1, size, size))

    def row(self, place: int) -> Mixture:
        """One of the tracks, as a mixture of one."""
        one = slice(place, place + 1)
        return Mixture(*(part[one] for part in _parts(self)))


def stacked(rows: Sequence[Mixture]) -> Mixture:
    """Mixtures of some tracks as one."""
    if len(rows) == 1:
        return rows[0]
    return Mixture(*(np.concatenate(same) for same in zip(*(_parts(row) for row in rows), strict=True)))


def _parts(mixture: Mixture) -> tuple[Floats, ...]:
    """The arrays in the order of the class."""
    return (
        mixture.mean,
        mixture.covariance,
        mixture.weight,
        mixture.score,
        mixture.information,
        mixture.whole_score,
        mixture.whole_information,
        mixture.recent,
        mixture.elapsed_s,
        mixture.error,
        mixture.counted,
    )


def combine(mixture: Mixture) -> Estimate:
    """One Gaussian a track, of the nine states, with the mixture's mean and covariance. Source: 000 2.1.2 eq 14, 15."""
    mean, covariance = matched(mixture.weight[:, :, None], mixture.mean, mixture.covariance)
    return Estimate(mean[:, 0, :SIZE], covariance[:, 0, :SIZE, :SIZE])


def stated(mixture: Mixture) -> Estimate:
    """What is told of each track: the mixture's mean, with the covariance of the error that it really has.

    `combine` has the covariance that the filter reckons with.
    """
    mean = mixture.weight[:, None, :] @ mixture.mean
    off = mixture.mean - mean
    covariance = mixture.error + (mixture.counted[:, :, None] * off).transpose(0, 2, 1) @ off
    behind = lag(mixture.whole_score, mixture.whole_information, covariance)
    if behind is not None:
        covariance = covariance + behind
    return Estimate(mean[:, 0, :SIZE], covariance[:, :SIZE, :SIZE])
