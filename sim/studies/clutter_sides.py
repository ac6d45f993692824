"""The trackers of `clutter`: track splitting as shipped and as printed, and nearest neighbours, all at the same tuning."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import track_splitting_literal as literal
from gateway.estimators.track_splitting import Bank, Plots, Splitting, scan
from gateway.estimators.track_splitting_gates import near
from gateway.estimators.track_splitting_plots import Plane, corrected, moved

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DENSITY, GREATEST_SPEED_MPS = (1.0, 1.0), (60.0, 60.0)  # m^2/s^3; twice the targets' speed
GATE = 13.816  # chi-square of 0.999 with two components
BEGINS_AFTER, ENDS_AFTER = 7, 3  # scans with plots in a row, scans without: what gives it the least GOSPA in this case


@dataclass(frozen=True, slots=True)
class Seen:
    """What a tracker tells after a scan: positions (2, e) of its tracks, their numbers and likelihoods (e,), and its size."""

    position: Floats
    number: Ints
    likelihood: Floats
    hypotheses: int  # of the tracks that are told
    tracks: int  # all that are held
    spent_s: float


Tracker = Callable[[Plots, int], Seen]


def shipped(model: Splitting = Splitting(DENSITY, GREATEST_SPEED_MPS), bank: Bank | None = None) -> Tracker:
    """The default: `gateway.estimators.track_splitting`. It tells its confirmed families, by the mean of their hypotheses.

    `bank`: what is known beforehand, None = nothing.
    """
    known = Bank.empty(0, 2) if bank is None else bank

    def after(plots: Plots, at: int) -> Seen:
        nonlocal known
        began = time.perf_counter()
        known, _ = scan(known, plots, at, Plane(), model)
        spent_s = time.perf_counter() - began
        told = known.confirmed
        hypotheses = int(told[known.family].sum())
        return Seen(known.position[:, told], known.number[told], known.existence[told], hypotheses, len(known), spent_s)

    return after


def printed(model: literal.Printed = literal.Printed(DENSITY, GREATEST_SPEED_MPS), told: int | None = 2) -> Tracker:
    """The paper's own: `gateway.estimators.track_splitting_literal`. It tells its two greatest, as the paper does; None = all."""
    tracks: literal.Tracks | None = None

    def after(plots: Plots, at: int) -> Seen:
        nonlocal tracks
        began = time.perf_counter()
        if tracks is None:
            tracks = literal.begin(plots, at, Plane(), model)
        else:
            tracks = literal.scan(tracks, plots, at, Plane(), model)
        spent_s = time.perf_counter() - began
        held = len(tracks.score)
        some = np.arange(held) if told is None else tracks.greatest(told)
        return Seen(tracks.mean[:2, some], np.arange(len(some)), tracks.likelihood[some], held, held, spent_s)

    return after


@dataclass(frozen=True, slots=True)
class _Nearest:
    """Tracks of nearest neighbours: states, how many scans with plots, and how many without since the last."""

    mean: Floats
    covariance: Floats
    number: Ints
    hits: Ints
    misses: Ints


def nearest() -> Tracker:
    """Global nearest neighbours with a gate, the same filter, seven plots in a row to begin and three misses to end."""
    known = _Nearest(np.zeros((4, 0)), np.zeros((4, 4, 0)), *(np.zeros(0, np.int64) for _ in range(3)))
    last, numbers = 0, 0

    def after(plots: Plots, at: int) -> Seen:
        nonlocal known, last, numbers
        began = time.perf_counter()
        known, fresh = _assigned(known, plots, (at - last) / 1e9)
        last = at
        stays = (known.misses < ENDS_AFTER) & ((known.hits >= BEGINS_AFTER) | (known.misses == 0))
        known = _begun(known, stays, plots.value[:, fresh], plots.variance[:, fresh], numbers)
        numbers += int(fresh.sum())
        spent_s = time.perf_counter() - began
        told = known.hits >= BEGINS_AFTER
        sure = np.ones(int(told.sum()))
        return Seen(known.mean[:2, told], known.number[told], sure, len(sure), len(told), spent_s)

    return after


def _assigned(known: _Nearest, plots: Plots, elapsed_s: float) -> tuple[_Nearest, NDArray[np.bool_]]:
    """Tracks with the plots that lie nearest to them in all, and the plots (m,) that no track has."""
    from scipy.optimize import linear_sum_assignment

    mean, covariance = moved(known.mean, known.covariance, elapsed_s, DENSITY)
    reach = GATE * covariance[[0, 1], [0, 1]]
    row, plot = near(mean[:2], reach, plots.value, GATE * plots.variance)
    off = plots.value[:, plot] - mean[:2, row]
    each_mean, each_covariance, distance, density = corrected(
        mean[:, row], covariance[:, :, row], off, plots.variance[:, plot], None
    )
    inside = np.flatnonzero(distance <= GATE)
    cost = np.full((len(known.number), len(plots)), 1e3)
    cost[row[inside], plot[inside]] = -np.log(density[inside]) - 30.0
    track, taken = linear_sum_assignment(cost)
    good = cost[track, taken] < 1e3
    track, taken = track[good], taken[good]
    pair = np.full(cost.shape, -1, np.int64)
    pair[row[inside], plot[inside]] = inside
    chosen = pair[track, taken]
    mean[:, track], covariance[:, :, track] = each_mean[:, chosen], each_covariance[:, :, chosen]
    hits, misses = known.hits.copy(), known.misses + 1
    hits[track] += 1
    misses[track] = 0
    fresh = np.ones(len(plots), np.bool_)
    fresh[taken] = False
    return _Nearest(mean, covariance, known.number, hits, misses), fresh


def _begun(known: _Nearest, stays: NDArray[np.bool_], value: Floats, variance: Floats, numbers: int) -> _Nearest:
    """The tracks that stay, and a new one for each plot that no track has."""
    count = value.shape[1]
    covariance = np.zeros((4, 4, count))
    covariance[[0, 1], [0, 1]] = variance
    covariance[[2, 3], [2, 3]] = (0.5 * GREATEST_SPEED_MPS[0]) ** 2
    return _Nearest(
        np.concatenate([known.mean[:, stays], np.concatenate([value, np.zeros_like(value)])], axis=1),
        np.concatenate([known.covariance[:, :, stays], covariance], axis=2),
        np.concatenate([known.number[stays], np.arange(numbers, numbers + count)]),
        np.concatenate([known.hits[stays], np.ones(count, np.int64)]),
        np.concatenate([known.misses[stays], np.zeros(count, np.int64)]),
    )


SIDES: dict[str, Callable[[], Tracker]] = {"default": shipped, "literal": printed, "nearest neighbour": nearest}
