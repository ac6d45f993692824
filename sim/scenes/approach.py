"""Scenes of one aircraft, or several in trail: 003's approach, and the same flown down to a standstill."""

from __future__ import annotations

import math

from gateway.settings import Site
from sim.overrides import SceneParameters
from sim.paths import Abeam, CasePath, Delayed, Path
from sim.scene import Aircraft, Scene
from sim.scenes.placement import place_radars

FOLLOWING_S = 90.0  # from one aircraft to the next where there are several
ROLLED_OUT_S = 540.0  # the aircraft of `landing` has stood for a while then


def approach_parameters() -> SceneParameters:
    """003's case."""
    return SceneParameters(duration_s=CasePath().end_s)


def landing_parameters() -> SceneParameters:
    """003's case with a longer end."""
    return SceneParameters(duration_s=ROLLED_OUT_S)


def approach(site: Site, parameters: SceneParameters, seed: int, start_ns: int) -> Scene:
    """003's approach: distances count from the runway's centre, and it ends 1500 m from there.

    Source: 003, the case.
    """
    return _one_aircraft("approach", CasePath(), site, parameters, seed, start_ns)


def landing(site: Site, parameters: SceneParameters, seed: int, start_ns: int) -> Scene:
    """The same approach flown to the threshold of this site's runway, on its glide path, flared, rolled out.

    Deviation: 003's distances count from the runway's centre; counted from the threshold the aircraft can
    land.
    """
    return _one_aircraft("landing", CasePath.landing(site.runway), site, parameters, seed, start_ns)


def _one_aircraft(name: str, path: Path, site: Site, parameters: SceneParameters, seed: int, start_ns: int) -> Scene:
    site, radars = place_radars(site, parameters.radars)
    aircraft = [Aircraft(1 + place, Delayed(path, FOLLOWING_S * place)) for place in range(parameters.aircraft)]
    if parameters.abeam_deg:
        seen_from = radars[0].site if radars else None
        about = (seen_from.along_m, seen_from.left_m) if seen_from else (0.0, 0.0)
        beside = Abeam(path, math.radians(parameters.abeam_deg), *about)
        aircraft.append(Aircraft(1 + len(aircraft), beside, "abeam"))
    return Scene(
        name=name,
        site=site,
        seed=seed,
        start_ns=start_ns,
        duration_s=parameters.duration_s,
        aircraft=tuple(aircraft),
        gps=parameters.gps,
        radars=radars,
        say=parameters.say,
    )
