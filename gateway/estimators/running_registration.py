"""Registration that runs along: what pairs tell of the errors of radars and position sources, fading with time.

A pair is an aircraft's report beside a radar's measurement of the same time. Compared at the radar, with true = measured + error,

    polar(report) - measured = radar's error - its time error x turning rates - derivatives x (common error + own error)

is linear in the errors. The position sources' common error and each aircraft's own one last as long as a flight: a thousand
reports of one aircraft do not make its own error smaller. So the equations of each aircraft are kept apart (their information
matrix and vector), its own error is eliminated, and how large own errors are is estimated from how they differ.

Parameters, in this order: of each radar its range m, azimuth rad (003's), elevation rad, time s; then the common error east,
north, up m. Source: 004 2. Deviation: own errors, times, fading.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

EACH = 4  # parameters of a radar
COMMON_SIGMA_M = 30.0  # prior of the position sources' common error, an axis
TIME_SIGMA_S = 0.5  # prior of a radar's time error
_RADAR_SIGMA = np.array([2000.0, 0.1, 0.1])  # priors so wide that they only keep the equations solvable
_OWN_LEAST_M = 1.0
_OWN_ROUNDS = 12
_OWN_FREEDOM = 3.0  # the prior of own errors' size weighs as much as one aircraft
_GONE = 0.02  # of its weight: an aircraft that tells less than this is forgotten
HUBER = 2.5  # a component further off than this counts less


@dataclass(frozen=True, slots=True)
class Pairs:
    """n pairs at about one time: aircraft, radar, and rows at the radar.

    `off`: (n, 3) the report's range m, azimuth rad, elevation rad less the measured ones, NaN = not measured. `sigma`: (n, 3) of
    that difference's noise. `by_enu`: (n, 3, 3) derivatives of range, azimuth, elevation by east, north, up. `rates`: (n, 3)
    how fast they change, NaN = not known.
    """

    aircraft: Sequence[str]
    radar: Sequence[int]
    off: Floats
    sigma: Floats
    by_enu: Floats
    rates: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What is known at `at` (ns): information (k, p + 3, p + 3) and vector (k, p + 3) of k aircraft, own errors last."""

    at: int = 0
    radars: tuple[int, ...] = ()
    aircraft: tuple[str, ...] = ()
    information: Floats = field(default_factory=lambda: np.zeros((0, 6, 6)))
    vector: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    count: Floats = field(default_factory=lambda: np.zeros(0))  # faded number of pairs of each aircraft


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Errors of the radars (r, 4), common error (3,), their covariance (p, p), and the size of own errors, m an axis."""

    radars: tuple[int, ...]
    error: Floats
    common_m: Floats
    covariance: Floats
    own_sigma_m: float

    @property
    def sigma(self) -> Floats:
        """Of the radars' errors, (r, 4)."""
        sigma = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.asarray(sigma[:-3].reshape(-1, EACH))


def faded(evidence: Evidence, at: int, time_constant_s: float) -> Evidence:
    """The evidence at a later time; aircraft of which next to nothing is left are forgotten."""
    if at <= evidence.at or not evidence.aircraft:
        return replace(evidence, at=max(at, evidence.at))
    share = math.exp(-(at - evidence.at) / 1e9 / time_constant_s)
    stays = np.flatnonzero(evidence.count * share > _GONE)
    return Evidence(
        at,
        evidence.radars,
        tuple(evidence.aircraft[place] for place in stays.tolist()),
        evidence.information[stays] * share,
        evidence.vector[stays] * share,
        evidence.count[stays] * share,
    )


def learnt(evidence: Evidence, pairs: Pairs, solution: Solution | None) -> Evidence:
    """The evidence with more pairs. Components that are far from what the last solution expects count less (Huber)."""
    evidence = _with_radars(evidence, pairs.radar)
    evidence = _with_aircraft(evidence, pairs.aircraft)
    size = EACH * len(evidence.radars) + 3
    rows = np.zeros((len(pairs.off), 3, size + 3))
    for place, radar in enumerate(pairs.radar):
        first = EACH * evidence.radars.index(radar)
        rows[place, :, first : first + 3] = np.eye(3)
        rows[place, :, first + 3] = -np.nan_to_num(pairs.rates[place])
    rows[:, :, size - 3 : size] = rows[:, :, size:] = -pairs.by_enu
    weight = _weights(rows[:, :, :size], pairs, evidence, solution)
    off = np.nan_to_num(pairs.off)
    by_pair = (rows * weight[..., None]).transpose(0, 2, 1) @ rows
    vectors = (rows * (weight * off)[..., None]).sum(axis=1)
    information, vector, count = evidence.information.copy(), evidence.vector.copy(), evidence.count.copy()
    place_of = {name: place for place, name in enumerate(evidence.aircraft)}
    places = np.array([place_of[name] for name in pairs.aircraft], dtype=np.intp)
    np.add.at(information, places, by_pair)
    np.add.at(vector, places, vectors)
    np.add.at(count, places, 1.0)
    return replace(evidence, information=information, vector=vector, count=count)


def solved(evidence: Evidence, own_sigma_m: float, common_sigma_m: float = COMMON_SIGMA_M) -> Solution | None:
    """The errors that the evidence tells; None without evidence. `own_sigma_m`: what own errors are expected to be, an axis."""
    if not evidence.aircraft:
        return None
    radars = len(evidence.radars)
    size = EACH * radars + 3
    prior = np.zeros(size)
    for radar in range(radars):
        prior[EACH * radar : EACH * radar + 3] = _RADAR_SIGMA**-2
        prior[EACH * radar + 3] = TIME_SIGMA_S**-2
    prior[-3:] = common_sigma_m**-2
    own = own_sigma_m
    for _ in range(_OWN_ROUNDS):
        error, covariance, spread = _eliminated(evidence, prior, own)
        known = _OWN_FREEDOM + 3.0 * len(evidence.aircraft)
        renewed = math.sqrt((_OWN_FREEDOM * own_sigma_m**2 + spread) / known)
        done = abs(renewed - own) < 1e-3 * own
        own = max(renewed, _OWN_LEAST_M)
        if done:
            break
    return Solution(evidence.radars, error[:-3].reshape(-1, EACH), error[-3:], covariance, own)


def _eliminated(evidence: Evidence, prior: Floats, own_m: float) -> tuple[Floats, Floats, float]:
    """Errors and covariance with own errors of this size eliminated; and the sum of squares of own errors that follows."""
    size = len(prior)
    shared, cross, own = (
        evidence.information[:, :size, :size],
        evidence.information[:, :size, size:],
        evidence.information[:, size:, size:] + np.eye(3) / own_m**2,
    )
    apart = np.linalg.inv(own)
    gain = cross @ apart
    information = (shared - gain @ cross.swapaxes(-1, -2)).sum(axis=0) + np.diag(prior)
    vector = (evidence.vector[:, :size] - (gain @ evidence.vector[:, size:, None])[..., 0]).sum(axis=0)
    scale = 1.0 / np.sqrt(np.diagonal(information))
    covariance = np.linalg.inv(information * scale[:, None] * scale) * scale[:, None] * scale
    covariance = 0.5 * (covariance + covariance.T)
    error = covariance @ vector
    mean = (apart @ (evidence.vector[:, size:] - (cross.swapaxes(-1, -2) @ error))[..., None])[..., 0]
    back = gain.swapaxes(-1, -2)
    spread = apart + back @ covariance @ back.swapaxes(-1, -2)
    return error, covariance, float((mean * mean).sum() + np.trace(spread, axis1=-2, axis2=-1).sum())


def _weights(rows: Floats, pairs: Pairs, evidence: Evidence, solution: Solution | None) -> Floats:
    """Of each component, 1 / variance; less where it is far off; nothing where it was not measured."""
    sigma = np.nan_to_num(pairs.sigma, nan=1.0)
    weight = np.where(np.isnan(pairs.off) | np.isnan(pairs.sigma), 0.0, sigma**-2.0)
    if solution is None or solution.radars != evidence.radars:
        return weight
    error = np.concatenate([solution.error.ravel(), solution.common_m])
    left = np.nan_to_num(pairs.off) - rows @ error
    by_own = pairs.by_enu * solution.own_sigma_m
    variance = sigma**2 + ((rows @ solution.covariance) * rows).sum(axis=-1) + (by_own * by_own).sum(axis=-1)
    distance = np.abs(left) / np.sqrt(variance)
    return weight * np.where(distance > HUBER, HUBER / np.maximum(distance, HUBER), 1.0)


def _with_radars(evidence: Evidence, numbers: Sequence[int]) -> Evidence:
    """The same with parameters for radars that are new."""
    radars = tuple(sorted({*evidence.radars, *numbers}))
    if radars == evidence.radars:
        return evidence
    size = EACH * len(radars) + 6
    known = [place for place, radar in enumerate(radars) if radar in evidence.radars]
    kept = np.array([EACH * place + part for place in known for part in range(EACH)] + list(range(size - 6, size)))
    information, vector = np.zeros((len(evidence.aircraft), size, size)), np.zeros((len(evidence.aircraft), size))
    information[:, kept[:, None], kept] = evidence.information
    vector[:, kept] = evidence.vector
    return replace(evidence, radars=radars, information=information, vector=vector)


def _with_aircraft(evidence: Evidence, names: Sequence[str]) -> Evidence:
    """The same with room for aircraft that are new."""
    new = [name for name in dict.fromkeys(names) if name not in evidence.aircraft]
    if not new:
        return evidence
    more = ((0, len(new)), (0, 0), (0, 0))
    return replace(
        evidence,
        aircraft=(*evidence.aircraft, *new),
        information=np.pad(evidence.information, more),
        vector=np.pad(evidence.vector, more[:2]),
        count=np.pad(evidence.count, more[:1]),
    )
