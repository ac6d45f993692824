"""A script staged at a site: vehicles on their ways, radars in their places, faults on those whom they befall."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from gateway.settings import DEMO_SITE, Site, SiteError
from sim.flown_way import FlownWay
from sim.overrides import SceneParameters, override, so_many
from sim.parameter_tables import with_fields
from sim.paths import Path
from sim.scene import LARGEST_SYSTEM, Aircraft, Scene, SceneRadar
from sim.scenes.placement import as_the_site_says, place_radars
from sim.scenes.schemes import SCHEMES
from sim.scenes.script import Script, Vehicle
from sim.scenes.ways import autopilots_way, beside, later, way_of
from sim.sensors import GpsParameters, ImuParameters, RadarParameters

FOLLOWING_S = 90.0  # from one aircraft to the next where a scene has more than are written


@dataclass(frozen=True, slots=True)
class _Placed:
    """A written vehicle with its number and its way."""

    vehicle: Vehicle
    system: int
    way: Path | FlownWay

    @property
    def word(self) -> str:
        """What it does, for people."""
        return self.vehicle.route if isinstance(self.vehicle.route, str) else "route"


def stage(
    script: Script,
    *,
    start_ns: int,
    site: Site | None = None,
    seed: int | None = None,
    changes: Iterable[str] = (),
    keys: Mapping[int, bytes] | None = None,
) -> Scene:
    """The scene of a script at a site (None: the script's, or the demo field), with changes such as "gps.period_s=1".

    `start_ns` is the session's beginning, ns since 1970 UTC; `keys` are those that radars sign with, by number. Raises
    OverrideError for a change that cannot be made, SiteError for a script that cannot be staged there.
    """
    site, seed = site or script.site or DEMO_SITE, script.seed if seed is None else seed
    placed = _placed(script, site, seed)
    written = SceneParameters(
        gps=with_fields(GpsParameters(), script.gps),
        radars=_radars(script, site),
        imu=with_fields(ImuParameters(), script.imu),
        say=with_fields(SceneParameters().say, script.say),
        duration_s=_duration_s(script, placed),
    )
    parameters = override(written, changes)
    site, radars = place_radars(site, parameters.radars)
    seen_from = (radars[0].site.along_m, radars[0].site.left_m) if radars else (0.0, 0.0)
    aircraft = _aircraft(script, placed, parameters, seen_from)
    if script.drawn is not None:
        aircraft += _drawn(script.drawn, parameters, site, seed, len(aircraft))
    _check_faults(script, aircraft, radars)
    return Scene(
        name=script.name,
        site=site,
        seed=seed,
        start_ns=start_ns,
        duration_s=parameters.duration_s,
        aircraft=tuple(aircraft),
        gps=parameters.gps,
        radars=tuple(replace(radar, key=(keys or {}).get(radar.site.number)) for radar in radars),
        say=parameters.say,
        imu=parameters.imu,
        faults=script.faults,
    )


def _placed(script: Script, site: Site, seed: int) -> list[_Placed]:
    taken = {one.system for one in script.vehicles}
    free = (number for number in range(1, LARGEST_SYSTEM + 1) if number not in taken)
    found = []
    for index, vehicle in enumerate(script.vehicles, 1):
        system = next(free) if vehicle.system is None else vehicle.system
        where = f"{script.origin}: [[vehicle]] {index}"
        if vehicle.autopilot:
            way: Path | FlownWay = autopilots_way(vehicle, script, site, seed, system, where)
        else:
            way = way_of(vehicle, site, seed, system, where)
        found.append(_Placed(vehicle, system, way))
    return found


def _duration_s(script: Script, placed: list[_Placed]) -> float:
    if script.duration_s is not None:
        return script.duration_s
    last_s = max((one.way.end_s for one in placed), default=math.inf)
    if script.drawn is not None or not math.isfinite(last_s):
        raise SiteError(f"{script.origin}: [scene] lacks duration_s: not all of its vehicles are gone some time.")
    return last_s


def _radars(script: Script, site: Site) -> tuple[RadarParameters, ...]:
    """One for each radar of the site, as the site says, and as many more as are written; what is written wins."""
    usual = so_many((RadarParameters(),), max(len(site.radars), len(script.radars), 1))
    known = [as_the_site_says(one, radar) for one, radar in zip(usual, site.radars, strict=False)]
    radars = [*known, *usual[len(known) :]]
    for index, said in enumerate(script.radars):
        radars[index] = with_fields(radars[index], said)
    return tuple(radars) if script.radar_count is None else so_many(tuple(radars), script.radar_count)


def _aircraft(
    script: Script, placed: list[_Placed], parameters: SceneParameters, seen_from: tuple[float, float]
) -> list[Aircraft]:
    """Those that are written; the first so many of them, or more that follow the last one, where a number is asked for."""
    asked = parameters.aircraft if script.drawn is None else None
    found = [
        Aircraft(
            one.system,
            beside(one.vehicle, one.way, seen_from),
            one.word,
            one.vehicle.craft,
            with_fields(parameters.gps, one.vehicle.gps) if one.vehicle.gps else None,
        )
        for one in placed
    ]
    if found and asked is not None:
        last, number = found[-1], max(one.system for one in found)
        more = range(1, asked - len(found) + 1)
        found += [replace(last, system=number + at, path=later(last.path, FOLLOWING_S * at)) for at in more]
        found = found[:asked]
    if placed and parameters.abeam_deg:
        one = replace(placed[0].vehicle, abeam_rad=math.radians(parameters.abeam_deg))
        number = max((known.system for known in found), default=0) + 1
        found.append(Aircraft(number, beside(one, placed[0].way, seen_from), "abeam"))
    return found


def _drawn(drawn: tuple[str, int], parameters: SceneParameters, site: Site, seed: int, after: int) -> list[Aircraft]:
    scheme, written = drawn
    count = written if parameters.aircraft is None else parameters.aircraft
    ways = SCHEMES[scheme](site, count, parameters.duration_s, seed)
    return [Aircraft(after + number, way, word) for number, (word, way) in enumerate(ways, 1)]


def _check_faults(script: Script, aircraft: list[Aircraft], radars: tuple[SceneRadar, ...]) -> None:
    """Raises SiteError for a fault of somebody who is not in the scene."""
    there = {"vehicle": {one.system for one in aircraft}, "radar": {one.site.number for one in radars}}
    for index, fault in enumerate(script.faults, 1):
        for word, number in (("vehicle", fault.vehicle), ("radar", fault.radar)):
            if number is not None and number not in there[word]:
                known = ", ".join(map(str, sorted(there[word]))) or "none"
                raise SiteError(f"{script.origin}: [[fault]] {index} befalls {word} {number}; there are: {known}.")
