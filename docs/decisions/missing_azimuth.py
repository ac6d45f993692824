"""Where the error comes from when the radar never measures azimuth: 003's approach, by parts of the path, in metres.

    python docs/decisions/missing_azimuth.py

"across" is north here (the approach flies east). The mean over all runs is what the filter gets wrong every time; the rest
is noise. With and without the constant error of the position source, whose part across is 40 m.
"""

from __future__ import annotations

import numpy as np
from approach_rmse import RUNS, SEED, errors_m

from sim.cases import case_003
from sim.studies.fusion import COUNTED_FROM_S

PARTS = (
    ("turn", 47_000.0, 25_000.0),
    ("straight", 25_000.0, 10_000.0),
    ("last 10 km", 10_000.0, 1_200.0),
)

if __name__ == "__main__":
    print(f"{RUNS} runs{'':<22}{'across, mean':>14}{'greatest':>10}{'across, RMS':>13}{'3-D RMSE':>10}")
    for name, has_error in (("with", True), ("without", False)):
        case = case_003(RUNS, SEED, missing="azimuth", gps_error=has_error)
        errors = errors_m(case)
        along = case.along_m[case.plot_s >= COUNTED_FROM_S]
        for part, far, near in PARTS:
            some = errors[:, (along <= far) & (along > near)]
            across = some[..., 1]
            means = across.mean(axis=0)
            cells = (float(means.mean()), float(np.abs(means).max()), float(np.sqrt((across**2).mean())))
            total = float(np.sqrt((some**2).sum(axis=-1).mean()))
            print(f"{part + ', ' + name:<29}" + f"{cells[0]:>11.1f}{cells[1]:>10.1f}{cells[2]:>13.1f}{total:>10.1f}")
