"""A slice of a radar's time: its plots without numbers, worked by track splitting after those before it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gateway.align import SECOND, Plot
from gateway.estimators.track_splitting import Bank, Plots, Splitting, scan
from gateway.settings import Options, RadarSite
from gateway.track.density import Density
from gateway.track.sight import RadarSight

GREATEST_LEVEL_MPS, GREATEST_CLIMB_MPS = 300.0, 40.0
FORGOTTEN_S, FORGOTTEN_SCANS = 10.0, 5.0  # of silence of a whole radar, whichever is longer
SURE = 0.5  # a plot is told of a family that has it with more than this weight
SURE_SIGMAS = 4.5  # of a speed: three in a million, because dozens of birds are asked after every scan
CONFIRM_AT = 0.9999


@dataclass(frozen=True, slots=True, eq=False)
class Slice:
    """One slice of a radar's time: its plots in order, and all that was known after it."""

    index: int
    plots: tuple[Plot, ...]
    bank: Bank
    density: Density
    told: Mapping[int, int]  # serial of a plot -> the family that it was told of in this slice
    crowded: bool


def forgotten_s(period_s: float) -> float:
    """How long a radar may be silent until what was followed in its plots is forgotten."""
    return max(FORGOTTEN_S, FORGOTTEN_SCANS * period_s)


def order_of(plot: Plot) -> tuple[float, ...]:
    """By what was measured, so that it does not matter in which order plots came; nothing sorts after NaN, so that is -1."""
    return (plot.at, *(-1.0 if math.isnan(part) else part for part in plot.polar), plot.serial)


def worked_slice(
    index: int,
    plots: Sequence[Plot],
    bank: Bank,
    density: Density,
    told: Mapping[int, int],
    period_s: float,
    site: RadarSite,
    options: Options,
) -> Slice:
    """A slice worked after what was known before it, `bank` and `density`; `told`: what was, of the slices before."""
    at = plots[-1].at
    share = min((at - bank.at) / SECOND / period_s, 1.0) if density.scans else 1.0
    if (at - bank.at) / SECOND > forgotten_s(period_s):
        bank = Bank.empty(at, 3)  # nothing holds over such a time
    value = np.array([plot.polar for plot in plots]).T
    variance = np.array([plot.sigma for plot in plots]).T ** 2
    if not density.scans:  # nothing is known yet: this piece itself tells how dense it is here
        density = density.after(value, np.ones(len(plots)), share)
    clutter, newborn = density.of(value)
    serial = np.array([plot.serial for plot in plots], dtype=np.int64)
    seen = Plots(value, variance, clutter, newborn, np.array([plot.at for plot in plots], dtype=np.int64), serial)
    looked = dict(zip(bank.number.tolist(), bank.looks.tolist(), strict=True))
    was = set(bank.number[bank.confirmed].tolist())
    bank, found = scan(bank, seen, at, RadarSight(), _splitting(density, site, options), period_s)
    bank = _flying(bank, was, site.slowest_mps)
    best = bank.best
    now = np.flatnonzero(bank.confirmed & (bank.weight[best] > SURE))
    fresh: dict[int, int] = {}
    hits = looks = 0
    for family in now.tolist():
        name, path = int(bank.number[family]), bank.path[:, best[family]].tolist()
        if name in was:
            if int(bank.looks[family]) == looked[name]:
                continue
            looks += int(bank.looks[family]) - looked[name]
            hits += path[0] > 0
            path = path[:1]
        fresh |= {one: name for one in path if one and one not in told}
    density = density.after(value, found.unexplained, share).detecting(hits, looks)
    return Slice(index, tuple(plots), bank, density, fresh, found.left_out > 0)


def _splitting(density: Density, site: RadarSite, options: Options) -> Splitting:
    level = options.acceleration_sigma_mps2**2 * options.acceleration_time_s
    upright = options.vertical_acceleration_sigma_mps2**2 * options.acceleration_time_s
    speeds = GREATEST_LEVEL_MPS, GREATEST_LEVEL_MPS, GREATEST_CLIMB_MPS
    return Splitting(
        (level, level, upright),
        speeds,
        density.detection,
        confirm_at=CONFIRM_AT,
        budget=site.hypotheses_at_most,
    )


def _flying(bank: Bank, was: set[int], slowest_mps: float) -> Bank:
    """The bank where only what was confirmed before, or surely flies faster than the slowest aircraft, is confirmed.

    What moves slower with the wind is there and is followed, so that its plots begin nothing else: birds, rain's edges.
    """
    new = np.flatnonzero(bank.confirmed & ~np.isin(bank.number, np.array(sorted(was), dtype=np.int64)))
    if not len(new) or slowest_mps <= 0.0:
        return bank
    row = bank.best[new]
    velocity = bank.mean[3:, row]
    speed = np.sqrt((velocity * velocity).sum(axis=0))
    along = velocity / np.maximum(speed, 1e-9)
    variance = np.einsum("an,abn,bn->n", along, bank.covariance[3:, 3:, row], along)
    sure = speed - SURE_SIGMAS * np.sqrt(variance) > slowest_mps
    confirmed = bank.confirmed.copy()
    confirmed[new[~sure]] = False
    return replace(bank, confirmed=confirmed)
