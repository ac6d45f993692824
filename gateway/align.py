"""Align: what was said, brought into the site's frames, and radar brought to the time of a GPS report."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Aligned:
    """A step's raw positions in the runway frame: n reports (m) and m plots (m, NaN rows where a component is missing)."""

    report_aircraft: tuple[str, ...]
    report_time: Ints  # (n,) ns
    report_runway_m: Floats  # (n, 3)
    plot_radar_track: tuple[str, ...]  # "1/3"; "1/0" is a plot that the radar does not track
    plot_time: Ints  # (m,) ns
    plot_runway_m: Floats  # (m, 3)
