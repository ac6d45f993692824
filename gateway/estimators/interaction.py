"""Several linear models of many tracks' motion at once, as they mix, move, are corrected and weighed: states of any size.

Tracks are the last axis of every array and models the one before it: states (d, m, n), covariances (d, d, m, n), weights
(m, n). So each operation runs along the tracks, a thousand of them for hardly more than one, and none adds up over them:
the bits of one track do not depend on how many come along.

Source: 000 2.1.2 eq 5 to 10, 14, 15; the filter of Blom and Bar-Shalom.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Column = tuple[int, int, int]  # which one, and from and to which row


@dataclass(frozen=True, slots=True)
class Models:
    """n tracks in m models of d states: weight (m, n), which sums to 1, mean (d, m, n), covariance (d, d, m, n)."""

    weight: Floats
    mean: Floats
    covariance: Floats


def mixed(models: Models, chance: Floats) -> Models:
    """The models after some may have changed into others: chance (m, m, n) or (m, m, 1) of j after i. Source: eq 5, 6."""
    joint = models.weight[:, None] * chance
    weight = _total(joint)
    return Models(weight, *matched(joint / weight, models.mean, models.covariance))


def combined(models: Models) -> tuple[Floats, Floats]:
    """Mean (d, n) and covariance (d, d, n) of all models together. Source: eq 14, 15."""
    mean, covariance = matched(models.weight[:, None], models.mean, models.covariance)
    return mean[:, 0], covariance[:, :, 0]


def matched(share: Floats, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Means (d, j, n) and covariances (d, d, j, n) of the Gaussians that match m ones in shares (m, j, n)."""
    middle = _total([part * one[:, None] for part, one in zip(share, mean.swapaxes(0, 1), strict=True)])
    spread = None
    for model, part in enumerate(share):
        off = mean[:, model, None] - middle
        one = (part * off)[:, None] * off
        one += part * covariance[:, :, model, None]
        spread = one if spread is None else np.add(spread, one, out=spread)
    assert spread is not None
    return middle, spread


def moved(models: Models, change: Floats, noise: Floats, columns: Sequence[Column]) -> Models:
    """The models a while later: the transition less the identity, and noise, (d, d, m, n), or 1 for m or n: all alike.

    `columns`: which columns of the change are not 0, and in which rows.
    """
    mean = _carried(models.mean[:, None], change, columns)[:, 0]
    half = _carried(models.covariance, change, columns)
    covariance = _carried(half.swapaxes(0, 1), change, columns)
    covariance += noise
    covariance = 0.5 * (covariance + covariance.swapaxes(0, 1))
    return Models(models.weight, mean, covariance)


def _carried(rows: Floats, change: Floats, columns: Sequence[Column]) -> Floats:
    """The transition times arrays (d, k, m, n)."""
    found = rows.copy()
    for column, first, last in columns:
        found[first:last] += change[first:last, column, None] * rows[column]
    return found


def corrected(
    models: Models, measured: Floats, variance: Floats, seen: slice, sensitivity: Floats | None = None
) -> Models:
    """The models after a measurement (k, n) of each track, and their weights after how well each foretold it.

    It depends on the states `seen`, c of them: `sensitivity` (k, c, m, n) by these, with 1 for m or n where all are alike;
    None: it is of these states themselves. `variance` (k, n) or (k, 1) of independent noise.

    One component after the other: their noises are independent, so that this is the same and nothing need be inverted.
    Source: eq 8 to 10.
    """
    mean, covariance, log = models.mean, models.covariance, np.log(models.weight)
    for k in range(len(measured)):
        if sensitivity is None:
            place = seen.start + k
            cross, expected = covariance[:, place], mean[place]
            s = cross[place] + variance[k]
        else:
            by = sensitivity[k]
            cross = _product(covariance[:, seen], by[:, None])[:, 0]
            expected = _total(by * mean[seen])
            s = _total(by * cross[seen]) + variance[k]
        root = np.sqrt(s)
        cross, off = cross / root, (measured[k] - expected) / root
        mean = mean + cross * off
        covariance = covariance - cross[:, None] * cross
        log -= 0.5 * off * off + np.log(root)
    weight = np.exp(log - np.maximum.reduce(log))
    return Models(weight / _total(weight), mean, covariance)


def _product(one: Floats, other: Floats) -> Floats:
    """Matrix products along the first two axes, (i, k, ...) by (k, j, ...)."""
    found: Floats = one[:, 0, None] * other[0]
    for k in range(1, len(other)):
        found += one[:, k, None] * other[k]
    return found


def _total(parts: Sequence[Floats] | Floats) -> Floats:
    """The sum of some arrays, in their order."""
    found: Floats = np.add(parts[0], parts[1]) if len(parts) > 1 else parts[0].copy()
    for part in parts[2:]:
        found += part
    return found
