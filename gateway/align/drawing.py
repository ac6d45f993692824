"""The fixes and plots of a step, as columns in the runway frame: what `Picture` shows of this stage."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align.plots import Plot
from gateway.align.reports import Fix
from gateway.frames import RadarFrame, RunwayFrame, turn, xyz_from_polar

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Aligned:
    """A step's raw positions in the runway frame: n reports (m) and m plots (m, NaN rows where a component is missing)."""

    report_aircraft: tuple[str, ...]
    report_time: Ints  # (n,) ns
    report_runway_m: Floats  # (n, 3)
    report_has_height: Bools  # (n,); without one the third coordinate is a guess
    plot_radar_track: tuple[str, ...]  # "1/3"; "1/0" is a plot that the radar does not track
    plot_time: Ints  # (m,) ns
    plot_runway_m: Floats  # (m, 3)


def draw(fixes: Sequence[Fix], plots: Sequence[Plot], frame: RunwayFrame, radars: Mapping[int, RadarFrame]) -> Aligned:
    """The fixes and plots of a step as columns in the runway frame."""
    report_m = np.array([fix.enu_m for fix in fixes]).reshape(-1, 3)
    plot_m = np.full((len(plots), 3), math.nan)
    for number, radar in radars.items():
        rows = [row for row, plot in enumerate(plots) if plot.radar == number]
        if rows:
            polar = np.array([plots[row].polar for row in rows])
            plot_m[rows] = turn(frame.runway_from_enu, radar.to_enu(xyz_from_polar(polar)))
    return Aligned(
        report_aircraft=tuple(fix.aircraft for fix in fixes),
        report_time=np.array([fix.at for fix in fixes], dtype=np.int64),
        report_runway_m=turn(frame.runway_from_enu, report_m),
        report_has_height=np.array([fix.has_height for fix in fixes], dtype=np.bool_),
        plot_radar_track=tuple(f"{plot.radar}/{plot.number}" for plot in plots),
        plot_time=np.array([plot.at for plot in plots], dtype=np.int64),
        plot_runway_m=plot_m,
    )
