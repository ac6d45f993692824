"""Which track has which plot, when several may have several: marginal probabilities by belief propagation.

A track has one plot at most, a plot one track at most. Messages run along the pairs of track and plot that are possible at all,
so cost follows these, and tracks without a common plot do not touch each other. Where no plot lies with two tracks the first
round is exact; else the sum over all joint associations is approached as by Williams and Lau (2014).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ROUNDS_AT_MOST = 30
SETTLED = 1e-3  # of a message


def shared(track: Ints, plot: Ints, weight: Floats, none: Floats, plots: int) -> tuple[Floats, Floats, Floats, bool]:
    """Chances (e,) of the pairs, (t,) of tracks to have no plot, (m,) of plots to have no track; and whether any plot is shared.

    weight (e,) of track[e] having plot[e], none (t,) of a track having none, both in the same units: how likely they are
    against the plot being clutter. A track has at most one pair with a plot.
    """
    tracks = len(none)
    contested = bool(np.bincount(plot, minlength=plots).max(initial=0) > 1)
    if not contested:
        total = none + np.bincount(track, weight, minlength=tracks)
        claimed = 1.0 + np.bincount(plot, weight / (total.take(track) - weight), minlength=plots)
        return weight / total.take(track), none / total, np.asarray(1.0 / claimed), False
    open_ = weight
    for _ in range(ROUNDS_AT_MOST):
        total = none + np.bincount(track, open_, minlength=tracks)
        claim = weight / (total.take(track) - open_)
        claimed = 1.0 + np.bincount(plot, claim, minlength=plots)
        before, open_ = open_, weight / (claimed.take(plot) - claim)
        if (np.abs(open_ - before) <= SETTLED * weight).all():
            break
    total = none + np.bincount(track, open_, minlength=tracks)
    return open_ / total.take(track), none / total, np.asarray(1.0 / claimed), True
