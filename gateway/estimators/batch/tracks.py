"""Many tracks that are measured together, as in a study of many draws: the filter of several modes, compiled where it can be.

`pip install 'talkdown[fast]'` brings numba; then it is compiled, about five times as fast in batches of hundreds and the same to
rounding. Sessions are never worked with it: they have to come out bit for bit with and without numba.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.batch import packed
from gateway.estimators.batch.judging import judged
from gateway.estimators.batch.lanes import Lanes
from gateway.estimators.batch.stacked import Stacked
from gateway.estimators.kalman import Estimate
from gateway.estimators.mode_set import Modes

Floats = NDArray[np.float64]


class Tracks(Protocol):
    """n tracks in m modes of d states. See `modes` for what is reckoned."""

    @property
    def means(self) -> Floats:
        """The modes' means, (n m, d), those of one track together."""

    @property
    def weights(self) -> Floats:
        """The modes' weights, (n, m)."""

    def predict(self, elapsed_s: Floats, transition: Floats | None = None) -> Tracks:
        """The tracks times (n,) later; transitions (n, m, m) stand in for the set's own."""

    def update(
        self, innovation: Floats, sensitivity: Floats, variance: Floats, robust: float | None = None
    ) -> tuple[Tracks, Floats, Floats]:
        """The tracks after one measurement each, by every mode: arrays over n m rows as in `kalman.update`, what is missing is
        missing of all modes. And what it told in all: innovations (n, k), 0 where nothing was measured, and what they should
        scatter by, (n, k, k).
        """

    def combine(self) -> Estimate:
        """See `mixture.combine`."""

    def stated(self) -> Estimate:
        """See `mixture.stated`."""


def begin(state: Estimate, chosen: Modes) -> Tracks:
    """n tracks that were just started, n > 0: compiled where numba is installed; `literal` never is."""
    return Lanes.begin(state, chosen) if packed.INSTALLED and chosen.rule != "literal" else Stacked.begin(state, chosen)


def is_prepared() -> bool:
    """Whether a batch begins at once: the compiler's half a minute, once after each installation, is over or not needed."""
    return packed.is_kept(judged)
