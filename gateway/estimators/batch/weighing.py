"""What a measurement says of the modes and of the track in all, compiled, for blocks of tracks: `modes.weigh`."""

from __future__ import annotations

import math

import numpy as np

from gateway.estimators.batch.packed import Floats, at, compiled, inverted
from gateway.estimators.lagging import USUAL
from gateway.estimators.modes import LEAST_WEIGHT

_PLACE_USUAL, _SPEED_USUAL = float(USUAL[0]), float(USUAL[1])


@compiled
def scored(
    score: Floats, information: Floats, h: Floats, inverse: Floats, y: Floats, left: Floats, excess: Floats
) -> None:
    """A mode's faded score (3, L) and information (3, 3, L) by the position, in their places, and s' J^-1 s (L,)."""
    lanes = score.shape[-1]
    k = len(y)
    by, lifted, unlifted = np.empty((3, k, lanes)), np.empty((3, 3, lanes)), np.empty((3, 3, lanes))
    least, determinant = np.empty(lanes), np.empty(lanes)
    for i in range(3):
        for a in range(k):
            for lane in range(lanes):
                by[i, a, lane] = h[0, i, lane] * inverse[0, a, lane]
            for c in range(1, k):
                for lane in range(lanes):
                    by[i, a, lane] += h[c, i, lane] * inverse[c, a, lane]
    for i in range(3):
        for lane in range(lanes):
            score[i, lane] *= left[lane]
        for a in range(k):
            for lane in range(lanes):
                score[i, lane] += by[i, a, lane] * y[a, lane]
        for j in range(i + 1):
            for lane in range(lanes):
                information[i, j, lane] *= left[lane] * left[lane]
            for a in range(k):
                for lane in range(lanes):
                    information[i, j, lane] += by[i, a, lane] * h[a, j, lane]
            for lane in range(lanes):
                information[j, i, lane] = information[i, j, lane]
    off = np.empty((3, lanes))
    lifted_square(score, information, lifted, unlifted, least, determinant, off, excess)
    for lane in range(lanes):
        excess[lane] = max(excess[lane], 0.0)


@compiled
def lifted_square(
    score: Floats,
    information: Floats,
    lifted: Floats,
    inverse: Floats,
    least: Floats,
    determinant: Floats,
    off: Floats,
    square: Floats,
) -> None:
    """J^-1 s (3, L) and s' J^-1 s (L,), J lifted a little so that what was never measured adds nothing."""
    lanes = score.shape[-1]
    for lane in range(lanes):
        trace = information[0, 0, lane] + information[1, 1, lane] + information[2, 2, lane]
        least[lane] = max(1e-9 * trace, 1e-30)
    for i in range(3):
        for j in range(3):
            for lane in range(lanes):
                lifted[i, j, lane] = information[i, j, lane] + (least[lane] if i == j else 0.0)
    inverted(lifted, 3, inverse, determinant)
    square[:] = 0.0
    for i in range(3):
        for lane in range(lanes):
            off[i, lane] = (
                inverse[i, 0, lane] * score[0, lane]
                + inverse[i, 1, lane] * score[1, lane]
                + inverse[i, 2, lane] * score[2, lane]
            )
            square[lane] += score[i, lane] * off[i, lane]


@compiled
def weighed(prior: Floats, fit: Floats, determinant: Floats, excess: Floats, share: Floats, weight: Floats) -> None:
    """The weights (m, L) by the likelihoods of what was measured; what lies to one side counts less, by shares (L,).

    Measured by all modes alike: what a likelihood has of the number of its components is the same for all.
    """
    m, lanes = prior.shape
    for lane in range(lanes):
        least, place = fit[0, lane], 0
        for j in range(1, m):
            if fit[j, lane] < least:
                least, place = fit[j, lane], j
        total = 0.0
        for j in range(m):
            likelihood = math.exp(0.5 * (least - fit[j, lane]))
            weight[j, lane] = prior[j, lane] * likelihood * math.sqrt(determinant[place, lane] / determinant[j, lane])
            if excess[j, lane] > 0.0:
                weight[j, lane] *= (1.0 + excess[j, lane]) ** (-0.5 * share[lane])
            total += weight[j, lane]
        whole = 0.0
        for j in range(m):
            weight[j, lane] = max(weight[j, lane] / total, LEAST_WEIGHT)
            whole += weight[j, lane]
        for j in range(m):
            weight[j, lane] /= whole


@compiled
def counts(weight: Floats, shares: Floats, counted: Floats) -> None:
    """How much modes' disagreement counts, (m, L). See `actual_error.counted`."""
    lanes = weight.shape[-1]
    for j in range(len(weight)):
        for lane in range(lanes):
            counted[j, lane] = weight[j, lane] * min(weight[j, lane] / shares[j], 1.0)


@compiled
def told(prior: Floats, y: Floats, counted: Floats, mean: Floats, scatter: Floats) -> None:
    """The modes' innovations as one: mean (k, L), and what they disagree by added to what it scatters by (k, k, L).

    See `mixed_innovation.Told.of`.
    """
    m, k, lanes = y.shape
    off = np.empty((m, k, lanes))
    for a in range(k):
        for lane in range(lanes):
            mean[a, lane] = prior[0, lane] * y[0, a, lane]
        for j in range(1, m):
            for lane in range(lanes):
                mean[a, lane] += prior[j, lane] * y[j, a, lane]
        for j in range(m):
            for lane in range(lanes):
                off[j, a, lane] = y[j, a, lane] - mean[a, lane]
    for a in range(k):
        for e in range(a + 1):
            for j in range(m):
                for lane in range(lanes):
                    scatter[a, e, lane] += counted[j, lane] * off[j, a, lane] * off[j, e, lane]
            for lane in range(lanes):
                scatter[e, a, lane] = scatter[a, e, lane]


@compiled
def lag_followed(score: Floats, information: Floats, h: Floats, mean: Floats, scatter: Floats, fades: Floats) -> None:
    """Scores (2, 3, L) and their information (2, 3, 3, L) of the whole, by position and velocity. See `lagging.faded`."""
    lanes = score.shape[-1]
    k = len(mean)
    inverse, by, determinant = np.empty((k, k, lanes)), np.empty((k, lanes)), np.empty(lanes)
    inverted(scatter, k, inverse, determinant)
    for part in range(2):
        for i in range(3):
            for a in range(k):
                for lane in range(lanes):
                    by[a, lane] = h[0, 3 * part + i, lane] * inverse[0, a, lane]
                for c in range(1, k):
                    for lane in range(lanes):
                        by[a, lane] += h[c, 3 * part + i, lane] * inverse[c, a, lane]
            for lane in range(lanes):
                score[part, i, lane] *= fades[part, lane]
            for a in range(k):
                for lane in range(lanes):
                    score[part, i, lane] += by[a, lane] * mean[a, lane]
            for j in range(3):
                for lane in range(lanes):
                    information[part, i, j, lane] *= fades[part, lane] * fades[part, lane]
                for a in range(k):
                    for lane in range(lanes):
                        information[part, i, j, lane] += by[a, lane] * h[a, 3 * part + j, lane]


@compiled
def lagged(score: Floats, information: Floats, p: Floats, d: int, behind: Floats) -> bool:
    """How far tracks of covariances p (t, L) lag behind: a vector of d states a part, (2, d, L), or False: none does.

    See `lagging.lag`, whose rank-one parts these vectors' squares are.
    """
    lanes = score.shape[-1]
    lifted, inverse, off = np.empty((3, 3, lanes)), np.empty((3, 3, lanes)), np.empty((2, 3, lanes))
    least, determinant, square = np.empty(lanes), np.empty(lanes), np.empty((2, lanes))
    does = False
    for part in range(2):
        lifted_square(score[part], information[part], lifted, inverse, least, determinant, off[part], square[part])
        usual = _PLACE_USUAL if part == 0 else _SPEED_USUAL
        for lane in range(lanes):
            if square[part, lane] > usual:
                does = True
    if not does:
        return False
    for part in range(2):
        usual = _PLACE_USUAL if part == 0 else _SPEED_USUAL
        for lane in range(lanes):
            share = math.sqrt(max(0.0, 1.0 - usual / max(square[part, lane], 1e-9)))
            for i in range(3):
                off[part, i, lane] *= share
    for i in range(3):
        for j in range(3):
            for lane in range(lanes):
                lifted[i, j, lane] = p[at(i, j), lane]
    inverted(lifted, 3, inverse, determinant)
    behind[:] = 0.0
    by_place = np.empty((3, lanes))
    for i in range(3):
        for lane in range(lanes):
            by_place[i, lane] = (
                inverse[i, 0, lane] * off[0, 0, lane]
                + inverse[i, 1, lane] * off[0, 1, lane]
                + inverse[i, 2, lane] * off[0, 2, lane]
            )
            behind[1, 3 + i, lane] = off[1, i, lane]
    for i in range(d):
        for lane in range(lanes):
            behind[0, i, lane] = (
                p[at(i, 0), lane] * by_place[0, lane]
                + p[at(i, 1), lane] * by_place[1, lane]
                + p[at(i, 2), lane] * by_place[2, lane]
            )
    return True
