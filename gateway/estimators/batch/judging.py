"""A block's measurement judged: the modes' weights, the innovations as one, the error that is told; `modes.weigh`, compiled."""

from __future__ import annotations

import numpy as np

from gateway.estimators.actual_error import MOST
from gateway.estimators.batch.correcting import crossed, josephs, scattered
from gateway.estimators.batch.packed import Floats, at, compiled
from gateway.estimators.batch.weighing import counts, lag_followed, lagged, scored, told, weighed
from gateway.estimators.kalman import SURE


@compiled
def judged(
    prior: Floats,
    y: Floats,
    h: Floats,
    inverse: Floats,
    gain: Floats,
    noise: Floats,
    fit: Floats,
    determinant: Floats,
    mean: Floats,
    covariance: Floats,
    shares: Floats,
    by_score: bool,
    left: Floats,
    period: Floats,
    fades: Floats,
    score: Floats,
    information: Floats,
    whole_score: Floats,
    whole_information: Floats,
    error: Floats,
    counted: Floats,
    weight: Floats,
    innovation: Floats,
    scatter: Floats,
    error_after: Floats,
) -> None:
    """All blocks, of what `correcting.corrected` gave. Scores, informations and what counts are changed in their places;
    weights (b, m, L), the innovation (b, k, L) and its scatter (b, k, k, L), and the told error are new.
    """
    lanes = prior.shape[-1]
    blocks, m, d, _ = mean.shape
    k = y.shape[2]
    cross, scattered_by = np.empty((d, k, lanes)), np.empty((k, k, lanes))
    excess, behind = np.zeros((m, lanes)), np.empty((2, d, lanes))
    for b in range(blocks):
        of_block = h[b if len(h) > 1 else 0]
        if by_score:
            for j in range(m):
                seen = of_block[j if h.shape[1] > 1 else 0]
                scored(score[b, j], information[b, j], seen, inverse[b, j], y[b, j], left[b], excess[j])
        weighed(prior[b], fit[b], determinant[b], excess, period[b], weight[b])
        crossed(error[b], of_block[0], cross, d)
        scattered(cross, of_block[0], noise[b, 0], scattered_by)
        for a in range(k):
            for e in range(k):
                for lane in range(lanes):
                    scatter[b, a, e, lane] = scattered_by[a, e, lane]
        told(prior[b], y[b], counted[b], innovation[b], scatter[b])
        lags = lagged(whole_score[b], whole_information[b], error[b], d, behind)  # by what was known before this
        lag_followed(whole_score[b], whole_information[b], of_block[0], innovation[b], scatter[b], fades[b])
        if lags:
            _added(behind, of_block[0], scatter[b], k)
        _erred(error[b], weight[b], gain[b], of_block[0], noise[b, 0], cross, scattered_by, error_after[b])
        _bounded(mean[b], covariance[b], weight[b], error_after[b])
        counts(weight[b], shares, counted[b])


@compiled
def _added(behind: Floats, h: Floats, scatter: Floats, k: int) -> None:
    """What lags add to the scatter of innovations."""
    lanes = behind.shape[-1]
    seen = np.zeros((2, k, lanes))
    for part in range(2):
        for a in range(k):
            for c in range(h.shape[1]):
                for lane in range(lanes):
                    seen[part, a, lane] += h[a, c, lane] * behind[part, c, lane]
        for a in range(k):
            for e in range(k):
                for lane in range(lanes):
                    scatter[a, e, lane] += seen[part, a, lane] * seen[part, e, lane]


@compiled
def _erred(
    error: Floats,
    weight: Floats,
    gain: Floats,
    h: Floats,
    noise: Floats,
    cross: Floats,
    scatter: Floats,
    after: Floats,
) -> None:
    """The told error E (t, L) after gains (m, d, k, L) by their modes' weights, W. See `actual_error.corrected`.

    `cross` is E H', `scatter` H E H' + R. Joseph's form is E - W D' - D W', where D = E H' - W (H E H' + R) / 2; where the
    measurement is so sure that this loses digits, it is Joseph's own.
    """
    lanes = error.shape[-1]
    m, d, k, _ = gain.shape
    whole, half = np.zeros((d, k, lanes)), np.empty((d, k, lanes))
    for i in range(d):
        for a in range(k):
            for j in range(m):
                for lane in range(lanes):
                    whole[i, a, lane] += weight[j, lane] * gain[j, i, a, lane]
        for a in range(k):
            for lane in range(lanes):
                half[i, a, lane] = cross[i, a, lane]
            for e in range(k):
                for lane in range(lanes):
                    half[i, a, lane] -= 0.5 * whole[i, e, lane] * scatter[e, a, lane]
    for i in range(d):
        for j in range(i + 1):
            p = at(i, j)
            for lane in range(lanes):
                after[p, lane] = error[p, lane]
            for a in range(k):
                for lane in range(lanes):
                    after[p, lane] -= whole[i, a, lane] * half[j, a, lane] + half[i, a, lane] * whole[j, a, lane]
    for lane in range(lanes):
        for a in range(k):
            if scatter[a, a, lane] > SURE * noise[a, lane]:
                josephs(error, whole, h, noise, after, lane)
                break


@compiled
def _bounded(mean: Floats, covariance: Floats, weight: Floats, error: Floats) -> None:
    """Told errors (t, L) that are more than twice what the filter reckons with are taken from there."""
    lanes = mean.shape[-1]
    m, d, _ = mean.shape
    middle, beyond = np.empty((d, lanes)), np.zeros(lanes, dtype=np.bool_)
    reckoned = np.empty(lanes)
    any_is = False
    for i in range(d):
        for lane in range(lanes):
            middle[i, lane] = 0.0
            reckoned[lane] = 0.0
        for j in range(m):
            for lane in range(lanes):
                middle[i, lane] += weight[j, lane] * (mean[j, i, lane] - mean[0, i, lane])
        for j in range(m):
            for lane in range(lanes):
                off = mean[j, i, lane] - mean[0, i, lane] - middle[i, lane]
                reckoned[lane] += weight[j, lane] * (covariance[j, at(i, i), lane] + off * off)
        for lane in range(lanes):
            if error[at(i, i), lane] > MOST * reckoned[lane]:
                beyond[lane] = True
                any_is = True
    if not any_is:
        return
    for lane in range(lanes):
        if beyond[lane]:
            for i in range(d):
                for c in range(i + 1):
                    total = 0.0
                    for j in range(m):
                        one = mean[j, i, lane] - mean[0, i, lane] - middle[i, lane]
                        other = mean[j, c, lane] - mean[0, c, lane] - middle[c, lane]
                        total += weight[j, lane] * (covariance[j, at(i, c), lane] + one * other)
                    error[at(i, c), lane] = total
