"""Modes that mix, compiled, for blocks of tracks: the first half of `modes.predict`. Source: 000 2.1.2 eq 5, 6."""

from __future__ import annotations

import numpy as np

from gateway.estimators.batch.packed import Floats, at, compiled


@compiled
def mixed_from(
    weight: Floats,
    chance: Floats,
    anew: bool,
    j: int,
    after: Floats,
    off: Floats,
    spread: Floats,
    shares: Floats,
    middle: Floats,
    mixed: Floats,
) -> None:
    """Mode j after mixing: its weight, its mean from the first mode's, its covariance."""
    _shares(weight, chance, j, shares, after)
    if anew:
        _of_two(weight, chance, j, after, off, spread, middle, mixed)
    else:
        summed(shares, off, middle)
        summed(shares, spread, mixed)
        _about_mean(middle, mixed)


@compiled
def put_back(first: Floats, middle: Floats) -> None:
    """A mean that was told from the first mode's."""
    for i in range(len(middle)):
        for lane in range(middle.shape[1]):
            middle[i, lane] += first[i, lane]


@compiled
def apart(mean: Floats, covariance: Floats, off: Floats, spread: Floats) -> None:
    """Means as differences from the first mode's, and the second moments about that."""
    lanes = mean.shape[-1]
    m, d, _ = mean.shape
    for i in range(m):
        for r in range(d):
            for lane in range(lanes):
                off[i, r, lane] = mean[i, r, lane] - mean[0, r, lane]
        for r in range(d):
            for c in range(r + 1):
                for lane in range(lanes):
                    spread[i, at(r, c), lane] = covariance[i, at(r, c), lane] + off[i, r, lane] * off[i, c, lane]


@compiled
def summed(share: Floats, parts: Floats, whole: Floats) -> None:
    """Sums (p, L) of parts (m, p, L) in shares (m, L), two at a time: what takes long is fetching and storing."""
    m, lanes = share.shape
    for p in range(parts.shape[1]):
        for lane in range(lanes):
            whole[p, lane] = share[0, lane] * parts[0, p, lane]
        for i in range(1, m - 1, 2):
            for lane in range(lanes):
                whole[p, lane] += share[i, lane] * parts[i, p, lane] + share[i + 1, lane] * parts[i + 1, p, lane]
        if m % 2 == 0:
            for lane in range(lanes):
                whole[p, lane] += share[m - 1, lane] * parts[m - 1, p, lane]


@compiled
def _shares(weight: Floats, chance: Floats, j: int, shares: Floats, after: Floats) -> None:
    """The shares (m, L) of which mode j is made, and its weight after mixing."""
    m, lanes = weight.shape
    after[:] = 0.0
    for i in range(m):
        for lane in range(lanes):
            shares[i, lane] = weight[i, lane] * chance[i, j, lane]
            after[lane] += shares[i, lane]
    for i in range(m):
        for lane in range(lanes):
            shares[i, lane] /= after[lane]


@compiled
def _of_two(
    weight: Floats, chance: Floats, j: int, after: Floats, off: Floats, spread: Floats, middle: Floats, mixed: Floats
) -> None:
    """The same where who leaves any mode comes to mode j with one chance: mode j is made of what it was, and of all modes.

    Off and spread (m + 1, ..., L) are the modes', and last those of all by their weights.
    """
    m, lanes = weight.shape
    d = len(middle)
    from_all, from_own = np.empty(lanes), np.empty(lanes)
    for lane in range(lanes):
        come = chance[(j + 1) % m, j, lane]
        from_all[lane] = come / after[lane]
        from_own[lane] = weight[j, lane] * (chance[j, j, lane] - come) / after[lane]
    for r in range(d):
        for lane in range(lanes):
            middle[r, lane] = from_all[lane] * off[m, r, lane] + from_own[lane] * off[j, r, lane]
        for c in range(r + 1):
            p = at(r, c)
            for lane in range(lanes):
                mixed[p, lane] = (
                    from_all[lane] * spread[m, p, lane]
                    + from_own[lane] * spread[j, p, lane]
                    - middle[r, lane] * middle[c, lane]
                )


@compiled
def _about_mean(middle: Floats, mixed: Floats) -> None:
    """Second moments (t, L) become covariances."""
    d, lanes = middle.shape
    for r in range(d):
        for c in range(r + 1):
            for lane in range(lanes):
                mixed[at(r, c), lane] -= middle[r, lane] * middle[c, lane]
