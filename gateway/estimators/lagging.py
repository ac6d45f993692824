"""How far a track lags behind: the mean of what measurements said against it, where noise alone does not make it so large.

A manoeuvre that no mode has found yet pushes every innovation to one side. Their faded mean, as a displacement of the
position, tells how far; what the state's own covariance says of it carries that into velocity and acceleration.
Arrays are over n tracks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import POSITION

Floats = NDArray[np.float64]

FADE = 0.88  # of the mean, over a second
USUAL = 6.0  # of three degrees of freedom: a mean as large as this is noise's

_UNIT = np.eye(3)


def faded(
    score: Floats, information: Floats, innovation: Floats, scatter: Floats, sensitivity: Floats, elapsed_s: Floats
) -> tuple[Floats, Floats]:
    """Score (n, 3) and information (n, 3, 3) after innovations (n, k) of covariance (n, k, k), times (n,) after the last."""
    by_position = sensitivity[:, :, POSITION]
    weighed = by_position.transpose(0, 2, 1) @ np.linalg.inv(scatter)
    left = (FADE**elapsed_s)[:, None]
    fresh = (weighed @ innovation[:, :, None])[:, :, 0]
    return left * score + fresh, (left * left)[:, :, None] * information + weighed @ by_position


def lag(score: Floats, information: Floats, covariance: Floats) -> Floats:
    """What a lag adds to covariances (n, d, d): of rank one, and nothing where the mean is no larger than noise makes it."""
    size = np.maximum(1e-9 * np.trace(information, axis1=1, axis2=2), 1e-30)
    lifted = information + size[:, None, None] * _UNIT
    off = np.linalg.inv(lifted) @ score[:, :, None]
    excess = (score[:, None, :] @ off)[:, 0, 0]
    share = np.maximum(0.0, 1.0 - USUAL / np.maximum(excess, 1e-9))
    place = covariance[:, POSITION, POSITION]
    whole = covariance[:, :, POSITION] @ np.linalg.inv(place) @ off
    return np.asarray(share[:, None, None] * (whole @ whole.transpose(0, 2, 1)))
