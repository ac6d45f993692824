"""The covariance of the error that a filter of several modes makes, which is not the one that it reckons with.

A mode's noise stands for manoeuvres, and the filter reckons with them all the time. An aircraft makes few: between them a
filter's error is what the measurements' noise leaves, which is two thirds to three quarters of what it reckons with, and the
mixture of modes that stay improbable adds to that. What is told to others is therefore carried beside the filter: the error
goes through the same transitions and the gains that were really used (Joseph's form holds for any gain), with a share of the
modes' noise only. What the modes disagree by is added where it is told, of those that something speaks for (`counted`).

Arrays are over n tracks and m modes, as in `modes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import ERROR, IDENTITIES, Innovation
from gateway.estimators.matching import matched

Floats = NDArray[np.float64]

MANOEUVRE_SHARE = 0.02  # of the modes' noise: how much of the manoeuvres that a filter is ready for takes place
MOST = 2.0  # times what the filter reckons with: beyond it something else has bounded the filter's covariance


def carried_on(error: Floats, weight: Floats, carry: Floats, noise: Floats, share: float = MANOEUVRE_SHARE) -> Floats:
    """Error covariances (n, d, d) later: transition and noise (n, m, d, d) of the modes, by their weights (n, m)."""
    moved, grown = _whole(weight, carry), _whole(weight, noise)
    told = share * grown
    told[:, ERROR, ERROR] = grown[:, ERROR, ERROR]
    return np.asarray(moved @ error @ moved.transpose(0, 2, 1) + told)


def corrected(error: Floats, weight: Floats, told: Innovation, mean: Floats, covariance: Floats) -> Floats:
    """Error covariances (n, d, d) after an update of n m rows, by the modes' weights (n, m), means and covariances after it.

    Means are (n, m, d), covariances (n, m, d, d). Never more than twice what the filter reckons with: a guessed height, for
    one, bounds that without a gain.
    """
    n, m, size = mean.shape
    gain = _whole(weight, told.gain.reshape(n, m, size, -1))
    kept = IDENTITIES[size] - gain @ told.sensitivity[:: m if len(told.sensitivity) > 1 else 1]
    noise = (gain * told.noise[::m, None, :]) @ gain.transpose(0, 2, 1)
    after: Floats = kept @ error @ kept.transpose(0, 2, 1) + noise
    after = 0.5 * (after + after.transpose(0, 2, 1))
    by_mode = weight[:, None, :]
    off = mean - by_mode @ mean
    reckoned = (by_mode @ (np.diagonal(covariance, axis1=2, axis2=3) + off * off))[:, 0]
    beyond = np.diagonal(after, axis1=1, axis2=2) > MOST * reckoned
    if beyond.any():
        out = beyond.any(axis=1)
        _, whole = matched(weight[out, :, None], mean[out], covariance[out])
        after[out] = whole[:, 0]
    return after


def counted(weight: Floats, shares: Floats) -> Floats:
    """How much modes' disagreement counts, (n, m), by their weights (n, m) and their shares (m,) of an aircraft's time.

    A mode that is less likely than ever has the measurements against it: what is left of its weight is mostly what mixing
    gave it, and mixing lets manoeuvres begin far more often than aircraft do. It counts that much less again.
    """
    return np.asarray(weight * np.minimum(weight / shares, 1.0))


def _whole(weight: Floats, parts: Floats) -> Floats:
    """Matrices (n, m, a, b) of the modes as one, (n, a, b), by their weights (n, m)."""
    n, m, *shape = parts.shape
    return np.asarray((weight[:, None, :] @ parts.reshape(n, m, -1)).reshape(n, *shape))
