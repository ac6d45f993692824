"""Track splitting with track likelihood as the paper prints it: every track alone, begun at the first scan.

Every plot in a track's gate makes a child; a track without one goes on. Its likelihood is updated apart from its state, and it
is deleted where that falls to a_k times its score; a_k follows the number of tracks. The result is the tracks whose likelihood
was greatest on average over their life.

Source: 002-6 eq 5 to 16. Reading: the score fades (`fading`), because with the printed sum it grows by the number of measured
components each scan and every true track dies in the end; PR is a constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.estimators.track_splitting import GATE, IN_GATE, SECOND, TINY, Plots
from gateway.estimators.track_splitting_gates import near
from gateway.estimators.track_splitting_plots import Sight, corrected, moved, spread

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ALIKE = (
    3  # tracks with the same plots in so many scans are one: the similarity test that the paper's reference 8 is about
)


@dataclass(frozen=True, slots=True)
class Printed:
    """The paper's numbers, and those that it leaves open."""

    acceleration_density: tuple[float, ...]  # m^2/s^3, for each axis
    greatest_speed_mps: tuple[float, ...]  # along each axis, for the first gate
    detection: float = 0.9  # PD
    detection_if_false: float = 0.15  # PR
    first_likelihood: float = 0.5
    fading: float = 0.9  # of the score, 1 = the printed sum
    budget: int = 10  # tracks: five a target
    thinning: float = 0.8  # of more tracks than that, at least this share is left by one scan


@dataclass(frozen=True, slots=True)
class Tracks:
    """n tracks after a scan: states (2A, n) and (2A, 2A, n), likelihood, score, and their likelihoods' sum (n,)."""

    at: int  # ns
    mean: Floats
    covariance: Floats
    likelihood: Floats
    score: Floats
    total: Floats
    recent: Ints  # (ALIKE, n) serials of the last plots, 0 = none
    parent: Ints  # (n,) which track of the scan before, -1 = begun
    scans: int

    @property
    def average(self) -> Floats:
        """The mean likelihood of each over its life (n,). Source: eq 16."""
        return self.total / self.scans

    def greatest(self, number: int) -> Ints:
        """The tracks that are the result: of the greatest mean likelihood, none with a recent plot of one before it."""
        result: list[int] = []
        for track in np.argsort(-self.average, kind="stable"):
            plots = self.recent[:, track]
            if all(((plots != self.recent[:, other]) | (plots == 0)).all() for other in result):
                result.append(int(track))
            if len(result) == number:
                break
        return np.array(result, dtype=np.int64)


def unseen(likelihood: ArrayLike, detection: float, detection_if_false: float) -> Floats:
    """A track's likelihood after a scan without a plot. Source: 002-6 eq 6."""
    given = np.asarray(likelihood, dtype=np.float64)
    true, false = (1.0 - detection) * given, (1.0 - detection_if_false) * (1.0 - given)
    return np.asarray(true / (true + false))


def seen(likelihood: ArrayLike, own: ArrayLike, detection: float, detection_if_false: float) -> Floats:
    """A track's likelihood after a plot that is the target's with a probability `own` (PT). Source: 002-6 eq 7, 8."""
    given, part = np.asarray(likelihood, dtype=np.float64), np.asarray(own, dtype=np.float64)
    certain = detection * given / (detection * given + detection_if_false * (1.0 - given))
    return np.asarray(part * certain + (1.0 - part) * unseen(given, detection, detection_if_false))


def begin(plots: Plots, at: int, sight: Sight, model: Printed) -> Tracks:
    """A track for every plot of the first scan that tells a place."""
    whole, position, scatter = sight.placed(plots.value, plots.variance)
    axes, count = position.shape
    rate = np.arange(axes, 2 * axes)
    covariance = np.zeros((2 * axes, 2 * axes, count))
    covariance[:axes, :axes] = scatter
    covariance[rate, rate] = (0.5 * np.array(model.greatest_speed_mps)[:, None]) ** 2
    likelihood = np.full(count, model.first_likelihood)
    mean = np.concatenate([position, np.zeros_like(position)])
    begun = np.full(count, -1)
    recent = np.zeros((ALIKE, count), np.int64)
    recent[0] = plots.serial if whole is None else plots.serial[whole]
    return Tracks(at, mean, covariance, likelihood, np.zeros(count), likelihood, recent, begun, 1)


def scan(tracks: Tracks, plots: Plots, at: int, sight: Sight, model: Printed) -> Tracks:
    """The tracks after one more scan at an instant (ns). Source: 002-6 eq 5 to 15."""
    axes = len(tracks.mean) // 2
    mean, covariance = moved(tracks.mean, tracks.covariance, (at - tracks.at) / SECOND, model.acceleration_density)
    expected, slope = sight.measured(mean[:axes])
    gate = GATE[len(expected)]
    reach = gate * spread(slope, covariance[:axes, :axes])
    row, plot = near(expected, reach, plots.value, gate * plots.variance)
    off = sight.off(plots.value[:, plot], expected[:, row])
    slope, missing = None if slope is None else slope[:, :, row], np.isnan(off)
    after, scatter, distance, density = corrected(
        mean[:, row], covariance[:, :, row], off, plots.variance[:, plot], slope, missing
    )
    inside = distance <= GATE[len(expected) - missing.sum(axis=0)]
    row, plot, distance = row[inside], plot[inside], distance[inside]
    ratio = model.detection * density[inside] / plots.clutter[plot]
    together = 1.0 - model.detection * IN_GATE + np.bincount(row, ratio, minlength=len(tracks.score))
    alone = np.flatnonzero(np.bincount(row, minlength=len(tracks.score)) == 0)
    parent = np.concatenate([row, alone])
    likelihood = np.concatenate(
        [
            seen(tracks.likelihood[row], ratio / together[row], model.detection, model.detection_if_false),
            unseen(tracks.likelihood[alone], model.detection, model.detection_if_false),
        ]
    )
    score = model.fading * tracks.score[parent] + np.concatenate([distance, np.zeros(len(alone))])
    newest = np.concatenate([plots.serial[plot], np.zeros(len(alone), np.int64)])
    grown = Tracks(
        at,
        np.concatenate([after[:, inside], mean[:, alone]], axis=1),
        np.concatenate([scatter[:, :, inside], covariance[:, :, alone]], axis=2),
        likelihood,
        score,
        tracks.total[parent] + likelihood,
        np.concatenate([newest[None], tracks.recent[:-1, parent]]),
        parent,
        tracks.scans + 1,
    )
    return _thinned(grown, model)


def _thinned(tracks: Tracks, model: Printed) -> Tracks:
    """Without the tracks whose likelihood is at most a_k times the score, a_k being what leaves as many as are allowed."""
    order = np.argsort(-tracks.average, kind="stable")
    _, first = np.unique(tracks.recent[:, order], axis=1, return_index=True)
    some = order[first]
    allowed = max(model.budget, math.ceil(model.thinning * len(some)))
    if len(some) > allowed:
        ratio = tracks.likelihood[some] / np.maximum(tracks.score[some], TINY)
        some = some[np.argsort(-ratio, kind="stable")[:allowed]]
    stays = np.sort(some)
    return Tracks(
        tracks.at,
        tracks.mean[:, stays],
        tracks.covariance[:, :, stays],
        tracks.likelihood[stays],
        tracks.score[stays],
        tracks.total[stays],
        tracks.recent[:, stays],
        tracks.parent[stays],
        tracks.scans,
    )
