"""A measurement for every mode and what it says of the modes, compiled, for blocks of tracks: `modes.update`."""

from __future__ import annotations

import numpy as np

from gateway.estimators.batch.packed import Floats, Ints, at, compiled, inverted, squared
from gateway.estimators.kalman import SURE

SEEN = 9  # states that measurements tell of


@compiled
def corrected(
    mean: Floats,
    covariance: Floats,
    y: Floats,
    h: Floats,
    r: Floats,
    limit: Floats,
    mean_after: Floats,
    covariance_after: Floats,
    s: Floats,
    inverse: Floats,
    gain: Floats,
    noise: Floats,
    normalised: Floats,
    fit: Floats,
    determinant: Floats,
) -> None:
    """All blocks. Means (b, m, d, L), covariances (b, m, t, L), innovations y and their noise r (b, m, k, L), sensitivities
    (b or 1, m or 1, k, 9, L), the squares (b, m, L) beyond which noise is raised. Then what it gives: S and its inverse
    (b, m, k, k, L), gains (b, m, d, k, L), the noise as raised, y' S^-1 y before and after that, and det S (b, m, L).
    """
    lanes = mean.shape[-1]
    blocks, m, d, _ = mean.shape
    k = y.shape[2]
    cross, nearest = np.empty((m, d, k, lanes)), np.empty(lanes, dtype=np.int64)
    for b in range(blocks):
        for j in range(m):
            seen = h[b if len(h) > 1 else 0, j if h.shape[1] > 1 else 0]
            crossed(covariance[b, j], seen, cross[j], d)
            scattered(cross[j], seen, r[b, j], s[b, j])
            inverted(s[b, j], k, inverse[b, j], determinant[b, j])
            squared(inverse[b, j], y[b, j], k, normalised[b, j])
            for lane in range(lanes):
                fit[b, j, lane] = normalised[b, j, lane]
            for a in range(k):
                for lane in range(lanes):
                    noise[b, j, a, lane] = r[b, j, a, lane]
        for lane in range(lanes):
            nearest[lane] = 0
            for j in range(1, m):
                if normalised[b, j, lane] < normalised[b, nearest[lane], lane]:
                    nearest[lane] = j
        if _raised(s[b], normalised[b], nearest, limit[b], noise[b]):
            for j in range(m):
                inverted(s[b, j], k, inverse[b, j], determinant[b, j])
                squared(inverse[b, j], y[b, j], k, fit[b, j])
        for j in range(m):
            _gained(cross[j], inverse[b, j], gain[b, j], d, k)
            _pulled(mean[b, j], gain[b, j], y[b, j], mean_after[b, j])
            _narrowed(covariance[b, j], gain[b, j], cross[j], covariance_after[b, j], d, k)
            seen = h[b if len(h) > 1 else 0, j if h.shape[1] > 1 else 0]
            for lane in range(lanes):
                for a in range(k):
                    if s[b, j, a, a, lane] > SURE * noise[b, j, a, lane]:
                        josephs(covariance[b, j], gain[b, j], seen, noise[b, j], covariance_after[b, j], lane)
                        break


@compiled
def crossed(p: Floats, h: Floats, cross: Floats, d: int) -> None:
    """P H' (d, k, L) of packed P (t, L) and H (k, 9, L)."""
    lanes = p.shape[-1]
    for i in range(d):
        for a in range(len(h)):
            for lane in range(lanes):
                cross[i, a, lane] = 0.0
            for c in range(0, SEEN, 3):  # three at a time: what takes long is fetching and storing
                for lane in range(lanes):
                    cross[i, a, lane] += (
                        p[at(i, c), lane] * h[a, c, lane]
                        + p[at(i, c + 1), lane] * h[a, c + 1, lane]
                        + p[at(i, c + 2), lane] * h[a, c + 2, lane]
                    )


@compiled
def scattered(cross: Floats, h: Floats, r: Floats, s: Floats) -> None:
    """H (P H') + R, (k, k, L)."""
    lanes = cross.shape[-1]
    k = len(h)
    for i in range(k):
        for j in range(i + 1):
            for lane in range(lanes):
                s[i, j, lane] = r[i, lane] if i == j else 0.0
            for c in range(SEEN):
                for lane in range(lanes):
                    s[i, j, lane] += h[i, c, lane] * cross[c, j, lane]
            for lane in range(lanes):
                s[j, i, lane] = s[i, j, lane]


@compiled
def _raised(s: Floats, normalised: Floats, nearest: Ints, limit: Floats, noise: Floats) -> bool:
    """Whether any track lies beyond its limit; S and the noise of its modes have then grown until it is just there."""
    lanes = s.shape[-1]
    m, k = noise.shape[0], noise.shape[1]
    any_is = False
    for lane in range(lanes):
        place = nearest[lane]
        best = normalised[place, lane]
        for j in range(m):
            if best > limit[j, lane]:
                any_is = True
    if not any_is:
        return False
    spread = np.empty(k)
    for lane in range(lanes):
        place = nearest[lane]
        best = normalised[place, lane]
        for a in range(k):
            spread[a] = s[place, a, a, lane]
        for j in range(m):
            if best > limit[j, lane]:
                for a in range(k):
                    growth = (best / limit[j, lane] - 1.0) * spread[a]
                    noise[j, a, lane] += growth
                    s[j, a, a, lane] += growth
    return True


@compiled
def _gained(cross: Floats, inverse: Floats, gain: Floats, d: int, k: int) -> None:
    lanes = cross.shape[-1]
    for i in range(d):
        for a in range(k):
            for lane in range(lanes):
                gain[i, a, lane] = cross[i, 0, lane] * inverse[0, a, lane]
            for c in range(1, k):
                for lane in range(lanes):
                    gain[i, a, lane] += cross[i, c, lane] * inverse[c, a, lane]


@compiled
def _pulled(mean: Floats, gain: Floats, y: Floats, after: Floats) -> None:
    lanes = mean.shape[-1]
    for i in range(len(mean)):
        for lane in range(lanes):
            after[i, lane] = mean[i, lane]
        for a in range(len(y)):
            for lane in range(lanes):
                after[i, lane] += gain[i, a, lane] * y[a, lane]


@compiled
def _narrowed(p: Floats, gain: Floats, cross: Floats, after: Floats, d: int, k: int) -> None:
    """P - K (P H')', packed."""
    lanes = p.shape[-1]
    for i in range(d):
        for j in range(i + 1):
            for lane in range(lanes):
                after[at(i, j), lane] = p[at(i, j), lane] - gain[i, 0, lane] * cross[j, 0, lane]
            for a in range(1, k - 1, 2):
                for lane in range(lanes):
                    after[at(i, j), lane] -= (
                        gain[i, a, lane] * cross[j, a, lane] + gain[i, a + 1, lane] * cross[j, a + 1, lane]
                    )
            if k % 2 == 0:
                for lane in range(lanes):
                    after[at(i, j), lane] -= gain[i, k - 1, lane] * cross[j, k - 1, lane]


@compiled
def josephs(p: Floats, gain: Floats, h: Floats, r: Floats, after: Floats, lane: int) -> None:
    """(I - K H) P (I - K H)' + K R K' of one track."""
    d, k = len(gain), gain.shape[1]
    reduced, half = np.zeros((d, d)), np.zeros((d, d))
    for i in range(d):
        reduced[i, i] = 1.0
        for c in range(SEEN):
            for a in range(k):
                reduced[i, c] -= gain[i, a, lane] * h[a, c, lane]
    for i in range(d):
        for j in range(d):
            for c in range(d):
                half[i, j] += reduced[i, c] * p[at(c, j), lane]
    for i in range(d):
        for j in range(i + 1):
            total = 0.0
            for c in range(d):
                total += half[i, c] * reduced[j, c]
            for a in range(k):
                total += gain[i, a, lane] * r[a, lane] * gain[j, a, lane]
            after[at(i, j), lane] = total
