"""What carries a path through the air over the ground: its end, places that are known, and accelerations."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import flight_path as paths
from gateway.estimators.inertial_wind import Felt, stands, wind_evidence
from gateway.estimators.tied_path import Knots, Known, Tied, WindEvidence, tied
from gateway.frames import RunwayFrame
from gateway.offline.parameters import Times
from gateway.settings import Runway

Floats = NDArray[np.float64]
Place = tuple[float, float]  # latitude, longitude, rad
Muted = tuple[tuple[int, int], ...]  # times, ns, of which nothing is used

END_SIGMA_M = 1.0  # of a place on which a path is closed
USUAL_SIGMA_M = 3.0  # of a position whose stream does not say
GAP_S = 10.0  # a longer silence is not integrated over
FELT_HZ = 5.0  # accelerations that come less often on average tell nothing
TELLS_SHARE = 0.8  # of the sigma without: accelerations that leave more (vibration, few samples) do not bend the wind
_FIXES_APART_NS = SECOND


@dataclass(frozen=True, slots=True)
class Closed:
    """The path (n, 2) m as the wind (n, 2) m/s carried it, with 1 sigma (n,) an axis, m."""

    path_m: Floats
    wind_mps: Floats
    sigma_m: Floats


def carried(
    time_s: Floats,
    path_m: Floats,
    target_m: Floats | None,
    fixes: Known | None,
    evidence: WindEvidence | None,
    usual_end: bool,
) -> Closed | Tied:
    """The path through the air, carried by the wind: by fixes, by its end, or, where nothing tells, not at all.

    Where fixes tell, that it came back to where it lifted off is no more than a guess; a place that was given is one of them.
    """
    ends = None if target_m is None else ending(time_s, target_m)
    if fixes is not None:
        return tied(time_s, path_m, fixes if ends is None or usual_end else fixes.and_also(ends), evidence)
    if ends is None or target_m is None:
        return Closed(path_m, np.full(path_m.shape, math.nan), np.full(len(time_s), math.nan))
    usual = tied(time_s, path_m, ends)
    if evidence is not None:
        found = tied(time_s, path_m, ends, evidence)
        if found.sigma_m.max() < TELLS_SHARE * usual.sigma_m.max():
            return found
    path, wind = paths.closed(time_s, path_m, target_m)
    return Closed(path, np.broadcast_to(wind, path.shape), usual.sigma_m)


def ending(time_s: Floats, target_m: Floats) -> Known:
    """That the path ends at a place (2,), m."""
    return Known.places(time_s[-1:], target_m[None], np.array([END_SIGMA_M]))


def together(one: Known | None, other: Known | None) -> Known | None:
    """Both, or which of them there is."""
    if one is None or other is None:
        return other if one is None else one
    return one.and_also(other)


def tying(time_s: Floats, path_m: Floats, sure: Known | None, evidence: WindEvidence | None) -> Callable[[Known], Tied]:
    """Ties the path to what is sure and to something else."""
    return lambda known: tied(time_s, path_m, known if sure is None else sure.and_also(known), evidence)


def evidence_of(felt: Felt, time_s: Floats, velocity_mps: Floats, lift_off: Place | None) -> WindEvidence | None:
    """What accelerations tell of the wind; None where they were not told all the while."""
    part = felt.between(float(time_s[0]), float(time_s[-1]))
    if len(part.time_s) < FELT_HZ * (time_s[-1] - time_s[0]) or np.diff(part.time_s).max() > GAP_S:
        return None
    if max(felt.time_s[0] - time_s[0], time_s[-1] - felt.time_s[-1]) > 0.0:
        return None
    stood = stands(felt, float(time_s[0]), float(time_s[-1]))
    latitude = None if lift_off is None else lift_off[0]
    return wind_evidence(felt, stood, time_s, velocity_mps, Knots.over(time_s), latitude)


def fixes_of(places: tuple[Times, Floats], time: Times, lift_off: Place, muted: Muted) -> Known | None:
    """The positions that may tie the path, at most one a second; None where there are none."""
    told_at, values = places
    good = (told_at >= time[0]) & (told_at <= time[-1])
    for since, until in muted:
        good &= ~((told_at >= since) & (told_at < until))
    second = told_at // _FIXES_APART_NS
    good &= np.concatenate([[True], second[1:] != second[:-1]])
    if not good.any():
        return None
    sigma = np.where(np.isnan(values[good, 4]), USUAL_SIGMA_M, values[good, 4])
    return Known.places((told_at[good] - time[0]) * 1e-9, level_m(values[good, 0], values[good, 1], lift_off), sigma)


def level_m(latitude_rad: Floats, longitude_rad: Floats, lift_off: Place) -> Floats:
    """East and north (n, 2) of lift-off, m, of places on the ellipsoid."""
    return frame_at(lift_off).enu_from_geodetic(latitude_rad, longitude_rad, np.zeros_like(latitude_rad))[..., :2]


def frame_at(lift_off: Place) -> RunwayFrame:
    """East, north and up at a place on the ellipsoid."""
    return RunwayFrame(Runway(*lift_off, height_m=0.0, landing_compass_rad=0.0))


def on_plane(place_m: Floats) -> Floats:
    """Places (..., 2) m along the earth as points (..., 3) of the frame at lift-off: the earth curves away from its plane."""
    return np.concatenate([place_m, -np.sum(place_m**2, axis=-1, keepdims=True) / (2.0 * paths.EARTH_M)], axis=-1)
