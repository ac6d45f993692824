"""How far a track lags behind: the mean of what measurements said against it, where noise alone does not make it so large.

A manoeuvre that no mode has found yet pushes every innovation to one side. Their faded mean, as a displacement of the
position, tells how far; what the state's own covariance says of it carries that into velocity and acceleration. Where the
velocity is measured its own innovations tell within a report or two how far that is off, so their mean is forgotten sooner.
Arrays are over n tracks; of two parts, position and velocity.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import POSITION, VELOCITY

Floats = NDArray[np.float64]

FADE = np.array([0.88, 0.5])  # of the mean, over a second
USUAL = np.array([6.0, 9.0])  # of three degrees of freedom: a mean as large as this is noise's

_PARTS = len(FADE)
_BOTH = VELOCITY.stop  # position and velocity are the first states


def faded(
    score: Floats, information: Floats, innovation: Floats, scatter: Floats, sensitivity: Floats, elapsed_s: Floats
) -> tuple[Floats, Floats]:
    """Score (n, 2, 3) and information (n, 2, 3, 3) after innovations (n, k) of covariance (n, k, k).

    Times (n,) after the last ones; `sensitivity` (n, k, d) or (1, k, d).
    """
    by_part = sensitivity[:, :, :_BOTH].reshape(*sensitivity.shape[:2], _PARTS, 3).transpose(0, 2, 1, 3)
    weighed = by_part.swapaxes(-1, -2) @ np.linalg.inv(scatter)[:, None]
    left = (FADE ** elapsed_s[:, None])[..., None]
    fresh = (weighed @ innovation[:, None, :, None])[..., 0]
    return left * score + fresh, (left * left)[..., None] * information + weighed @ by_part


def lag(score: Floats, information: Floats, covariance: Floats) -> Floats | None:
    """What lags add to covariances (n, d, d): of rank one a part, 0 where the mean is no larger than noise's; None: all 0."""
    least = np.maximum(1e-9 * np.diagonal(information, axis1=2, axis2=3).sum(axis=-1), 1e-30)
    lifted = information + least[..., None, None] * _UNIT
    off = np.linalg.inv(lifted) @ score[..., None]
    excess = (score[..., None, :] @ off)[..., 0, 0]
    if not (excess > USUAL).any():
        return None
    share = np.maximum(0.0, 1.0 - USUAL / np.maximum(excess, 1e-9))
    by_place, by_speed = np.moveaxis(off[..., 0] * np.sqrt(share)[..., None], 1, 0)
    whole = np.zeros((len(score), _PARTS, covariance.shape[2]))
    of_place = covariance[:, :, POSITION] @ np.linalg.inv(covariance[:, POSITION, POSITION])
    whole[:, 0] = (of_place @ by_place[:, :, None])[:, :, 0]
    whole[:, 1, VELOCITY] = by_speed
    return np.asarray(whole.transpose(0, 2, 1) @ whole.copy())  # of a copy: see `matching.spread`


_UNIT = np.eye(3)
