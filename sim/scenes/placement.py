"""Where a scene's radars stand: those of the site, and more beside the runway where a scene has more."""

from __future__ import annotations

import math
from dataclasses import replace

from gateway.settings import RadarSite, Site, with_radar
from sim.scene import SceneRadar
from sim.sensors import RadarParameters

_BESIDE = ((300.0, 150.0), (-2500.0, -400.0), (2500.0, 600.0), (0.0, -3000.0))  # along, left of the runway's centre


def usual_radar(site: Site, number: int) -> RadarSite:
    """A radar of this number as it usually stands: facing the approach, 3 m high, beside the runway."""
    along_m, left_m = _BESIDE[(number - 1) % len(_BESIDE)]
    boresight = math.remainder(site.runway.landing_compass_rad + math.pi, 2.0 * math.pi)
    return RadarSite(number, along_m, left_m, 3.0, boresight)


def place_radars(site: Site, parameters: tuple[RadarParameters, ...]) -> tuple[Site, tuple[SceneRadar, ...]]:
    """The site with at least as many radars as there are parameters, and those that are in the scene."""
    placed = []
    for index, one in enumerate(parameters):
        known = site.radars[index] if index < len(site.radars) else None
        taken = {radar.number for radar in site.radars}
        free = next(number for number in range(index + 1, index + 2 + len(taken)) if number not in taken)
        radar = known or usual_radar(site, free)
        site = with_radar(site, radar) if known is None else site
        placed.append(SceneRadar(radar, one))
    return site, tuple(placed)


def as_the_site_says(parameters: RadarParameters, radar: RadarSite) -> RadarParameters:
    """Parameters as noisy and as far-reaching as the site says of its radar.

    Angles are taken to four digits: the 0.0573 degrees of a site file mean 1 mrad.
    """
    return replace(
        parameters,
        range_sigma_m=radar.range_sigma_m,
        azimuth_sigma_rad=float(f"{radar.azimuth_sigma_rad:.4g}"),
        elevation_sigma_rad=float(f"{radar.elevation_sigma_rad:.4g}"),
        maximum_range_m=radar.maximum_range_m,
    )
