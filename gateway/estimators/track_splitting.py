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

from gateway.estimators.track_splitting_bank import Bank, begun, bounded, distinct, merged, rank
from gateway.estimators.track_splitting_gates import near
from gateway.estimators.track_splitting_plots import Sight, corrected, moved
from gateway.estimators.track_splitting_shares import shared

__all__ = ["Bank", "Plots", "Scan", "Splitting", "scan"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECOND = 1e9
IN_GATE = 0.999
GATE = np.array([0.0, 10.828, 13.816, 16.266])  # chi-square of that, by measured components
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
    least_weight: float = 0.1  # of a hypothesis within its family
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


@dataclass(frozen=True, slots=True)
class Scan:
    """What came of a scan: how much of each plot (m,) no track explains, and what the budget left out."""

    unexplained: Floats
    left_out: int  # hypotheses


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Hypotheses and plots within their gates, in this order: the states after it and the plots' likelihoods (p,)."""

    row: Ints
    plot: Ints
    mean: Floats
    covariance: Floats
    likelihood: Floats  # detected there, against clutter there


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
    family that has a plot in it and was not looked at for half of that, or that was not for one and a half.
    """
    mean, covariance = moved(bank.mean, bank.covariance, (at - bank.at) / SECOND, model.acceleration_density)
    families = len(bank.number)
    since_s = (at - bank.looked) / SECOND
    may = np.ones(families, np.bool_) if period_s is None else since_s >= 0.5 * period_s
    pairs = _paired(mean, covariance, plots, at, sight, np.where(may, model.detection, 0.0)[bank.family])
    looked, looked_at = may, np.full(families, at)
    if period_s is not None:
        with_plots = np.zeros(families, np.bool_)
        with_plots[bank.family[pairs.row]] = True
        overdue = since_s >= 1.5 * period_s
        looked = with_plots | overdue
        missed_at = bank.looked + np.where(overdue, round(period_s * SECOND), 0)
        looked_at = np.where(with_plots, at, missed_at)
    weighed = _weighed(bank, pairs, np.where(looked, model.detection, 0.0), len(plots), model)
    grown = _split(bank, mean, covariance, pairs, weighed, plots.serial, at, model, looked, looked_at)
    if weighed.contested:
        grown = distinct(grown)
    grown, left_out = bounded(_with_new(grown, plots, weighed.unexplained, at, sight, model), model.budget)
    return grown, Scan(weighed.unexplained, left_out)


def _paired(mean: Floats, covariance: Floats, plots: Plots, at: int, sight: Sight, detection: Floats) -> _Pairs:
    """Every hypothesis with every plot in its gate."""
    axes = len(mean) // 2
    expected, slope = sight.measured(mean[:axes])
    gate = GATE[len(expected)]
    reach = np.sqrt(gate * np.einsum("kan,abn,kbn->kn", slope, covariance[:axes, :axes], slope))
    lead_s = (plots.at - at) / SECOND
    late = bool(lead_s.any())
    if late:
        furthest_s = float(np.abs(lead_s).max())
        rates = np.einsum("kan,abn,kbn->kn", slope, covariance[axes:, axes:], slope)
        reach += furthest_s * (np.abs(np.einsum("kan,an->kn", slope, mean[axes:])) + np.sqrt(gate * rates))
    row, plot = near(expected, reach, plots.value, np.sqrt(gate * plots.variance), sight.turn)
    off = sight.off(plots.value[:, plot], expected[:, row])
    slope = slope if slope.shape[2] == 1 else slope[:, :, row]
    each_mean, each_covariance, distance, log_density = corrected(
        mean[:, row], covariance[:, :, row], off, plots.variance[:, plot], slope, lead_s[plot] if late else None
    )
    inside = (distance <= GATE[len(expected) - np.isnan(off).sum(axis=0)]) & (detection[row] > 0.0)
    if not inside.all():
        row, plot, log_density = row[inside], plot[inside], log_density[inside]
        each_mean, each_covariance = each_mean[:, inside], each_covariance[:, :, inside]
    likelihood = detection[row] * np.exp(log_density) / plots.clutter[plot]
    return _Pairs(row, plot, each_mean, each_covariance, likelihood)


def _weighed(bank: Bank, pairs: _Pairs, seen: Floats, plots: int, model: Splitting) -> _Weighed:
    """What the scan says of families and hypotheses. Source: 002-6 eq 6 to 8; their beta_j is what `shared` gives."""
    families = len(seen)
    of = bank.family[pairs.row]
    evidence = bank.weight[pairs.row] * pairs.likelihood
    key: Ints = of * max(plots, 1) + pairs.plot
    edge: NDArray[np.intp] | None = None
    by_edge = evidence
    if len(bank) != families:  # several hypotheses of a family may have one plot
        key, edge = np.unique(key, return_inverse=True)
        by_edge = np.asarray(np.bincount(edge, evidence, minlength=len(key)))
    family: Ints = key // max(plots, 1)
    plot: Ints = key % max(plots, 1)
    before = model.survival * bank.existence
    missed = before * (1.0 - IN_GATE * seen)
    none = 1.0 - before + missed
    chance, nothing, unexplained, contested = shared(family, plot, before[family] * by_edge, none, plots)
    unseen = nothing * missed / none
    existence = np.maximum(unseen + np.bincount(family, chance, minlength=families), TINY)
    stays = bank.weight * (unseen / existence)[bank.family]
    share = chance / np.maximum(by_edge, TINY)
    splits = evidence * (share if edge is None else share[edge]) / existence[of]
    return _Weighed(existence, stays, splits, unexplained, contested)


def _split(
    bank: Bank,
    mean: Floats,
    covariance: Floats,
    pairs: _Pairs,
    weighed: _Weighed,
    serial: Ints,
    at: int,
    model: Splitting,
    looked: Bools,
    looked_at: Ints,
) -> Bank:
    """The children that are kept: the likeliest of each family that lives on, in order of family and of weight."""
    parents = len(weighed.stays)
    weight = np.concatenate([weighed.stays, weighed.splits])
    family = np.concatenate([bank.family, bank.family[pairs.row]])
    existence = weighed.existence
    lives = existence >= np.where(bank.confirmed, model.end_below, model.drop_below * bank.first)
    some = np.flatnonzero((weight >= model.least_weight) & lives[family])
    some = some[np.lexsort((-weight[some], family[some]))]
    place = rank(family[some])
    if len(place) and place.max() >= model.hypotheses:
        some = some[place < model.hypotheses]
    child = np.flatnonzero(some >= parents)
    pair = some[child] - parents
    parent = some.copy()
    parent[child] = pairs.row[pair]
    mean, covariance = mean[:, parent], covariance[:, :, parent]
    mean[:, child], covariance[:, :, child] = pairs.mean[:, pair], pairs.covariance[:, :, pair]
    newest = np.zeros((1, len(some)), np.int64)
    newest[0, child] = serial[pairs.plot[pair]]
    path = np.concatenate([newest, bank.path[:-1, parent]])
    if not looked.all():
        path = np.where(looked[family[some]], path, bank.path[:, parent])
    grown = Bank(
        at,
        mean,
        covariance,
        weight[some],
        family[some],
        path,
        existence,
        bank.first,
        bank.number,
        bank.looks + looked,
        bank.confirmed | (existence >= model.confirm_at),
        looked_at,
    )
    return merged(grown)


def _with_new(bank: Bank, plots: Plots, unexplained: Floats, at: int, sight: Sight, model: Splitting) -> Bank:
    """The same with a family for every plot that tells a place and that no track explains."""
    new = np.flatnonzero(unexplained >= NEW_AT)
    whole, position, scatter = sight.placed(plots.value[:, new], plots.variance[:, new])
    new = new if whole.all() else new[whole]
    axes, rate = len(position), np.arange(len(position), 2 * len(position))
    mean = np.concatenate([position, np.zeros_like(position)])
    covariance = np.zeros((2 * axes, 2 * axes, len(new)))
    covariance[:axes, :axes] = scatter
    covariance[rate, rate] = (0.5 * np.array(model.greatest_speed_mps)[:, None]) ** 2
    existence = unexplained[new] * plots.newborn[new] / (plots.newborn[new] + plots.clutter[new])
    return begun(bank, mean, covariance, plots.serial[new], existence, at)
