"""What is believed of a position source's own error before anything is known: 3-D RMSE on 003's approach, in metres.

python docs/decisions/error_prior.py
"""

from __future__ import annotations

import math
from dataclasses import replace

from approach_rmse import RUNS, cases, heading, line, rmse_m, usual_motion

CHOICES = (
    ("60/sqrt(3), 1e6 s", 60.0 / math.sqrt(3.0), 1e6),
    ("60 an axis, 1e6 s", 60.0, 1e6),
    ("20 an axis, 1e6 s", 20.0, 1e6),
    ("60/sqrt(3), 10 h", 60.0 / math.sqrt(3.0), 36_000.0),
    ("60/sqrt(3), 1 h", 60.0 / math.sqrt(3.0), 3_600.0),
    ("60/sqrt(3), 10 min", 60.0 / math.sqrt(3.0), 600.0),
    ("none (covariance)", 0.0, 1e6),
)

if __name__ == "__main__":
    known = cases()
    print(f"{RUNS} runs; sigma of the error in m, and its time constant")
    print(heading("prior"))
    for name, sigma_m, time_constant_s in CHOICES:
        motion = replace(usual_motion(), error_sigma_m=sigma_m, error_time_constant_s=time_constant_s)
        print(line(name, [rmse_m(case, motion) for case in known.values()]), flush=True)
