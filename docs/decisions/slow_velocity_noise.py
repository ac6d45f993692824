"""What could tell velocity noise 1.5 times as stated from reports 5 s apart: two tables of docs/honesty.md.

python docs/decisions/slow_velocity_noise.py [SESSION...]     SESSION: an archived replay, for its truth.parquet

First: what flights' own velocities leave over in the calmest share of all 5 s (of SITL's, from the truth), as if it were
noise. Second: the logarithm of the likelihoods' ratio, in a report of three components, of positions less what velocities
add up to, a walk with steps of the velocities' noise: for 1.5 times the noise against what is stated, by two filters.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet

APART_S, STATED_MPS, WRONG, SURE = 5.0, 0.5, 1.5, 12.0
SHARES = (0.1, 0.25, 0.5, 0.75)
RUNS, REPORTS = 300, 400
# How positions wander: sigma, m, over so many seconds; and velocities' noise, times stated.
WANDERS = ((0.0, 100.0), (2.0, 100.0), (5.0, 100.0), (10.0, 300.0), (15.0, 100.0))
CASES = (
    ("1.5 times stated", WRONG, 0.0, 100.0),
    *((f"as stated; positions wander {sigma:g} m in {over:g} s", 1.0, sigma, over) for sigma, over in WANDERS),
)


def main() -> None:
    """Both tables."""
    for session in sys.argv[1:]:
        print(session, *(f"{sigma:.2f} m/s in the calmest {share:.0%}" for share, sigma in _calmest(Path(session))))
    print(f"{'positions':>10}  {'velocities':44}{'evidence a report':>20}{'after s':>10}")
    for sigma_m in (15.0, 5.0, 1.5):
        for name, times, wander_m, over_s in CASES:
            told = _evidence(sigma_m, times, wander_m, over_s)
            after = f"{SURE / told * APART_S:.0f}" if told > 0.0 else "never"
            print(f"{sigma_m:8g} m  {name:44}{told:20.4f}{after:>10}")


def _calmest(session: Path) -> list[tuple[float, float]]:
    """The noise that would leave over as little as a flight's level velocities in its calmest share, by share."""
    truth = parquet.read_table(session / "truth.parquet")
    level = np.stack([truth[f"velocity_{way}_mps"].to_numpy() for way in ("east", "north")], axis=1)
    flying = np.hypot(*level.T) > 5.0
    time = truth["time"].to_numpy().astype(np.int64)[flying] / 1e9
    wanted = np.searchsorted(time, np.arange(time[0], time[-1], APART_S))
    wanted = wanted[wanted < len(time)]
    left = np.hypot(*np.diff(level[flying][wanted], n=2, axis=0).T) / np.sqrt(6.0)
    together = np.diff(time[wanted]) < 1.2 * APART_S
    left = left[together[1:] & together[:-1]]
    return [(share, float(np.quantile(left, share) / np.sqrt(-2.0 * np.log(1.0 - share)))) for share in SHARES]


def _evidence(sigma_m: float, times: float, wander_m: float, over_s: float) -> float:
    """Mean evidence of a report, three components."""
    random = np.random.default_rng(1)
    step_m = APART_S * STATED_MPS
    walk = np.cumsum(times * step_m * random.normal(size=(RUNS, REPORTS)), axis=1)
    kept = np.exp(-APART_S / over_s)
    wander = np.empty((RUNS, REPORTS))
    wander[:, 0] = wander_m * random.normal(size=RUNS)
    for k in range(1, REPORTS):
        wander[:, k] = kept * wander[:, k - 1] + wander_m * np.sqrt(1.0 - kept * kept) * random.normal(size=RUNS)
    seen = walk + wander + sigma_m * random.normal(size=(RUNS, REPORTS))
    return 3.0 * (_likelihood(seen, sigma_m, WRONG * step_m) - _likelihood(seen, sigma_m, step_m))


def _likelihood(seen: np.ndarray, sigma_m: float, step_m: float) -> float:
    """Mean logarithm of the likelihood of an observation of walks (runs, reports)."""
    mean, variance, total = seen[:, 0], sigma_m**2, 0.0
    for k in range(1, seen.shape[1]):
        variance += step_m**2
        scatter = variance + sigma_m**2
        off = seen[:, k] - mean
        total += float(np.mean(-0.5 * (off * off / scatter + np.log(scatter))))
        mean, variance = mean + variance / scatter * off, variance * sigma_m**2 / scatter
    return total / seen.shape[1]


if __name__ == "__main__":
    main()
