"""Track splitting with track likelihood: bare plots become tracks, and what is not a target dies of its likelihood.

A track is a family of hypotheses about one thing's past: one for each plot that lay in its gates, and one for none. The
hypotheses' weights add up to 1; that there is a target at all is the family's likelihood. Every plot that no track explains
begins a family, at every scan; a family is confirmed, and ends, by its likelihood alone.

Source: 002-6. Deviation: the likelihood belongs to the family and not to each hypothesis, as in integrated track splitting
(Musicki, Evans 2009), and families that reach for the same plot share it (`track_splitting_shares`). The paper's own method is
`track_splitting_literal`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.track_splitting_bank import (
    Bank,
    begun,
    bounded,
    carried,
    distinct,
    likeliest,
    merged,
    without_plots,
)
from gateway.estimators.track_splitting_gates import near
from gateway.estimators.track_splitting_plots import Sight, along, corrected, spread
from gateway.estimators.track_splitting_shares import shared
from gateway.frozen import made_swiftly

__all__ = ["Bank", "Plots", "Scan", "Splitting", "scan"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECOND = 1e9
IN_GATE = 0.999
GATES = (0.0, 10.828, 13.816, 16.266)  # chi-square of that, by measured components
GATE = np.array(GATES)
NEW_AT = 0.25  # a plot that is explained by less than the rest of this begins a track
TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Splitting:
    """What is assumed of targets and sensor, and when tracks begin and end; the budget bounds the time of a scan."""

    acceleration_density: tuple[float, ...]  # m^2/s^3, for each axis
    greatest_speed_mps: tuple[float, ...]  # along each axis
    detection: float = 0.9  # of a target, in each look
    survival: float = 0.999  # from look to look
    confirm_at: float = 0.999
    end_below: float = 0.05  # a confirmed track
    drop_below: float = 0.3  # one that is not, in parts of what it began with
    least_weight: float = 0.05  # of a hypothesis within its family
    hypotheses: int = 5  # of a family
    budget: int = 4000  # of all hypotheses


@dataclass(frozen=True, slots=True)
class Plots:
    """The m plots of one look: values and variances (k, m), NaN = not measured, and what else may have been seen there.

    `clutter` and `newborn` (m,): how many clutter plots, and how many targets that were not there before, are expected of a look
    in a unit of the measured components' volume. Their ratio is how likely a plot that nothing explains is a target.
    """

    value: Floats
    variance: Floats
    clutter: Floats
    newborn: Floats
    at: Ints  # (m,) ns
    serial: Ints  # (m,) how the caller names them, from 1

    def __len__(self) -> int:
        """How many there are."""
        return len(self.at)

    @property
    def missing(self) -> Bools | None:
        """What was not measured (k, m); None: everything was."""
        missing = np.isnan(self.value)
        return missing if missing.any() else None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Scan:
    """What came of a scan: how much of each plot (m,) no track explains, and what the budget left out."""

    unexplained: Floats
    left_out: int  # hypotheses


@made_swiftly
@dataclass(frozen=True, slots=True)
class _Pairs:
    """The p pairs of hypothesis and plot within its gate, in this order; and q states after plots, of which each has one."""

    row: Ints
    family: Ints  # the hypothesis's
    plot: Ints
    likelihood: Floats  # detected there, against clutter there
    state: Ints  # of q
    mean: Floats  # (2A, q)
    covariance: Floats  # (2A, 2A, q)


@made_swiftly
@dataclass(frozen=True, slots=True)
class _Looked:
    """Which families (f,) a look told of, True = all; how many they were missed in before; and since when the next is due."""

    told: Bools | bool
    missed: Ints | None  # None = none in any
    at: Ints  # ns


@made_swiftly
@dataclass(frozen=True, slots=True)
class _Weighed:
    """How likely all is after a scan: families (f,), hypotheses without a plot (n,) and with one (p,)."""

    existence: Floats
    stays: Floats
    splits: Floats
    unexplained: Floats  # (m,)
    contested: bool  # a plot lies with two families


def scan(
    bank: Bank, plots: Plots, at: int, sight: Sight, model: Splitting, period_s: float | None = None
) -> tuple[Bank, Scan]:
    """The bank after one look at an instant (ns). What it costs follows the number of pairs of hypothesis and plot.

    Plots need not be of that very instant. `period_s`: what comes is a piece of a scan that takes so long. Then it tells of a
    family that has a plot in it and was not looked at for half of that, or that was not for one and a half. Of a time without
    any piece only one scan is thought to have been.
    """
    silent = 0 if period_s is None else max(at - bank.at - round(period_s * SECOND), 0)
    bank = carried(bank, at, model.acceleration_density, silent)
    may = None if period_s is None else at - bank.looked >= 0.5 * period_s * SECOND
    pairs = _paired(bank, plots, sight, model.detection, may)
    looked = _looked(bank, pairs, period_s)
    weighed = _weighed(bank, pairs, looked, len(plots), model)
    grown = _split(bank, pairs, weighed, looked, plots.serial, model)
    if weighed.contested:
        grown = distinct(grown)
    grown, left_out = bounded(_with_new(grown, plots, weighed.unexplained, sight, model), model.budget)
    return grown, Scan(weighed.unexplained, left_out)


def _paired(bank: Bank, plots: Plots, sight: Sight, detection: float, may: Bools | None) -> _Pairs:
    """Every hypothesis of the families (f,) that may have a plot, None = all, with every plot in its gate."""
    axes = len(bank.mean) // 2
    expected, slope = sight.measured(bank.mean[:axes])
    gate: Floats | float = GATES[len(expected)]
    reach, widths = gate * spread(slope, bank.covariance[:axes, :axes]), gate * plots.variance
    lead_s = (plots.at - bank.at) / SECOND if (plots.at != bank.at).any() else None
    if lead_s is not None:
        reach, widths = _reaching(bank, slope, reach, widths, float(np.abs(lead_s).max()))
    row, plot = near(expected, reach, plots.value, widths, sight.turn)
    missing = plots.missing
    if missing is not None:
        missing = missing.take(plot, axis=1)
        gate = GATE.take(len(expected) - missing.sum(axis=0))
    mean, covariance, distance, density = corrected(
        bank.mean.take(row, axis=1),
        bank.covariance.take(row, axis=2),
        sight.off(plots.value.take(plot, axis=1), expected.take(row, axis=1)),
        plots.variance.take(plot, axis=1),
        None if slope is None else slope.take(row, axis=2),
        missing,
        None if lead_s is None else lead_s.take(plot),
    )
    family, inside = bank.family.take(row), distance <= gate
    if may is not None:
        inside &= may.take(family)
    state = inside.nonzero()[0]
    if len(state) < len(row):
        row, family, plot, density = row.take(state), family.take(state), plot.take(state), density.take(state)
    return _Pairs(row, family, plot, detection * density / plots.clutter.take(plot), state, mean, covariance)


def _reaching(
    bank: Bank, slope: Floats | None, reach: Floats, widths: Floats, furthest_s: float
) -> tuple[Floats, Floats]:
    """Squared gates of predictions (k, n) and plots (k, m) where plots are of instants up to so far off: wide enough."""
    axes = len(bank.mean) // 2
    rates = GATES[len(reach)] * spread(slope, bank.covariance[axes:, axes:])
    speed = np.stack([np.abs(along(slope, component, bank.mean[axes:])) for component in range(len(reach))])
    reach = (np.sqrt(reach) + furthest_s * (speed + np.sqrt(rates))) ** 2
    return reach, widths + 2.0 * furthest_s * speed.max(axis=1, initial=0.0)[:, None] * np.sqrt(widths)


def _looked(bank: Bank, pairs: _Pairs, period_s: float | None) -> _Looked:
    """A whole scan tells of all; a piece of one of the families that have a plot in it, or were not looked at for too long."""
    families = len(bank.number)
    if period_s is None:
        return _Looked(True, None, np.full(families, bank.at))
    with_plots = np.zeros(families, np.bool_)
    with_plots[pairs.family] = True
    since = (bank.at - bank.looked) / (period_s * SECOND)
    overdue = since >= 1.5
    missed = np.where(with_plots & overdue, np.rint(since).astype(np.int64) - 1, 0)
    missed_at = bank.looked + np.where(overdue, round(period_s * SECOND), 0)
    return _Looked(with_plots | overdue, missed if missed.any() else None, np.where(with_plots, bank.at, missed_at))


def _weighed(bank: Bank, pairs: _Pairs, looked: _Looked, plots: int, model: Splitting) -> _Weighed:
    """What the scan says of families and hypotheses. Source: 002-6 eq 6 to 8; their beta_j is what `shared` gives."""
    families, family, plot = len(bank.number), pairs.family, pairs.plot
    evidence = bank.weight.take(pairs.row) * pairs.likelihood
    edge: Ints | None = None
    by_edge = evidence
    if len(bank) != families:  # several hypotheses of a family may have one plot
        key, edge = np.unique(family * plots + plot, return_inverse=True)
        by_edge = np.asarray(np.bincount(edge, evidence, minlength=len(key)))
        family, plot = np.divmod(key, max(plots, 1))
    before = model.survival * bank.existence
    if looked.missed is not None:
        before *= (1.0 - IN_GATE * model.detection) ** looked.missed
        before /= 1.0 - model.survival * bank.existence + before
    missed = before * (1.0 - IN_GATE * model.detection * looked.told)
    none = 1.0 - before + missed
    chance, nothing, unexplained, contested = shared(family, plot, before.take(family) * by_edge, none, plots)
    unseen = nothing * missed / none
    existence = np.maximum(unseen + np.bincount(family, chance, minlength=families), TINY)
    stays = bank.weight * (unseen / existence).take(bank.family)
    share = chance / np.maximum(by_edge, TINY)
    splits = evidence * (share if edge is None else share.take(edge)) / existence.take(pairs.family)
    return _Weighed(existence, stays, splits, unexplained, contested)


def _split(bank: Bank, pairs: _Pairs, weighed: _Weighed, looked: _Looked, serial: Ints, model: Splitting) -> Bank:
    """The children that are kept: the likeliest of each family that lives on, in order of family and of weight."""
    existence, parents = weighed.existence, len(bank)
    lives = existence >= np.where(bank.confirmed, model.end_below, model.drop_below * bank.first)
    weight = np.concatenate([weighed.stays, weighed.splits])
    family = np.concatenate([bank.family, pairs.family])
    some = likeliest(weight, family, (weight >= model.least_weight) & lives.take(family), model.hypotheses)
    family = family.take(some)
    every = np.arange(parents)
    state = np.concatenate([every, parents + pairs.state]).take(some)
    parent = np.concatenate([every, pairs.row]).take(some)
    newest = np.concatenate([np.zeros(parents, np.int64), serial.take(pairs.plot)]).take(some)
    path = np.concatenate([newest[None], bank.path[:-1].take(parent, axis=1)])
    if looked.missed is not None:
        path = without_plots(path, looked.missed.take(family))
    if not isinstance(looked.told, bool):
        path = np.where(looked.told.take(family), path, bank.path.take(parent, axis=1))
    grown = Bank(
        bank.at,
        np.concatenate([bank.mean, pairs.mean], axis=1).take(state, axis=1),
        np.concatenate([bank.covariance, pairs.covariance], axis=2).take(state, axis=2),
        weight.take(some),
        family,
        path,
        existence,
        bank.first,
        bank.number,
        bank.looks + looked.told + (0 if looked.missed is None else looked.missed),
        bank.confirmed | (existence >= model.confirm_at),
        looked.at,
    )
    return merged(grown)


def _with_new(bank: Bank, plots: Plots, unexplained: Floats, sight: Sight, model: Splitting) -> Bank:
    """The same with a family for every plot that tells a place and that no track explains."""
    new = (unexplained >= NEW_AT).nonzero()[0]
    whole, position, scatter = sight.placed(plots.value.take(new, axis=1), plots.variance.take(new, axis=1))
    new = new if whole is None else new[whole]
    axes, count = position.shape
    mean, covariance = np.zeros((2 * axes, count)), np.zeros((2 * axes, 2 * axes, count))
    mean[:axes], covariance[:axes, :axes] = position, scatter
    for axis, greatest_mps in enumerate(model.greatest_speed_mps, axes):
        covariance[axis, axis] = (0.5 * greatest_mps) ** 2
    newborn = plots.newborn.take(new)
    existence = unexplained.take(new) * newborn / (newborn + plots.clutter.take(new))
    return begun(bank, mean, covariance, plots.serial.take(new), existence)
