"""One Gaussian for several: that of the same mean and covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def matched(share: Floats, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Means (n, j, d) and covariances (n, j, d, d) of the Gaussians that match m ones in shares (n, m, j)."""
    middle, apart = spread(share, mean)
    n, m, j = share.shape
    size = mean.shape[-1]
    within = share.transpose(0, 2, 1) @ covariance.reshape(n, m, size * size)
    apart += within.reshape(n, j, size, size)
    return middle, apart


def spread(share: Floats, mean: Floats) -> tuple[Floats, Floats]:
    """Means (n, j, d) of m ones in shares (n, m, j), and how they lie about these, (n, j, d, d)."""
    across = share.transpose(0, 2, 1)
    middle = across @ mean
    off = (mean[:, None] - middle[:, :, None]) * np.sqrt(across)[..., None]
    # Of a copy: a matrix times its own transpose is known for what it is, and takes several times as long at this size.
    return middle, off.swapaxes(-1, -2) @ off.copy()
