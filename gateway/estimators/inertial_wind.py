"""What accelerometers tell of how the wind changed while an aircraft flew.

Accelerometers and attitude give how the velocity over the ground changed; airspeed and attitude give the velocity through
the air. The difference is the wind. Three things keep the sum of accelerations from running away: the accelerometers' errors
turn with the aircraft, while the wind does not; before it began to move and after it came to rest it stood still; and an
aircraft that stands shows what its accelerometers show too much.

Deviation: 002-2 closes with one constant wind, which is what is left where nothing is told of accelerations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from gateway.estimators.inertial import EARTH_RATE_RADPS, from_angles, matrix
from gateway.estimators.tied_path import Knots, WindEvidence, at_times
from gateway.geodesy import STANDARD_GRAVITY_MPS2

Floats = NDArray[np.float64]

TILT_MPS_PER_SQRT_S = 0.23  # an attitude wrong by 0.3 degrees for ten seconds at a time
BIAS_SIGMA_MPS2 = 0.5  # of cheap accelerometers, before they are seen at rest
STANDS_SIGMA_MPS = 0.1
STANDS_SIGMA_MPS2 = 0.05  # of what is felt at rest: an attitude 0.3 degrees wrong
# Of the velocity through the air over a knot's time: sideslip, heading, gusts.
AIR_SIGMA_MPS, AIR_SIGMA_SHARE = 1.5, 0.03
_STANDS_FOR_S = 3.0
_STILL_MPS2, _STILL_RAD = 0.1, math.radians(0.5)  # at most: one sigma of the felt force, the span of roll and of pitch
_STILLEST_MPS2 = 0.03  # the noise of a cheap accelerometer: nothing is stiller
_BRAKES_MPS2 = 0.3  # what is felt at two rests may differ by so much, or one of them was none
_LOOKS_S = 180.0  # before lift-off and after touchdown, for when it stood
_GAP_SHARE = 3.0  # an interval so much longer than usual is one in which samples are missing
_UNKNOWN_MPS = 50.0  # an axis, of a velocity that nothing is known of


@dataclass(frozen=True, slots=True)
class Felt:
    """Specific force (n, 3) along the body's axes, m/s2, with roll, pitch and heading (n, 3), rad, at times (n,), s."""

    time_s: Floats
    force_mps2: Floats
    angles_rad: Floats

    def between(self, first_s: float, last_s: float) -> Felt:
        """The samples of a time."""
        rows = (self.time_s >= first_s) & (self.time_s <= last_s)
        return Felt(self.time_s[rows], self.force_mps2[rows], self.angles_rad[rows])


@dataclass(frozen=True, slots=True)
class Stands:
    """The last stretch before a flight, or the first after it, in which it stood still, s."""

    since_s: float
    until_s: float


def stands(felt: Felt, lift_off_s: float, touchdown_s: float) -> tuple[Stands | None, Stands | None]:
    """When it last stood before lift-off, and first after touchdown; None where it is not seen to."""
    before = felt.between(lift_off_s - _LOOKS_S, lift_off_s)
    after = felt.between(touchdown_s, touchdown_s + _LOOKS_S)
    first, last = _still(before, last=True), _still(after, last=False)
    if first is None or last is None:
        return first, last
    felt_at = [_too_much(felt.between(one.since_s, one.until_s)) for one in (first, last)]
    return first, last if np.abs(felt_at[1] - felt_at[0]).max() < _BRAKES_MPS2 else None


def _still(felt: Felt, *, last: bool) -> Stands | None:
    """The stretch of a few seconds nearest to the flight that is about as still as the stillest."""
    if len(felt.time_s) < 2:
        return None
    starts = np.arange(felt.time_s[0], felt.time_s[-1] - _STANDS_FOR_S, 0.5 * _STANDS_FOR_S)
    found: list[tuple[float, float]] = []
    for since in (starts[::-1] if last else starts).tolist():
        part = felt.between(since, since + _STANDS_FOR_S)
        if len(part.time_s) < 2 * _STANDS_FOR_S:
            continue
        shakes = float(part.force_mps2.std(axis=0).max())
        if shakes < _STILL_MPS2 and np.ptp(part.angles_rad[:, :2], axis=0).max() < _STILL_RAD:
            found.append((shakes, since))
    if not found:
        return None
    enough = max(2.0 * min(found)[0], _STILLEST_MPS2)
    since = next(since for shakes, since in found if shakes <= enough)
    return Stands(since, since + _STANDS_FOR_S)


def _too_much(felt: Felt) -> Floats:
    """What is felt beside gravity (3,), m/s2: of what stands, what its accelerometers show too much."""
    roll, pitch, _ = felt.angles_rad.mean(axis=0)
    down = np.array([-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)])
    return np.asarray(felt.force_mps2.mean(axis=0) + STANDARD_GRAVITY_MPS2 * down)


def wind_evidence(
    felt: Felt,
    stood: tuple[Stands | None, Stands | None],
    time_s: Floats,
    air_velocity_mps: Floats,
    knots: Knots,
    latitude_rad: float | None,
) -> WindEvidence:
    """What accelerations tell of the wind at the knots of a path with air velocities (n, 2) at times (n,).

    Unknown beside the wind: the velocity over the ground at the beginning, how its error wanders, and what each accelerometer
    shows too much. They are taken out of the equations again, so that what is returned is of the wind alone.
    """
    before, after = stood
    first = time_s[0] if before is None else before.until_s
    last = time_s[-1] if after is None else after.since_s
    part = felt.between(first, last)
    velocity, by_bias = _gained(part, time_s, air_velocity_mps, latitude_rad)
    drift = Knots(float(part.time_s[0]), (last - first) / knots.count, knots.count)
    count = knots.count + 1
    unknowns = _Unknowns(count)
    wanders = np.sqrt(_variance_by_knot(part, drift))
    sigma_mps = np.hypot(AIR_SIGMA_MPS, AIR_SIGMA_SHARE * np.linalg.norm(air_velocity_mps, axis=1).mean())
    shares = knots.hats(time_s)
    means = shares / shares.sum(axis=0)  # what is compared at a knot: the mean about it
    gained = at_times(time_s, part.time_s, velocity)
    shown = at_times(time_s, part.time_s, by_bias.reshape(len(by_bias), 6)).reshape(-1, 2, 3)
    for axis in (0, 1):
        wind = np.zeros((count, unknowns.size))
        wind[:, unknowns.wind(axis)] = means.T @ shares
        wind[:, unknowns.drift(axis)] = -means.T @ drift.hats(time_s)
        wind[:, unknowns.bias] = -means.T @ shown[:, axis]
        unknowns.add(wind, means.T @ (gained - air_velocity_mps)[:, axis], sigma_mps)
        steps = np.zeros((count - 1, unknowns.size))
        steps[:, unknowns.drift(axis)] = np.diff(np.eye(count), axis=0)
        unknowns.add(steps, np.zeros(count - 1), wanders)
        begins = np.zeros((1, unknowns.size))
        begins[0, unknowns.drift(axis).start] = 1.0
        unknowns.add(begins, np.zeros(1), _UNKNOWN_MPS if before is None else STANDS_SIGMA_MPS)
        if after is not None:
            ends = np.zeros((1, unknowns.size))
            ends[0, unknowns.drift(axis).stop - 1] = 1.0
            ends[0, unknowns.bias] = by_bias[-1, axis]
            unknowns.add(ends, -velocity[-1:, axis], STANDS_SIGMA_MPS)
    biases = np.zeros((3, unknowns.size))
    biases[:, unknowns.bias] = np.eye(3)
    unknowns.add(biases, np.zeros(3), BIAS_SIGMA_MPS2)
    for one in stood:
        if one is not None:
            _at_rest(unknowns, felt.between(one.since_s, one.until_s))
    return unknowns.of_wind()


class _Unknowns:
    """Normal equations of the wind at knots, of the error of the summed velocity at as many, and of three biases."""

    def __init__(self, count: int) -> None:
        self.size = 4 * count + 3
        self._count = count
        self._information = np.zeros((self.size, self.size))
        self._vector = np.zeros(self.size)
        self.bias = slice(4 * count, self.size)

    def wind(self, axis: int) -> slice:
        """Where the wind of an axis is."""
        return slice(axis * self._count, (axis + 1) * self._count)

    def drift(self, axis: int) -> slice:
        """Where the error of the summed velocity of an axis is."""
        return slice((2 + axis) * self._count, (3 + axis) * self._count)

    def add(self, rows: Floats, values: Floats, sigma: Floats | float) -> None:
        """Equations (m, size), with 1 sigma for all or (m,)."""
        weights = 1.0 / np.broadcast_to(sigma, values.shape) ** 2
        self._information += rows.T @ (rows * weights[:, None])
        self._vector += rows.T @ (values * weights)

    def of_wind(self) -> WindEvidence:
        """What they tell of the wind, whatever the others are."""
        own, rest = slice(0, 2 * self._count), slice(2 * self._count, self.size)
        across = self._information[own, rest]
        factor = cho_factor(self._information[rest, rest])
        return WindEvidence(
            self._information[own, own] - across @ cho_solve(factor, across.T),
            self._vector[own] - across @ cho_solve(factor, self._vector[rest]),
        )


def _gained(felt: Felt, time_s: Floats, air_velocity_mps: Floats, latitude_rad: float | None) -> tuple[Floats, Floats]:
    """Velocity gained over the ground since the first sample, east and north (n, 2) m/s, and by each bias (n, 2, 3) s."""
    level_from_body = matrix(from_angles(*felt.angles_rad.T))[:, 1::-1]
    level = (level_from_body @ felt.force_mps2[..., None])[..., 0]
    if latitude_rad is not None:  # the earth turns below: a metre a second in a quarter of an hour at 20 m/s
        turns = 2.0 * EARTH_RATE_RADPS * math.sin(latitude_rad)
        east, north = (np.interp(felt.time_s, time_s, axis, left=0.0, right=0.0) for axis in air_velocity_mps.T)
        level += turns * np.stack([north, -east], axis=-1)
    return _summed(felt.time_s, level), _summed(felt.time_s, level_from_body)


def _summed(time_s: Floats, rates: Floats) -> Floats:
    """The integral from 0 by the trapezoid rule, over the first axis."""
    lengths = np.diff(time_s).reshape(-1, *[1] * (rates.ndim - 1))
    return np.concatenate(
        [np.zeros((1, *rates.shape[1:])), np.cumsum(0.5 * (rates[1:] + rates[:-1]) * lengths, axis=0)]
    )


def _variance_by_knot(felt: Felt, knots: Knots) -> Floats:
    """By how much the summed velocity wanders between knots (count,), (m/s)2: a tilt, and what samples miss.

    What a sample shows that its neighbours do not is vibration, or a gust shorter than the interval: it adds up as noise.
    Where samples are missing all of what is felt is.
    """
    lengths = np.diff(felt.time_s)
    usual = float(np.median(lengths))
    bends = np.diff(felt.force_mps2, n=2, axis=0)
    noise = float(np.sqrt(np.mean(bends**2) / 6.0))
    missed = np.where(lengths > _GAP_SHARE * usual, felt.force_mps2.std(axis=0).max(), noise)
    at = 0.5 * (felt.time_s[1:] + felt.time_s[:-1])
    of = np.clip(((at - knots.first_s) / knots.step_s).astype(np.intp), 0, knots.count - 1)
    sums = np.bincount(of, weights=(missed * lengths) ** 2, minlength=knots.count)
    return np.asarray(sums + TILT_MPS_PER_SQRT_S**2 * knots.step_s)


def _at_rest(unknowns: _Unknowns, felt: Felt) -> None:
    """What stands feels gravity alone."""
    rows = np.zeros((3, unknowns.size))
    rows[:, unknowns.bias] = -np.eye(3)
    unknowns.add(rows, _too_much(felt), STANDS_SIGMA_MPS2)
