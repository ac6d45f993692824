"""When a check is a hit: the paper's eq 7 (`literal`) against all that were measured, at least two (`default`).

python docs/decisions/association_rule.py
"""

from __future__ import annotations

import numpy as np

from gateway.settings import AssociationRule, Options
from sim.cases import Case, case_003
from sim.studies.fusion import START, associated_ranges, association_times, measures_of, setting_of

RUNS, SEED = 60, 1
RULES: tuple[AssociationRule, ...] = ("default", "literal")


def heard_s(case: Case, rule: AssociationRule) -> list[float]:
    """When each run's own radar track was associated, seconds after the first plot; inf = not within a minute."""
    setting = setting_of(case, Options(association=rule))
    times = [association_times(measures_of(case, index), setting, 60.0) for index in range(case.runs)]
    return [float("inf") if found is None else (found[0] - START) / 1e9 for found in times]


def falsely(case: Case, rule: AssociationRule) -> float:
    """Share of the runs in which an aircraft abeam, alone on the radar, is taken for the one on final beyond 5 km."""
    from dataclasses import replace

    setting = setting_of(case, Options(association=rule))
    farthest = []
    for index in range(case.runs):
        heard = replace(measures_of(case, index), plots=())
        farthest.append(max(associated_ranges(heard, setting), default=0.0))
    return float(np.mean([distance > 5000.0 for distance in farthest]))


if __name__ == "__main__":
    print(f"{RUNS} runs{'':<34}" + "".join(f"{rule:>12}" for rule in RULES))
    for name, missing in (
        ("all components", ()),
        ("no azimuth", "azimuth"),
        ("no elevation", "elevation"),
        ("no range", "range"),
    ):
        case = case_003(RUNS, SEED, first_fix_s=0.8, missing=missing)
        found = [heard_s(case, rule) for rule in RULES]
        cells = [f"{np.mean(times):.1f} s" if np.all(np.isfinite(times)) else "never" for times in found]
        print(f"{'associated after, ' + name:<40}" + "".join(f"{cell:>12}" for cell in cells), flush=True)
    for degrees in (3.0, 1.0):
        case = case_003(RUNS, SEED, abeam_deg=degrees)
        shares = [falsely(case, rule) for rule in RULES]
        name = f"the wrong aircraft, {degrees:.0f} degrees abeam"
        print(f"{name:<40}" + "".join(f"{100 * share:>10.0f} %" for share in shares), flush=True)
