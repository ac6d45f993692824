"""Paper 002-7's experiment: 44 arrivals in four flows, found as printed, repaired, and by whole tracks."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.offline.flows import METHODS, Flows, Method, cleaned, found
from sim.arrivals import HEIGHTS_M, TIMES_S, Arrivals, arrivals
from sim.studies import Progress, Study, Table, silent

RIGHT = 0.98  # of the adjusted Rand index
ALIKE_M = 600.0  # how far apart two flows are in height that are one in plan


def agreement(one: NDArray[np.int64], other: NDArray[np.int64]) -> float:
    """The adjusted Rand index of two labellings: 1 the same, 0 as by chance."""
    from sklearn.metrics import adjusted_rand_score  # an extra: loaded where it is used

    return float(adjusted_rand_score(one, other))


def alike(seed: int) -> Arrivals:
    """Two flows on one way, 600 m apart in height until the final."""
    return arrivals(
        seed,
        sizes=(12, 12),
        bearings_deg=(300.0, 300.0),
        heights_m=(HEIGHTS_M[0], HEIGHTS_M[0] - ALIKE_M),
        times_s=(TIMES_S[0], TIMES_S[0]),
        level_above_final_m=(0.4 * ALIKE_M, 0.0),  # halfway a flow keeps 0.6 of what it is higher
    )


def is_apart(of: Arrivals, method: Method) -> bool:
    """Whether as many flows are found as it was made of, none of them with flights of two; a few may have come alone."""
    flows = found([cleaned(one) for one in of.tracks], method).flows
    mixed = any(len(np.unique(of.labels[list(flow.flights)])) > 1 for flow in flows)
    return not mixed and len(flows) == len(np.unique(of.labels))


def times_off(of: Arrivals, flows: Flows) -> float:
    """The greatest relative error of a flow's mean time, against the mean of the flights that it was made of."""
    worst = 0.0
    for flow in flows.flows:
        numbers = of.labels[list(flow.flights)]
        own = np.flatnonzero(of.labels == np.bincount(numbers).argmax())
        true = np.mean([-of.tracks[flight].time_s[0] for flight in own])
        worst = max(worst, abs(flow.mean_time_s / true - 1.0))
    return worst


def run(runs: int = 12, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """Each method on `runs` sets. `rrd`: where the first set is drawn as `default` finds it, or None."""
    figures: dict[str, float] = {}
    rows = []
    for method in METHODS:
        scores, times, took = [], [], []
        for number in range(runs):
            progress(method, (METHODS.index(method) + number / runs) / len(METHODS))
            of = arrivals(seed + number)
            tracks = [cleaned(track) for track in of.tracks]
            begun = time.perf_counter()
            flows = found(tracks, method)
            took.append(time.perf_counter() - begun)
            scores.append(agreement(of.labels, flows.labels))
            times.append(times_off(of, flows))
        right = sum(score >= RIGHT for score in scores)
        apart = sum(is_apart(alike(seed + number), method) for number in range(runs))
        figures |= {f"{method}, right": right, f"{method}, least": min(scores), f"{method}, times": 100.0 * max(times)}
        figures[f"{method}, apart in height"] = apart
        rows.append(
            (method, right, min(scores), float(np.median(scores)), 100.0 * max(times), apart, float(np.median(took)))
        )
    columns = ("method", "right", "least index", "median", "times off, %", "apart in height", "s a set")
    title = f"002-7: 44 arrivals in four flows, {runs} sets; adjusted Rand index, right from 0.98 on"
    if rrd is not None:
        from gateway.sinks.flows import draw

        tracks = [cleaned(track) for track in arrivals(seed).tracks]
        draw(tuple(tracks), found(tracks), rrd)
    return Study("flows", runs, seed, (Table(title, columns, tuple(rows)),), figures, str(rrd) if rrd else None)
