"""Registration of a recording: the errors of its radars that explain its pairs, and what they are worth. Source: 004."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import registration_evidence as evidence
from gateway.estimators import registration_solution as solution
from gateway.estimators.registration import LITERAL, Errors, Method, Pairs, register
from gateway.estimators.registration_frames import System, per_metre
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, polar_jacobian, turn
from gateway.fuse.weighting import polar_difference
from gateway.offline.pairing import Gathering
from gateway.register.verdicts import NAMES, PRIOR_CHI_SQUARE, Verdict
from gateway.settings import RadarSite, Site, with_radar

Floats = NDArray[np.float64]

LEAST_PAIRS = 10


@dataclass(frozen=True, slots=True)
class Result:
    """What a recording tells of its radars: verdicts of each, and how good the whole is."""

    radars: dict[int, tuple[Verdict, ...]]
    source_m: tuple[float, float, float]  # by which all position sources say too much: east, north, up
    source_sigma_m: tuple[float, float, float]
    own_sigma_m: float
    pairs: int
    aircraft: tuple[str, ...]
    condition: float
    chi_square_per_freedom: float
    prior_chi_square: float

    @property
    def is_prior_wrong(self) -> bool:
        """Whether the position sources are further off together than was assumed; false where nothing was."""
        return self.prior_chi_square > PRIOR_CHI_SQUARE


def method_for(gathering: Gathering, system: System = "ecef", rounds: int = 2, *, literal: bool = False) -> Method:
    """As printed; else whitened and robust, with the radars' times, and with own errors as large as the pairs show."""
    if literal:
        return replace(LITERAL, system=system, rounds=rounds)
    own_m = own_errors_m(gathering) if gathering.pairs else None
    return Method(system, rounds=rounds, with_time=True, own_sigma_m=own_m)


def registered(gathering: Gathering, method: Method) -> Result | None:
    """What the pairs tell; None where there are too few."""
    if len(gathering.pairs) < LEAST_PAIRS:
        return None
    numbers = sorted({pair.radar for pair in gathering.pairs})
    names = tuple(dict.fromkeys(pair.aircraft for pair in gathering.pairs))
    pairs = _columns(gathering, numbers, names)
    found = register(pairs, method)
    verdicts = {number: _verdicts(found, place, method) for place, number in enumerate(numbers)}
    return _result(found, pairs, verdicts, names, method)


def site_with(site: Site, radars: Mapping[int, RadarSite], result: Result) -> Site:
    """The site with what was found of its radars, to be taken off from now on; what was not found stays as it was."""
    for number, verdicts in result.radars.items():
        radar = radars[number]
        found = {verdict.name: verdict.value for verdict in verdicts if verdict.is_found}
        known = replace(
            radar,
            range_error_m=found.get("range", radar.range_error_m),
            azimuth_error_rad=found.get("azimuth", radar.azimuth_error_rad),
            elevation_error_rad=found.get("elevation", radar.elevation_error_rad),
            time_error_s=found.get("time", radar.time_error_s),
        )
        site = with_radar(site, known) if found else site
    return site


def _columns(gathering: Gathering, numbers: list[int], names: tuple[str, ...]) -> Pairs:
    frame, rows = RunwayFrame(gathering.site.runway), gathering.pairs
    place_of = {name: place for place, name in enumerate(names)}
    radar_of = {number: place for place, number in enumerate(numbers)}
    sites = [gathering.radars[number] for number in numbers]
    antennas = np.array([RadarFrame.of(site, frame).antenna_enu_m for site in sites])
    radars = np.stack(frame.geodetic_from_enu(antennas), axis=-1)
    which = np.array([radar_of[pair.radar] for pair in rows], dtype=np.intp)
    boresight = np.array([site.compass_boresight_rad for site in sites])[which]
    polar = np.array([pair.polar for pair in rows])
    polar[:, 1] = boresight - polar[:, 1]
    geodetic = np.array([pair.geodetic for pair in rows])[:, [1, 0, 2]]
    velocity = turn(frame.ecef_from_enu, np.array([pair.velocity_enu_mps for pair in rows]))
    return Pairs(
        radars,
        which,
        polar,
        np.array([pair.polar_sigma for pair in rows]),
        geodetic,
        np.array([pair.sigma_m for pair in rows]),
        velocity,
        np.array([place_of[pair.aircraft] for pair in rows], dtype=np.intp),
        np.broadcast_to([gathering.site.runway.latitude_rad, gathering.site.runway.longitude_rad], (len(numbers), 2)),
    )


def _verdicts(found: Errors, place: int, method: Method) -> tuple[Verdict, ...]:
    """True = measured + error, and azimuth to the left: what a radar measures too much has the other sign, but for azimuth."""
    each = 4 if method.with_time else 3
    first = each * place
    values = [-found.radar[place, 0], found.radar[place, 1], -found.radar[place, 2]]
    if method.with_time:
        values.append(-found.time_s[place])
    return tuple(
        Verdict(name, float(value), float(found.sigma[first + part]), bool(found.observable[first + part]))
        for part, (name, value) in enumerate(zip(NAMES, values, strict=False))
    )


def _result(
    found: Errors, pairs: Pairs, verdicts: dict[int, tuple[Verdict, ...]], names: tuple[str, ...], method: Method
) -> Result:
    per = per_metre(pairs.geodetic)
    east, north, up = (-found.source / per).tolist()
    sigma_e, sigma_n, sigma_u = (found.sigma[-3:] / per).tolist()
    return Result(
        radars=verdicts,
        source_m=(east, north, up),
        source_sigma_m=(sigma_e, sigma_n, sigma_u),
        own_sigma_m=method.own_sigma_m or math.nan,
        pairs=len(pairs.polar),
        aircraft=names,
        condition=float(found.condition),
        chi_square_per_freedom=float(found.chi_square) / max(found.freedom, 1),
        prior_chi_square=float(found.prior_chi_square),
    )


def own_errors_m(gathering: Gathering) -> float:
    """How large the constant error of each aircraft's own position source is, an axis, by how they differ."""
    frame = RunwayFrame(gathering.site.runway)
    frames = {number: RadarFrame.of(site, frame) for number, site in gathering.radars.items()}
    usual = gathering.site.position.systematic_m / math.sqrt(3.0)
    rows = gathering.pairs
    enu = frame.enu_from_geodetic(*np.array([pair.geodetic for pair in rows]).T)
    turns = np.array([frames[pair.radar].radar_from_enu for pair in rows])
    local = (turns @ (enu - np.array([frames[pair.radar].antenna_enu_m for pair in rows]))[..., None])[..., 0]
    by_enu = polar_jacobian(local) @ turns
    off = polar_difference(np.array([pair.polar for pair in rows]), polar_from_xyz(local))
    noise = by_enu * np.array([pair.sigma_m for pair in rows])[:, None, :]
    sigma = np.sqrt(np.array([pair.polar_sigma for pair in rows]) ** 2 + (noise * noise).sum(axis=-1))
    rates = (by_enu @ np.array([pair.velocity_enu_mps for pair in rows])[..., None])[..., 0]
    seen = evidence.Pairs([pair.aircraft for pair in rows], [pair.radar for pair in rows], off, sigma, by_enu, rates)
    found: solution.Solution | None = None
    for _ in range(2):  # the second time with less weight for what is far off
        found = solution.solved(evidence.learnt(evidence.Evidence(), seen, 0, found), usual)
    return usual if found is None else found.own_sigma_m
