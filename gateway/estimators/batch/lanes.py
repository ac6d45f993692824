"""The filter of several modes for many tracks that are measured together, compiled: what `modes` does, five times as fast.

The tracks of a block lie beside each other as the last axis, so that each operation is one vector instruction for several of
them, and a block stays in the processor's fast memory. It reckons as `modes` does, to rounding but not to the bit.
Source: 000 2.1.2, see `modes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import lagging, modes
from gateway.estimators.actual_error import MANOEUVRE_SHARE
from gateway.estimators.batch.correcting import corrected
from gateway.estimators.batch.judging import judged
from gateway.estimators.batch.layout import Layout
from gateway.estimators.batch.moving import mixed_and_moved
from gateway.estimators.batch.packed import Bools, Ints
from gateway.estimators.batch.telling import together
from gateway.estimators.holding import answers
from gateway.estimators.kalman import SIZE, Estimate
from gateway.estimators.mode_set import Modes
from gateway.estimators.turning import POWER, SHAPE
from gateway.geodesy import STANDARD_GRAVITY_MPS2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Lanes:
    """A `Mixture` of n tracks laid out in b blocks of L, and its set of m modes of d states. See `tracks.Tracks`."""

    modes: Modes
    layout: Layout
    mean: Floats  # (b, m, d, L)
    covariance: Floats  # (b, m, t, L), lower triangles, t = d (d + 1) / 2
    weight: Floats  # (b, m, L)
    score: Floats  # (b, m, 3, L)
    information: Floats  # (b, m, 3, 3, L)
    whole_score: Floats  # (b, 2, 3, L)
    whole_information: Floats  # (b, 2, 3, 3, L)
    elapsed_s: Floats  # (b, L)
    error: Floats  # (b, t, L)
    counted: Floats  # (b, m, L)

    @classmethod
    def begin(cls, state: Estimate, chosen: Modes) -> Lanes:
        """See `modes.begin`."""
        begun = modes.begin(state, chosen)
        layout = Layout.of(len(begun.weight))
        return cls(
            chosen,
            layout,
            layout.laid(begun.mean),
            layout.laid(_lower(begun.covariance)),
            layout.laid(begun.weight),
            layout.laid(begun.score),
            layout.laid(begun.information),
            layout.laid(begun.whole_score),
            layout.laid(begun.whole_information),
            layout.laid(begun.elapsed_s),
            layout.laid(_lower(begun.error)),
            layout.laid(begun.counted),
        )

    @property
    def means(self) -> Floats:
        """See `Tracks`."""
        return self.layout.rows(self.mean).reshape(-1, self.mean.shape[2])

    @property
    def weights(self) -> Floats:
        """See `Tracks`."""
        return self.layout.rows(self.weight)

    def predict(self, elapsed_s: Floats, transition: Floats | None = None) -> Lanes:
        """See `Tracks`."""
        if (elapsed_s == elapsed_s[0]).all():
            elapsed_s = elapsed_s[:1]
        chance = self.layout.laid(self.modes.transition(elapsed_s) if transition is None else transition)
        mean, covariance, weight = (np.empty_like(part) for part in (self.mean, self.covariance, self.weight))
        error, now = np.empty_like(self.error), (self.mean, self.covariance, self.weight, self.error)
        times, after = (self.layout.laid(elapsed_s), *self._held(elapsed_s)), (mean, covariance, weight, error)
        floats, holds, places, set_of = _of_modes(self.modes)
        mixed_and_moved(*now, chance, transition is None, *times, *floats, holds, *places, set_of, *after)
        return replace(
            self,
            mean=mean,
            covariance=covariance,
            weight=weight,
            elapsed_s=self.elapsed_s + times[0],
            error=error,
            counted=self.weight * np.minimum(self.weight / self.modes.shares[:, None], 1.0),
        )

    def _held(self, elapsed_s: Floats) -> tuple[Floats, Floats]:
        """What becomes of an acceleration that lasts over times (n,) or (1,): (b, 3, L) and, of its noise, (b, 6, L)."""
        if self.modes.acceleration is None:
            none = np.zeros((1, 6))
            return self.layout.laid(none[:, :3]), self.layout.laid(none)
        response, grown = answers(elapsed_s, self.modes.acceleration.lasts_s)
        return self.layout.laid(response), self.layout.laid(_lower(grown))

    def update(
        self, innovation: Floats, sensitivity: Floats, variance: Floats, robust: float | None = None
    ) -> tuple[Lanes, Floats, Floats]:
        """See `Tracks`."""
        blocks, m, d, width = self.mean.shape
        n, k, laid, chosen = self.layout.tracks, innovation.shape[1], self.layout.laid, self.modes
        y, r, h = _cleared(innovation, variance, sensitivity)
        limit = np.full((blocks, m, width), math.inf)
        if robust is not None:
            degrees = (~np.isnan(innovation)).sum(axis=1)
            limit = laid((robust * robust * np.maximum(degrees, 1.0)).reshape(n, m))
        y, r = laid(y.reshape(n, m, k)), laid(r.reshape(n, m, k))
        h = laid(h.reshape(n, m, k, SIZE)) if len(h) > 1 else self.layout.once(h[:, None])
        mean, covariance, noise = np.empty_like(self.mean), np.empty_like(self.covariance), np.empty_like(r)
        s, inverse, gain = (np.empty((blocks, m, a, k, width)) for a in (k, k, d))
        normalised, fit, determinant, weight = (np.empty_like(self.weight) for _ in range(4))
        corrected(
            *(self.mean, self.covariance, y, h, r, limit, mean, covariance),
            *(s, inverse, gain, noise, normalised, fit, determinant),
        )
        scores = (self.score.copy(), self.information.copy(), self.whole_score.copy(), self.whole_information.copy())
        error, counted = np.empty_like(self.error), self.counted.copy()
        told, scatter = np.empty((blocks, k, width)), np.empty((blocks, k, k, width))
        periods = self.elapsed_s / modes.MEAN_PERIOD_S
        judged(
            *(self.weight, y, h, inverse, gain, noise, fit, determinant, mean, covariance, chosen.shares),
            *(chosen.rule == "rmimm", chosen.fade**periods, np.minimum(periods, 1.0)),
            *(lagging.FADE[:, None] ** self.elapsed_s[:, None], *scores, self.error, counted),
            *(weight, told, scatter, error),
        )
        elapsed_s = np.zeros_like(self.elapsed_s)
        after = Lanes(chosen, self.layout, mean, covariance, weight, *scores, elapsed_s, error, counted)
        return after, self.layout.rows(told), self.layout.rows(scatter)

    def combine(self) -> Estimate:
        """See `Tracks`."""
        return self._told(self.weight, own=True)

    def stated(self) -> Estimate:
        """See `Tracks`."""
        return self._told(self.counted, own=False)

    def _told(self, by: Floats, *, own: bool) -> Estimate:
        n = self.layout.tracks
        mean, covariance = np.empty((n, SIZE)), np.empty((n, SIZE, SIZE))
        together(
            *(self.mean, self.covariance, self.weight, by, own, self.error, self.whole_score, self.whole_information),
            *(mean, covariance),
        )
        return Estimate(mean, covariance)


def _of_modes(chosen: Modes) -> tuple[tuple[Floats, Floats, Floats, Floats, Floats], Bools, tuple[Ints, Ints], Floats]:
    """What `mixed_and_moved` is told of the modes and of their set."""
    numbers, held, m = chosen.numbers, chosen.acceleration, chosen.count
    along, across, holds = np.ones(m), np.zeros(m), np.zeros(m, dtype=np.bool_)
    along[numbers.uneven], across[numbers.uneven] = numbers.along, numbers.across
    holds[list(numbers.holds)] = True
    lasting = (0.0, 0.0, 0.0) if held is None else (held.along_mps2, held.across_mps2, held.drag)
    banked = STANDARD_GRAVITY_MPS2 * math.tan(chosen.bank_rad)
    set_of = np.array([banked, chosen.turn_rate_rps, *lasting, MANOEUVRE_SHARE])
    floats = (numbers.turn, numbers.shaken.fades, numbers.shaken.scale, along, across)
    return floats, holds, (SHAPE, POWER), set_of


def _lower(matrices: Floats) -> Floats:
    """The lower triangles (..., t) of matrices (..., d, d)."""
    below = np.tril_indices(matrices.shape[-1])
    return np.asarray(matrices[..., below[0], below[1]])


def _cleared(innovation: Floats, variance: Floats, sensitivity: Floats) -> tuple[Floats, Floats, Floats]:
    """What was not measured, NaN in innovations (n m, k), has innovation 0, variance 1, and tells nothing."""
    missing, h = np.isnan(innovation), sensitivity[:, :, :SIZE]
    if not missing.any():
        return innovation, variance, h
    kept = np.where(missing[:, :, None], 0.0, h)
    return np.where(missing, 0.0, innovation), np.where(missing, 1.0, variance), kept
