"""Paper 002-6: two targets that cross among 200 clutter plots a scan, followed by track splitting, and by nearest neighbours.

The case: 20 x 20 km, 0.5 clutter plots/km2, detection 0.9, a scan every 6 s, 50 m an axis, 100 scans; both targets fly 30 m/s
and are at the same place in the middle of the run, one of them weaving by 20 degrees to either side in 200 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.track_splitting import Plots
from sim.studies import Progress, Study, Table, silent
from sim.studies.clutter_sides import SIDES, Seen, Tracker, printed

Floats = NDArray[np.float64]

SCANS, PERIOD_S, SIDE_M, SPEED_MPS = 100, 6.0, 20_000.0, 30.0
DENSITY, DETECTION, SIGMA_M = 0.5e-6, 0.9, 50.0
NEWBORN = 1e-8  # targets that come, a scan and square metre: four in the whole square
APART_S = 30.0  # see `held_by_printed`
SETTLED = 15  # scans after which tracks should stand
ON_TARGET_M = 300.0  # six sigma of a plot
KEPT_SHARE = 0.9  # of the scans
CUT_OFF_M = 500.0  # of GOSPA


@dataclass(frozen=True, slots=True)
class Followed:
    """One run by one tracker, for each of its scans."""

    seen: tuple[Seen, ...]
    off_m: Floats  # (scans, targets) to the nearest track, inf = there is none
    false: NDArray[np.int64]  # (scans,) tracks that are on no target
    gospa_m: Floats  # (scans,)

    @property
    def kept(self) -> NDArray[np.bool_]:
        """(targets,) whether a track was on it in nearly all scans since tracks should stand."""
        return np.asarray((self.off_m[SETTLED:] <= ON_TARGET_M).mean(axis=0) >= KEPT_SHARE)


def targets(scans: int = SCANS, apart_s: float = 0.0) -> Floats:
    """True positions (targets, 2, scans): one straight, one weaving, which is so much later where their ways cross."""
    middle, late = 0.5 * SCANS * PERIOD_S, round(2.0 * apart_s)
    fine = 0.5 * np.arange(-late, round(2.0 * SCANS * PERIOD_S))
    course = -0.3 + math.radians(20.0) * np.sin(2.0 * math.pi * fine / 200.0)
    straight = SPEED_MPS * (fine[late:] - middle) * np.array([[math.cos(0.3)], [math.sin(0.3)]])
    weaving = np.cumsum(0.5 * SPEED_MPS * np.stack([np.cos(course), np.sin(course)]), axis=1)
    weaving -= weaving[:, [late + int(2 * middle)]]
    return np.stack([straight, weaving[:, : straight.shape[1]]])[:, :, :: int(2 * PERIOD_S)][:, :, :scans]


def plots_of(true_m: Floats, random: np.random.Generator, density: float = DENSITY) -> Iterator[Plots]:
    """The plots of one scan after another: (targets, 2, scans) detected or not, and clutter all over the square."""
    serial = 0
    for place in range(true_m.shape[2]):
        detected = true_m[random.random(len(true_m)) < DETECTION, :, place]
        detected = detected + random.normal(0.0, SIGMA_M, detected.shape)
        clutter = random.uniform(-0.5 * SIDE_M, 0.5 * SIDE_M, (random.poisson(density * SIDE_M**2), 2))
        value = random.permutation(np.concatenate([detected, clutter])).T.copy()
        count = value.shape[1]
        at = np.full(count, round(place * PERIOD_S * 1e9))
        serials = np.arange(serial + 1, serial + count + 1)
        yield Plots(
            value, np.full(value.shape, SIGMA_M**2), np.full(count, density), np.full(count, NEWBORN), at, serials
        )
        serial += count


def follow(tracker: Tracker, true_m: Floats, scans: Sequence[Plots]) -> Followed:
    """A tracker's tracks, scan by scan, beside the truth (targets, 2, scans)."""
    seen, off, false, gospa_m = [], [], [], []
    for place, plots in enumerate(scans):
        seen.append(tracker(plots, round(place * PERIOD_S * 1e9)))
        apart = np.linalg.norm(true_m[:, :, None, place] - seen[-1].position[None], axis=1)
        off.append(apart.min(axis=1, initial=math.inf))
        false.append(int((apart.min(axis=0, initial=math.inf) > CUT_OFF_M).sum()))
        gospa_m.append(gospa(apart))
    return Followed(tuple(seen), np.array(off), np.array(false), np.array(gospa_m))


def held_by_printed(seed: int, turn: int) -> Followed:
    """A run of the printed method where every track that it holds counts, told or not, and the ways cross one after the other."""
    true_m = targets(apart_s=APART_S)
    return follow(printed(told=None), true_m, list(plots_of(true_m, np.random.default_rng([seed, turn]))))


def gospa(apart_m: Floats, cut_off_m: float = CUT_OFF_M) -> float:
    """The generalised optimal sub-pattern assignment distance of targets and tracks (t, e) apart: order 2, alpha 2."""
    from scipy.optimize import linear_sum_assignment

    square = np.minimum(apart_m, cut_off_m) ** 2
    target, track = linear_sum_assignment(square)
    alone = sum(apart_m.shape) - 2 * len(target)
    return math.sqrt(float(square[target, track].sum()) + 0.5 * cut_off_m**2 * alone)


def run(runs: int = 50, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """What each tracker reaches over so many runs. `rrd`: where figures 3 and 4 and GOSPA over time are drawn, or None."""
    found: dict[str, list[Followed]] = {name: [] for name in SIDES}
    held: list[Followed] = []
    true_m = targets()
    for turn in range(runs):
        scans = list(plots_of(true_m, np.random.default_rng([seed, turn])))
        for place, (name, made) in enumerate(SIDES.items()):
            progress(f"run {turn + 1}, {name}", (turn + place / len(SIDES)) / runs)
            found[name].append(follow(made(), true_m, scans))
        held.append(held_by_printed(seed, turn))
    figures: dict[str, float] = {}
    tables = []
    for title, columns, notes in ((f"two targets in clutter, {runs} runs of {SCANS} scans", REACHED, NOTES), COST):
        rows: list[tuple[str | float, ...]] = []
        for name, followed in found.items():
            reached = {column: measure(followed) for column, measure in columns.items()}
            rows.append((name, *reached.values()))
            figures |= {f"{column}, {name}": value for column, value in reached.items()}
        tables.append(Table(title, ("tracker", *columns), tuple(rows), notes))
    reached = {column: measure(held) for column, measure in HELD.items()}
    figures |= {f"{column}, literal, all that it holds": value for column, value in reached.items()}
    tables.append(Table(HELD_TITLE, ("tracker", *reached), (("literal", *reached.values()),)))
    if rrd is not None:
        from sim.studies.clutter_figures import draw

        draw(rrd, found, true_m)
    return Study("clutter", runs, seed, tuple(tables), figures, str(rrd) if rrd else None)


def _rmse_m(followed: Sequence[Followed]) -> float:
    off = np.concatenate([one.off_m[SETTLED:].ravel() for one in followed])
    return math.sqrt(float((off[off <= ON_TARGET_M] ** 2).mean())) if (off <= ON_TARGET_M).any() else math.nan


def _mean(followed: Sequence[Followed], of: Callable[[Seen], float], since: int = SETTLED) -> float:
    return float(np.mean([of(seen) for one in followed for seen in one.seen[since:]]))


Measure = Callable[[Sequence[Followed]], float]

REACHED: dict[str, Measure] = {
    "kept %": lambda each: 100.0 * float(np.mean([one.kept for one in each])),
    "both %": lambda each: 100.0 * float(np.mean([one.kept.all() for one in each])),
    "both at end %": lambda each: 100.0 * float(np.mean([(one.off_m[-1] <= ON_TARGET_M).all() for one in each])),
    "RMSE m": _rmse_m,
    "false": lambda each: float(np.mean([one.false[SETTLED:].mean() for one in each])),
    "GOSPA m": lambda each: float(np.mean([one.gospa_m.mean() for one in each])),
}
NOTES = (
    f"kept: a track within {ON_TARGET_M:.0f} m in {100 * KEPT_SHARE:.0f} % of the scans after the first {SETTLED}",
    f"false: tracks a scan that are told and on no target, after the first {SETTLED}; GOSPA over all scans, cut off at 500 m",
    "nearest neighbour: seven scans with plots begin a track, three without end it: its best GOSPA in this case",
)
SIZE: dict[str, Measure] = {
    "hypotheses a target": lambda each: _mean(each, lambda seen: seen.hypotheses / max(seen.position.shape[1], 1)),
    "held at scan 2": lambda each: float(np.mean([one.seen[2].tracks for one in each])),
    "held": lambda each: _mean(each, lambda seen: float(seen.tracks)),
    "ms a scan": lambda each: 1e3 * _mean(each, lambda seen: seen.spent_s, 0),
    "worst ms": lambda each: 1e3 * max(seen.spent_s for one in each for seen in one.seen),
}
COST = ("what they hold, and what it costs", SIZE, ("held: all tracks or hypotheses, told or not",))
HELD: dict[str, Measure] = {**{name: REACHED[name] for name in ("kept %", "both %", "RMSE m")}, "held": SIZE["held"]}
HELD_TITLE = (
    f"all that the printed method holds, told or not, where the targets' ways cross {APART_S:.0f} s one after the other"
)
