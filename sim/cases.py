"""003's case as arrays: what GPS and radar measured in many Monte Carlo runs, without wires, for studies.

The same sensors as on the wires (`sim.sensors`), all runs at once. Variants of one seed and number of runs share
their noise, so that what differs between two of them is the variant; another number of runs is another draw.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.settings import DEMO_SITE, Site
from sim.earth import Flown, fly
from sim.paths import Abeam, CasePath, Path
from sim.radars import RadarSight
from sim.sensors import (
    GpsMeasured,
    GpsParameters,
    PlotsMeasured,
    RadarParameters,
    gps_phases,
    gps_times,
    measure_gps,
    measure_radar,
    scan_times,
    stream,
)

Floats = NDArray[np.float64]

COMPONENTS = ("range", "azimuth", "elevation")


@dataclass(frozen=True, slots=True)
class Case:
    """The measurements of many runs of one approach, and the truth. Times are seconds after the first plot.

    Plots are heard when they are measured (`radar.latency_s` is the wire's); reports at `gps.received_s`.
    """

    site: Site
    gps_parameters: GpsParameters
    radar_parameters: RadarParameters
    plot_s: Floats  # (m,) times of the scans
    plots: PlotsMeasured  # polar (runs, m, 3), radial velocity (runs, m)
    gps: GpsMeasured  # (runs, n) each, velocities (runs, n, 3)
    abeam: PlotsMeasured | None  # plots of the aircraft abeam, as `plots`
    true: Flown  # (m,) at the times of the scans
    true_enu_m: Floats  # (m, 3) at the runway's centre
    true_range_m: Floats  # (m,) from the radar
    along_m: Floats  # (m,) ground distance s along the approach from the runway's centre, 50 000 to 1500

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return int(self.plots.polar.shape[0])


def case_003(
    runs: int,
    seed: int = 0,
    *,
    gps: GpsParameters | None = None,
    radar: RadarParameters | None = None,
    gps_error: bool = True,
    missing: str | Iterable[str] = (),
    first_fix_s: float | None = None,
    random_phase: bool = False,
    abeam_deg: float | None = None,
    site: Site = DEMO_SITE,
) -> Case:
    """003's approach measured `runs` times.

    `gps_error=False` takes the constant error of the position source away. `missing` names components ("range",
    "azimuth", "elevation") that the radar never measures. `first_fix_s` (0.8) or `random_phase` move the times of the
    position source's reports, which else are valid at 0.13 s, 5.13 s and so on. `abeam_deg` (3) adds the plots of a
    second aircraft, turned about the radar by this angle; a positive angle is to the left. Raises ValueError for an
    unknown component. Source: 003, the case.
    """
    gps = _gps_parameters(gps or GpsParameters(), gps_error, first_fix_s, random_phase)
    radar = _radar_parameters(radar or RadarParameters(), missing)
    path, antenna = CasePath(), site.radars[0]
    sight, runway = RadarSight(site, antenna), RunwayFrame(site.runway)
    scans = scan_times(radar, 0.0, path.end_s)

    def plots_of(flown_path: Path, name: str) -> tuple[Flown, Floats, PlotsMeasured]:
        flown = fly(flown_path, site.runway, scans)
        position, velocity = sight.see(flown)
        return flown, position, measure_radar(radar, scans, position, velocity, stream(seed, "radar", name), (runs,))

    true, position, plots = plots_of(path, "aircraft")
    abeam = None
    if abeam_deg is not None:
        beside = Abeam(path, math.radians(abeam_deg), antenna.along_m, antenna.left_m)
        _, _, abeam = plots_of(beside, "abeam")
    generator = stream(seed, "gps")
    # a report whose phase puts it beyond the end is not there in any run
    valid = gps_times(gps, 0.0, path.end_s, gps_phases(gps, generator, (runs,)))
    measured = measure_gps(gps, valid, fly(path, site.runway, valid), generator)
    enu = runway.enu_from_geodetic(true.latitude_rad, true.longitude_rad, true.height_m)
    return Case(
        site=site,
        gps_parameters=gps,
        radar_parameters=radar,
        plot_s=scans,
        plots=plots,
        gps=measured,
        abeam=abeam,
        true=true,
        true_enu_m=enu,
        true_range_m=np.sqrt(np.sum(position * position, axis=-1)),
        along_m=-path.motion(scans).position[:, 0],
    )


def _gps_parameters(
    gps: GpsParameters, has_error: bool, first_fix_s: float | None, random_phase: bool
) -> GpsParameters:
    if not has_error:
        gps = replace(gps, error_east_m=0.0, error_north_m=0.0, error_up_m=0.0, error_sigma_m=0.0)
    if first_fix_s is not None:
        gps = replace(gps, phase_s=first_fix_s)
    return replace(gps, random_phase=True) if random_phase else gps


def _radar_parameters(radar: RadarParameters, missing: str | Iterable[str]) -> RadarParameters:
    names = [missing] if isinstance(missing, str) else list(missing)
    unknown = sorted(set(names) - set(COMPONENTS))
    if unknown:
        raise ValueError(f"a radar measures {', '.join(COMPONENTS)}, not {', '.join(unknown)}")
    always: Mapping[str, Any] = {f"missing_{name}": 1.0 for name in names}
    return replace(radar, **always)
