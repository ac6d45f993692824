"""Paper 003's approach smoothed: what later measurements make of each filter's track, by distance, and whether it is honest.

The runs are those of `talkdown study fusion`, filtered by the gateway's own filter, then smoothed as `talkdown replay --smooth`
does it. Errors are taken at the radar's times from t = 20 s, in three dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.kalman import POSITION, VELOCITY, Estimate
from gateway.estimators.smoothing import States, smooth
from gateway.fuse.events import Event
from gateway.fuse.weighting import Model
from gateway.offline.pieces import arrays_of, state_of
from gateway.settings import EstimatorName
from sim.cases import Case, case_003
from sim.studies import Progress, Study, Table, silent
from sim.studies.fusion import COUNTED_FROM_S, START, Accuracy, accuracy_of, filtered

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm")
RUNS_AT_ONCE = 20  # their states are in memory together
COLUMNS = ("estimator", "GPS error", "RMSE m", "50-25 km", "25-10 km", "10-1.2 km", "NEES, 3 = honest")
NOTES = (
    "ratio: smoothed by filtered; errors at the radar's times from t = 20 s; NEES of the position, mean over runs and times",
)


@dataclass(frozen=True, slots=True)
class Pair:
    """A filter's positions and the smoothed ones at the radar's times (runs, t, 3), and the position's NEES (runs, t)."""

    filtered_m: Floats
    smoothed_m: Floats
    filtered_nees: Floats
    smoothed_nees: Floats


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """Filtered and smoothed RMSE of 003's approach, over all and by distance, for each estimator with modes or without.

    `rrd`: where the errors over the distance are drawn, or None.
    """
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    drawn: dict[str, Pair] = {}
    plan = [(estimator, error) for error in ("with", "without") for estimator in ESTIMATORS]
    for place, (estimator, error) in enumerate(plan):
        case = case_003(runs, seed, gps_error=error == "with")

        def tell(what: str, share: float, done: int = place) -> None:
            progress(what, (done + share) / len(plan))

        pair = pair_of(case, estimator, tell)
        before, after = accuracy_of(case, pair.filtered_m), accuracy_of(case, pair.smoothed_m)
        counted = case.plot_s >= COUNTED_FROM_S
        rows.append((estimator, error, *_numbers(before), float(np.nanmean(pair.filtered_nees[:, counted]))))
        rows.append(("  smoothed", "", *_numbers(after), float(np.nanmean(pair.smoothed_nees[:, counted]))))
        ratios = [s / f for s, f in zip(_numbers(after), _numbers(before), strict=True)]
        rows.append(("  ratio", "", *ratios, float("nan")))
        name = f"{estimator} {error}"
        figures |= {
            f"filtered {name}": before.overall_m,
            f"smoothed {name}": after.overall_m,
            f"ratio {name}": ratios[0],
        }
        figures[f"worst band's ratio {name}"] = max(ratios[1:])
        if error == "with":
            drawn[estimator] = pair
    if rrd is not None:
        from sim.studies.smoothing_figures import draw

        draw(rrd, case_003(runs, seed), drawn, seed)
    table = Table(f"003: filtered and smoothed, {runs} approaches", COLUMNS, tuple(rows), NOTES)
    return Study("smoothing", runs, seed, (table,), figures, str(rrd) if rrd else None)


def _numbers(accuracy: Accuracy) -> tuple[float, ...]:
    return accuracy.overall_m, *accuracy.bands_m


def pair_of(case: Case, estimator: EstimatorName, progress: Progress = silent) -> Pair:
    """All runs of a case filtered and smoothed, by the default weighting."""
    parts = []
    for first in range(0, case.runs, RUNS_AT_ONCE):
        chosen = range(first, min(first + RUNS_AT_ONCE, case.runs))
        histories, model = filtered(case, "bias", estimator, chosen)
        for place, events in enumerate(histories):
            progress(f"{estimator}, run {first + place + 1} of {case.runs}", (first + place) / case.runs)
            parts.append(_both(case, events, model))
    return Pair(*(np.array(part) for part in zip(*parts, strict=True)))


def _both(case: Case, events: Sequence[Event], model: Model) -> tuple[Floats, Floats, Floats, Floats]:
    """One run's positions before and after smoothing at the radar's times, and their NEES."""
    at = np.array([event.at for event in events])
    keep = np.append(at[1:] > at[:-1], True)  # of measurements at one instant the last one's state
    chosen = [event for event, kept in zip(events, keep, strict=True) if kept]
    before, after = smoothed_events(chosen, model)
    time_s = (at[keep] - START) / SECOND
    (filtered_m, filtered_nees), (smoothed_m, smoothed_nees) = (_at(case, time_s, state) for state in (before, after))
    return filtered_m, smoothed_m, filtered_nees, smoothed_nees


def smoothed_events(events: Sequence[Event], model: Model) -> tuple[Estimate, Estimate]:
    """A filter's states after its events, at rising times, and the smoothed ones: (n, 9) and (n, 9, 9) each."""
    states = States(*(part[:, None] for part in arrays_of([state_of(event) for event in events])))
    elapsed_s = np.diff([event.at for event in events])[:, None] / SECOND
    found = smooth(states, elapsed_s, model.motion if model.modes is None else model.modes)
    before, after = states.combined(), found.combined()
    return (
        Estimate(before.mean[:, 0], before.covariance[:, 0]),
        Estimate(after.mean[:, 0], after.covariance[:, 0]),
    )


def _at(case: Case, time_s: Floats, state: Estimate) -> tuple[Floats, Floats]:
    """Positions (t, 3) at the radar's times, carried on from the latest state, and NEES (t,) where one is at that very time."""
    latest = np.maximum(np.searchsorted(time_s, case.plot_s + 1e-6, side="right") - 1, 0)
    ahead = np.maximum(case.plot_s - time_s[latest], 0.0)[:, None]
    place = state.mean[latest][:, POSITION] + ahead * state.mean[latest][:, VELOCITY]
    off = (place - case.true_enu_m)[:, :, None]
    spread = state.covariance[latest][:, POSITION, POSITION]
    nees = (off.swapaxes(1, 2) @ np.linalg.solve(spread, off))[:, 0, 0]
    return place, np.where(ahead[:, 0] < 1e-6, nees, np.nan)
