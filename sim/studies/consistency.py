"""Whether tracks are as sure as they say: NEES and NIS over many runs, second by second.

NEES is the squared error of the position by the covariance that is told, NIS the squared innovation by what it should
scatter by. Over n runs their means lie in an interval that chi-square gives; a filter is honest in a second if they do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from gateway.estimators.batch.tracks import begin
from gateway.estimators.kalman import predict, update
from gateway.fuse.starting import start_from_fixes
from gateway.fuse.weighting import ROBUST_SIGMA, Model, told_by_fixes, told_by_plots
from gateway.settings import Estimation, EstimatorName, Options
from sim.studies import Progress, Study, Table, silent
from sim.studies.ensembles import Ensemble, Step, approach, traffic, two_turns

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm")
INSIDE = 0.95  # of the means of an honest filter


@dataclass(frozen=True, slots=True)
class Followed:
    """What a filter made of an ensemble, t steps: errors (t, runs, axes), NEES and NIS (t, runs), degrees of NIS (t, runs)."""

    at_s: Floats
    off_m: Floats
    nees: Floats
    nis: Floats
    degrees: NDArray[np.int64]

    def rmse_m(self, since_s: float) -> float:
        """Of the position, over all runs."""
        return math.sqrt(float((self.off_m[self.at_s >= since_s] ** 2).sum(axis=-1).mean()))


@dataclass(frozen=True, slots=True)
class Seconds:
    """An ensemble second by second: means over the runs for each degree of freedom, and whether they lie inside."""

    second: NDArray[np.int64]
    nees: Floats
    nees_inside: Bools
    nis: Floats
    nis_inside: Bools


def run(runs: int = 100, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """Shares of the seconds in which mean NEES and NIS are inside, by case and estimator.

    `rrd`: where NEES and NIS are drawn second by second, or None.
    """
    cases = {
        "003's approach": [approach(runs, seed)],
        "000's case": [two_turns(runs, seed)],
        "000's case, velocity measured": [two_turns(runs, seed, velocity=True)],
        "scene traffic": traffic(runs, seed),
    }
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    drawn: dict[str, Seconds] = {}
    for place, (name, ensembles) in enumerate(cases.items()):
        for turn, estimator in enumerate(ESTIMATORS):
            each = []
            for number, one in enumerate(ensembles):
                done = (turn + number / len(ensembles)) / len(ESTIMATORS)
                progress(f"{name}, {estimator}", (place + done) / len(cases))
                each.append((one, follow(one, model_of(one, Options(estimator=estimator)))))
            found = joined([by_second(followed, one) for one, followed in each])
            drawn[f"{name}/{estimator}"] = found
            rows.append((name, estimator, *_cells(found), _rmse_m(each)))
            figures |= {f"NEES {name}, {estimator}": float(found.nees_inside.mean())}
            figures |= {f"NIS {name}, {estimator}": float(found.nis_inside.mean())}
    if rrd is not None:
        from sim.studies.consistency_figures import draw

        draw(rrd, drawn, runs)
    shown = Table(f"mean NEES of the position and NIS over {runs} runs, second by second", COLUMNS, tuple(rows), NOTES)
    return Study("consistency", runs, seed, (shown,), figures, str(rrd) if rrd else None)


COLUMNS = (
    *(
        "case",
        "estimator",
        "NEES inside, % of seconds",
        "below %",
        "mean",
        "NIS inside, % of seconds",
        "below %",
        "mean",
    ),
    "RMSE m",
)
NOTES = (
    "in: of the seconds, inside the 95 % interval that chi-square gives; 000's case in the plane",
    "means for each degree of freedom, 1 = as told",
    "below: surer than told, the careful side",
)


def _cells(found: Seconds) -> tuple[float, ...]:
    cells: list[float] = []
    for value, inside in ((found.nees, found.nees_inside), (found.nis, found.nis_inside)):
        cells += [100.0 * inside.mean(), 100.0 * (~inside & (value < 1.0)).mean(), value.mean()]
    return tuple(map(float, cells))


def _rmse_m(each: Sequence[tuple[Ensemble, Followed]]) -> float:
    square = [(followed.off_m[followed.at_s >= one.since_s] ** 2).sum(axis=-1).ravel() for one, followed in each]
    return math.sqrt(float(np.concatenate(square).mean()))


def model_of(ensemble: Ensemble, options: Options, estimation: Estimation = Estimation()) -> Model:
    """The gateway's model of an ensemble's site and position source."""
    return Model.of(options, ensemble.position, ensemble.frames, estimation)


def follow(ensemble: Ensemble, model: Model) -> Followed:
    """The gateway's filter over an ensemble, all runs as one batch."""
    first, runs, axes = ensemble.steps[0], ensemble.runs, ensemble.axes
    sigmas = _sigmas(ensemble)
    place, sigma = np.where(np.isnan(first.value), 0.0, first.value), np.tile(sigmas[0], (runs, 1))
    state = start_from_fixes(place, sigma[:, :3], first.velocity, sigma[:, 3], model)
    batch = None if model.modes is None else begin(state, model.modes)
    at_s, off, nees, nis, degrees = first.at_s, [], [], [], []
    for step in ensemble.steps[1:]:
        elapsed_s, at_s = np.full(runs, step.at_s - at_s), step.at_s
        if batch is None:
            state = predict(state, elapsed_s, model.motion)
            told = _told(state.mean, step, sigmas[step.radar], model)
            state, found = update(state, *told, ROBUST_SIGMA)
            innovation, scatter = found.innovation, found.covariance
        else:
            batch = batch.predict(elapsed_s)
            told = _told(batch.means, step, sigmas[step.radar], model)
            batch, innovation, scatter = batch.update(*told, ROBUST_SIGMA)
            state = batch.stated()
        wrong = state.mean[:, :axes] - step.true_enu_m[:axes]
        off.append(wrong)
        nees.append(_normalised(wrong, state.covariance[:, :axes, :axes]))
        nis.append(_normalised(innovation, scatter))
        degrees.append((~np.isnan(told[0][:: model.together])).sum(axis=1))
    times = np.array([step.at_s for step in ensemble.steps[1:]])
    return Followed(times, np.array(off), np.array(nees), np.array(nis), np.array(degrees))


def _sigmas(ensemble: Ensemble) -> dict[int, Floats]:
    """The stated noise of each radar's components, and under 0 that of reports: position and velocity, (6,)."""
    position = ensemble.position
    sigmas = {0: np.repeat([position.sigma_m, position.velocity_sigma_mps], 3)}
    for radar in ensemble.site.radars:
        sigmas[radar.number] = np.array([radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad])
    return sigmas


def _told(means: Floats, step: Step, sigma: Floats, model: Model) -> tuple[Floats, Floats, Floats]:
    """What a step measured of all runs, by each mode's mean: innovations, their derivatives by the state, variances."""
    value, variance = np.repeat(step.value, model.together, axis=0), np.tile(sigma * sigma, (len(means), 1))
    if step.radar:
        return *told_by_plots(means, value, model.radars[step.radar]), variance
    velocity = np.repeat(step.velocity, model.together, axis=0)
    return *told_by_fixes(means, value, velocity, model), variance


def _normalised(off: Floats, covariance: Floats) -> Floats:
    return np.asarray((off[:, None] @ np.linalg.inv(covariance) @ off[:, :, None])[:, 0, 0])


def by_second(followed: Followed, ensemble: Ensemble) -> Seconds:
    """NEES after the last measurement of each second, NIS over all of its measurements."""
    low, high = 0.5 * (1.0 - INSIDE), 0.5 * (1.0 + INSIDE)
    runs, axes = ensemble.runs, ensemble.axes
    seconds = np.floor(followed.at_s).astype(np.int64)
    chosen = np.unique(seconds[followed.at_s >= ensemble.since_s])
    nees, nis, nis_inside = [], [], []
    for second in chosen:
        here = np.flatnonzero(seconds == second)
        nees.append(followed.nees[here[-1]].mean() / axes)
        total, degrees = followed.nis[here].sum(), followed.degrees[here].sum()
        nis.append(total / degrees)
        nis_inside.append(chi2.ppf(low, degrees) <= total <= chi2.ppf(high, degrees))
    mean = np.array(nees)
    least, most = (chi2.ppf(share, runs * axes) / (runs * axes) for share in (low, high))
    return Seconds(chosen, mean, (least <= mean) & (mean <= most), np.array(nis), np.array(nis_inside))


def joined(parts: Sequence[Seconds]) -> Seconds:
    """The seconds of several aircraft, one after another."""
    return Seconds(
        np.concatenate([part.second for part in parts]),
        np.concatenate([part.nees for part in parts]),
        np.concatenate([part.nees_inside for part in parts]),
        np.concatenate([part.nis for part in parts]),
        np.concatenate([part.nis_inside for part in parts]),
    )
