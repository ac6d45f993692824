"""What is told of tracks of several modes, compiled, for blocks of tracks: `mixture.combine` and `mixture.stated`."""

from __future__ import annotations

import numpy as np

from gateway.estimators.batch.packed import Floats, at, compiled
from gateway.estimators.batch.weighing import lagged

TOLD = 9  # states


@compiled
def together(
    mean: Floats,
    covariance: Floats,
    weight: Floats,
    by: Floats,
    own: bool,
    error: Floats,
    score: Floats,
    information: Floats,
    mean_told: Floats,
    covariance_told: Floats,
) -> None:
    """Means (n, 9) by the modes' weights, and covariances (n, 9, 9): of the modes themselves, or the error and the lag; with
    the modes' disagreement as it counts `by` (b, m, L).
    """
    lanes = mean.shape[-1]
    blocks, m, _, _ = mean.shape
    n, d = len(mean_told), TOLD
    middle, off, p = np.empty((d, lanes)), np.empty((m, d, lanes)), np.empty((d * (d + 1) // 2, lanes))
    behind = np.empty((2, d, lanes))
    for b in range(blocks):
        for i in range(d):
            middle[i] = 0.0
            for j in range(m):
                for lane in range(lanes):
                    middle[i, lane] += weight[b, j, lane] * (mean[b, j, i, lane] - mean[b, 0, i, lane])
            for lane in range(lanes):
                middle[i, lane] += mean[b, 0, i, lane]
            for j in range(m):
                for lane in range(lanes):
                    off[j, i, lane] = mean[b, j, i, lane] - middle[i, lane]
        for i in range(d):
            for c in range(i + 1):
                for lane in range(lanes):
                    p[at(i, c), lane] = 0.0 if own else error[b, at(i, c), lane]
                for j in range(m):
                    for lane in range(lanes):
                        p[at(i, c), lane] += by[b, j, lane] * off[j, i, lane] * off[j, c, lane]
                if own:
                    for j in range(m):
                        for lane in range(lanes):
                            p[at(i, c), lane] += weight[b, j, lane] * covariance[b, j, at(i, c), lane]
        if not own and lagged(score[b], information[b], p, d, behind):
            for part in range(2):
                for i in range(d):
                    for c in range(i + 1):
                        for lane in range(lanes):
                            p[at(i, c), lane] += behind[part, i, lane] * behind[part, c, lane]
        for lane in range(min(lanes, n - b * lanes)):
            row = b * lanes + lane
            for i in range(d):
                mean_told[row, i] = middle[i, lane]
                for c in range(d):
                    covariance_told[row, i, c] = p[at(i, c), lane]
