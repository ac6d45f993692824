"""How much the constant-velocity model lets an aircraft accelerate: 3-D RMSE on 003's approach, in metres.

python docs/decisions/process_noise.py
"""

from __future__ import annotations

from dataclasses import replace

from approach_rmse import RUNS, cases, heading, line, rmse_m

from gateway.settings import Options

CHOICES = ((2.0, 2.0), (2.0, 1.0), (2.0, 0.5), (1.0, 1.0), (3.0, 1.0))

if __name__ == "__main__":
    known = cases()
    print(f"{RUNS} runs; acceleration sigma in m/s2, white over 0.4 s")
    print(heading("level, upright"))
    for level, upright in CHOICES:
        options = replace(Options(), acceleration_sigma_mps2=level, vertical_acceleration_sigma_mps2=upright)
        print(
            line(f"{level:.1f}, {upright:.1f}", [rmse_m(case, options=options) for case in known.values()]), flush=True
        )
