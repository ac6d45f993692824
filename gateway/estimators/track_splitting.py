"""Track splitting with track likelihood: bare plots become tracks, and what is not a target dies of its likelihood.

A track is a family of hypotheses about one thing's past: one for each plot that lay in its gates, and one for none. The
hypotheses' weights add up to 1; that there is a target at all is the family's likelihood. Every plot that no track explains
begins a family, at every scan; a family is confirmed, and ends, by its likelihood alone.

Source: 002-6. Deviation: the likelihood belongs to the family and not to each hypothesis, as in integrated track splitting
(Musicki, Evans 2009), and families that reach for the same plot share it (`track_splitting_shares`). The paper's own method is
`track_splitting_literal`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    greatest_speed_mps: float
    detection: float = 0.9  # of a target, in each look
    newborn: float = 0.02  # likelihood of a track from one plot that nothing explains
    survival: float = 0.999  # from scan to scan
    confirm_at: float = 0.999
    end_below: float = 0.05  # a confirmed track
    drop_below: float = 0.01  # one that is not
    least_weight: float = 0.05  # of a hypothesis within its family
    hypotheses: int = 5  # of a family
    budget: int = 4000  # of all hypotheses


@dataclass(frozen=True, slots=True)
class Plots:
    """The m plots of one look: values and variances (k, m), NaN = not measured, and how dense clutter is there."""

    value: Floats
    variance: Floats
    clutter: Floats  # (m,) clutter plots of a look in a unit of the measured components' volume
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


def scan(
    bank: Bank, plots: Plots, at: int, sight: Sight, model: Splitting, looked: Bools | None = None
) -> tuple[Bank, Scan]:
    """The bank after one look at an instant (ns). `looked` (f,): the families that it could have seen, None = all.

    Plots need not be of that very instant. What a scan costs follows the number of pairs of hypothesis and plot.
    """
    mean, covariance = moved(bank.mean, bank.covariance, (at - bank.at) / SECOND, np.array(model.acceleration_density))
    seen = np.full(len(bank.number), model.detection)
    if looked is not None:
        seen *= looked
    pairs = _paired(mean, covariance, plots, at, sight, seen[bank.family])
    existence, stays, splits, unexplained, contested = _weighed(bank, pairs, seen, len(plots), model)
    grown = replace(
        bank,
        at=at,
        mean=mean,
        covariance=covariance,
        existence=existence,
        looks=bank.looks + (1 if looked is None else looked),
        looked=np.full(len(seen), at) if looked is None else np.where(looked, at, bank.looked),
        confirmed=bank.confirmed | (existence >= model.confirm_at),
    )
    grown = _split(grown, pairs, stays, splits, plots.serial, model, looked)
    if contested:
        grown = distinct(grown)
    grown, left_out = bounded(_with_new(grown, plots, unexplained, at, sight, model), model.budget)
    return grown, Scan(unexplained, left_out)


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
    reach[:, detection <= 0.0] = -np.inf
    row, plot = near(expected, reach, plots.value, np.sqrt(gate * plots.variance))
    off = sight.off(plots.value[:, plot], expected[:, row])
    slope = slope if slope.shape[2] == 1 else slope[:, :, row]
    each_mean, each_covariance, distance, log_density = corrected(
        mean[:, row], covariance[:, :, row], off, plots.variance[:, plot], slope, lead_s[plot] if late else None
    )
    inside = distance <= GATE[len(expected) - np.isnan(off).sum(axis=0)]
    if not inside.all():
        row, plot, log_density = row[inside], plot[inside], log_density[inside]
        each_mean, each_covariance = each_mean[:, inside], each_covariance[:, :, inside]
    likelihood = detection[row] * np.exp(log_density) / plots.clutter[plot]
    return _Pairs(row, plot, each_mean, each_covariance, likelihood)


def _weighed(
    bank: Bank, pairs: _Pairs, seen: Floats, plots: int, model: Splitting
) -> tuple[Floats, Floats, Floats, Floats, bool]:
    """Likelihoods (f,) after the scan; weights of hypotheses without a plot (n,) and with one (p,); what no track explains (m,).

    And whether any plot lies with two families. Source: 002-6 eq 6 to 8; their beta_j is what `shared` gives.
    """
    families = len(seen)
    of = bank.family[pairs.row]
    evidence = bank.weight[pairs.row] * pairs.likelihood
    key, edge = np.unique(of * plots + pairs.plot, return_inverse=True)
    family, plot = key // max(plots, 1), key % max(plots, 1)
    by_edge = np.bincount(edge, evidence, minlength=len(key))
    before = model.survival * bank.existence
    missed = before * (1.0 - IN_GATE * seen)
    none = 1.0 - before + missed
    chance, nothing, unexplained = shared(family, plot, before[family] * by_edge, none, plots)
    unseen = nothing * missed / none
    existence = np.maximum(unseen + np.bincount(family, chance, minlength=families), TINY)
    stays = bank.weight * (unseen / existence)[bank.family]
    splits = evidence * (chance / np.maximum(by_edge, TINY))[edge] / existence[of]
    contested = len(plot) > 0 and bool(np.bincount(plot).max() > 1)
    return existence, stays, splits, unexplained, contested


def _split(
    bank: Bank, pairs: _Pairs, stays: Floats, splits: Floats, serial: Ints, model: Splitting, looked: Bools | None
) -> Bank:
    """The children that are kept, in order of family and of weight: the likeliest of each family that lives on."""
    parents = len(stays)
    weight = np.concatenate([stays, splits])
    family = np.concatenate([bank.family, bank.family[pairs.row]])
    alive = bank.existence >= np.where(bank.confirmed, model.end_below, model.drop_below)
    some = np.flatnonzero((weight >= model.least_weight) & alive[family])
    some = some[np.lexsort((-weight[some], family[some]))]
    place = rank(family[some])
    if len(place) and place.max() >= model.hypotheses:
        some = some[place < model.hypotheses]
    child = np.flatnonzero(some >= parents)
    pair = some[child] - parents
    parent = some.copy()
    parent[child] = pairs.row[pair]
    mean, covariance = bank.mean[:, parent], bank.covariance[:, :, parent]
    mean[:, child], covariance[:, :, child] = pairs.mean[:, pair], pairs.covariance[:, :, pair]
    newest = np.zeros(len(some), np.int64)
    newest[child] = serial[pairs.plot[pair]]
    path = np.concatenate([newest[None], bank.path[:-1, parent]])
    if looked is not None:
        path = np.where(looked[family[some]], path, bank.path[:, parent])
    kept = replace(bank, mean=mean, covariance=covariance, family=family[some], path=path, weight=weight[some])
    return merged(kept, weight[some])


def _with_new(bank: Bank, plots: Plots, unexplained: Floats, at: int, sight: Sight, model: Splitting) -> Bank:
    """The same with a family for every plot that tells a place and that no track explains."""
    new = np.flatnonzero(unexplained >= NEW_AT)
    whole, position, scatter = sight.placed(plots.value[:, new], plots.variance[:, new])
    new = new[whole]
    axes, rate = len(position), np.arange(len(position), 2 * len(position))
    mean = np.concatenate([position, np.zeros_like(position)])
    covariance = np.zeros((2 * axes, 2 * axes, len(new)))
    covariance[:axes, :axes] = scatter
    covariance[rate, rate] = (0.5 * model.greatest_speed_mps) ** 2
    return begun(bank, mean, covariance, plots.serial[new], model.newborn * unexplained[new], at)
