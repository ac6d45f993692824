"""The mean of each mode's residuals, by which RMIMM tells a wrong mode from noise: a wrong mode is wrong to one side.

`faded` and `excess` are the default rule's score, `in_metres` what `literal` takes the mean of. Source: 000 2.1.2 eq 11, and
the deviation that `modes` tells of.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import POSITION, Innovation

Floats = NDArray[np.float64]

LEAST_RESIDUAL_M = 1e-3  # `literal` is singular at 0

_AXES = np.arange(3)
_UNIT = np.eye(3)


def faded(score: Floats, information: Floats, told: Innovation, left: Floats) -> tuple[Floats, Floats]:
    """Score (n, m, 3) and information (n, m, 3, 3) after an update of n m rows: h' S^-1 y and h' S^-1 h by the position.

    Added to what is left of the old, shares (n,).
    """
    sensitivity = told.sensitivity[:, :, POSITION]
    by_position = sensitivity.transpose(0, 2, 1) @ told.inverse
    fresh = (by_position @ told.innovation[:, :, None]).reshape(score.shape)
    known = (by_position @ sensitivity).reshape(information.shape)
    old = left[:, None, None]
    return old * score + fresh, (old * old)[..., None] * information + known


def excess(score: Floats, information: Floats) -> Floats:
    """s' J^-1 s, (n, m): chi-square with up to three degrees for a mode that is right; what was never measured adds 0."""
    size = np.maximum(1e-9 * information[..., _AXES, _AXES].sum(axis=-1), 1e-30)
    lifted = information + size[..., None, None] * _UNIT
    return np.maximum((score[..., None, :] @ np.linalg.inv(lifted) @ score[..., :, None])[..., 0, 0], 0.0)


def in_metres(told: Innovation) -> Floats:
    """Innovations as displacements of the position (n m, 3), by least squares."""
    sensitivity = np.broadcast_to(told.sensitivity[:, :, POSITION], (*told.innovation.shape, 3))
    return np.asarray((np.linalg.pinv(sensitivity) @ told.innovation[:, :, None])[:, :, 0])


def mean_size_m(recent: Floats) -> Floats:
    """Norm (n, m) of the mean of the last residuals (n, m, w, 3) in metres, NaN before they are; at least a millimetre."""
    known = ~np.isnan(recent)
    mean = np.where(known, recent, 0.0).sum(axis=2) / np.maximum(known.sum(axis=2), 1)
    return np.asarray(np.maximum(np.sqrt((mean * mean).sum(axis=2)), LEAST_RESIDUAL_M))
