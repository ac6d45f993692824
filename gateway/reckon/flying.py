"""What an inertial unit would have told, of a vehicle that tells where its nose points, and of no unit or too little.

It turns as its attitude does. What it feels is what vehicles of its kind do while nothing happens to them:

    wings     it moves through the air along its nose, without sideslip at the airspeed that it tells
    rotors    its thrust, along its mast, bears its weight: it is pushed to where it leans, and dragged (`estimators.medium`)
    others    nothing beside its weight: its speed stays, and its way turns with its nose (`estimators.medium`)

What happens beside that is the noise of this unit. Where no attitude is told, and a heading is, it is taken to lie level.
Source: 002-4; telemetry radios that tell attitude and air data, but few inertial samples or none, are not in the paper.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import from_angles, heading_rad, matrix, product, turned_by
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from gateway.reckon.kinds import HELD, HULLS, ROTORS, WHEELS, WINGS, By
from gateway.reckon.told import AIRSPEED, ATTITUDE, HEADING, INERTIAL, Series, Told

Floats = NDArray[np.float64]

PAUSE_NS = 2_500_000_000  # between two attitudes: beyond it nobody knows how it turned; and so long an airspeed counts
PARTS = 6  # of what is between two attitudes: `cells.GAP_NS` lies between two samples at most
LISTENS_S = 10.0  # before it is said that no unit tells of a vehicle
FEWEST_HZ, ENOUGH_HZ = 3.0, 4.0  # samples of a unit that can be used; and of one that could not be until now
STEEPEST = 0.3  # cosine: a mast that leans further does not bear the weight
RATE_NOISE = math.radians(0.2)  # rad/s in a root Hz
FORCE_NOISE = {  # m/s2 in a root Hz, along the body
    By.AIRSPEED: (1.5, 1.5, 1.5),  # gusts, thrust, and angles of attack that change
    By.WHEELS: (0.3, 0.1, 0.3),
    By.KEEL: (0.3, 0.1, 0.3),
    By.TILT: (0.6, 0.6, 1.5),  # gusts, and how it leaned between two attitudes
}


def lying(told: Told) -> Series:
    """A vehicle's attitudes; where it tells none, level ones by its headings."""
    attitudes, headings = told.series[ATTITUDE], told.series[HEADING]
    return _level(headings.at, headings.values[:, 0]) if len(headings.at) and not len(attitudes.at) else attitudes


def _level(at: NDArray[np.int64], heading_rad: Floats) -> Series:
    """Level attitudes."""
    flat = np.zeros(len(at))
    return Series(at, from_angles(flat, flat, heading_rad))


def carried_by(told: Told, vehicle_type: int | None, until_now: By = By.UNIT) -> By:
    """What carries a vehicle on, as it looks: a unit, unless it has told for a while how it lies and of a unit too little."""
    lies = lying(told).at
    span_s = int(lies[-1] - lies[0]) / 1e9 if len(lies) else 0.0
    least_hz = FEWEST_HZ if until_now == By.UNIT else ENOUGH_HZ  # at each change all begins anew
    if span_s < LISTENS_S or len(told.inertial.at) >= least_hz * span_s:
        return By.UNIT
    if vehicle_type in WINGS:
        return By.AIRSPEED if len(told.series[AIRSPEED].at) else By.UNIT
    if vehicle_type in ROTORS:
        return By.TILT if len(told.series[ATTITUDE].at) else By.UNIT
    if vehicle_type in WHEELS:
        return By.WHEELS
    return By.KEEL if vehicle_type in HULLS else By.UNIT


def with_unit(told: Told, by: By) -> Told:
    """The same with what a unit would have told, as it is carried on, in place of what one told."""
    if by == By.UNIT:
        return told
    series, lies = list(told.series), lying(told)
    if by in HELD:  # how it leans says nothing of where it goes
        lies = _level(lies.at, heading_rad(lies.values))
    series[ATTITUDE], series[INERTIAL] = lies, tilted(lies) if by == By.TILT else carried(lies)
    if by == By.AIRSPEED:
        series[INERTIAL] = flown(lies, told.series[AIRSPEED])
    turns = (0.0, 0.0, RATE_NOISE) if by in HELD else (RATE_NOISE,) * 3
    return replace(told, series=tuple(series), noise=np.array([*FORCE_NOISE[by], *turns]), by=by)


def flown(attitudes: Series, airspeeds: Series) -> Series:
    """Samples as those of a unit: force, rate, sensor (n, 7), of what was told of attitude (n, 4) and indicated airspeed."""
    between = _Between.of(attitudes)
    told = np.searchsorted(airspeeds.at, between.begin, side="right") - 1
    is_known = told >= 0
    is_known[is_known] = between.begin[is_known] - airspeeds.at[told[is_known]] <= PAUSE_NS
    between, speed = between.taken(is_known), airspeeds.values[told[is_known], 0]
    rate, force = between.rate_radps, -STANDARD_GRAVITY_MPS2 * between.lies()[..., 2, :]
    force[..., 1] += (rate[:, 2] * speed)[:, None]
    force[..., 2] -= (rate[:, 1] * speed)[:, None]
    return between.samples(force)


def carried(attitudes: Series) -> Series:
    """Samples as those of a unit that feels nothing but weight."""
    between = _Between.of(attitudes)
    return between.samples(-STANDARD_GRAVITY_MPS2 * between.lies()[..., 2, :])


def tilted(attitudes: Series) -> Series:
    """Samples as those of a unit that feels the thrust along a mast, so much that it bears the weight."""
    between = _Between.of(attitudes)
    upright = between.lies()[..., 2, 2]
    force = np.zeros((*upright.shape, 3))
    force[..., 2] = -STANDARD_GRAVITY_MPS2 / np.maximum(upright, STEEPEST)
    return between.samples(force)


@dataclass(frozen=True, slots=True, eq=False)
class _Between:
    """From which attitudes (n, 4) to the next ones it turned at which rates (n, 3), when, and for how long."""

    begin: NDArray[np.int64]
    lasts_s: Floats
    attitude: Floats
    turned: Floats  # rotation vectors, along the body

    @classmethod
    def of(cls, attitudes: Series) -> _Between:
        """All pairs of neighbours that are not too far apart."""
        later = np.append(attitudes.at[1:] > attitudes.at[:-1], True)[: len(attitudes.at)]
        at, attitude = attitudes.at[later], attitudes.values[later]
        begin = np.flatnonzero(np.diff(at) <= PAUSE_NS)
        turned = _rotation(product(attitude[begin] * [1.0, -1.0, -1.0, -1.0], attitude[begin + 1]))
        return cls(at[begin], (at[begin + 1] - at[begin]) / 1e9, attitude[begin], turned)

    def taken(self, which: NDArray[np.bool_]) -> _Between:
        """Some of them."""
        return _Between(self.begin[which], self.lasts_s[which], self.attitude[which], self.turned[which])

    @property
    def rate_radps(self) -> Floats:
        """Along the body (n, 3)."""
        return self.turned / self.lasts_s[:, None]

    def lies(self) -> Floats:
        """The attitudes on the way (n, PARTS + 1, 3, 3), from the body."""
        return matrix(product(self.attitude[:, None], turned_by(self.turned[:, None] * _SHARE[:, None])))

    def samples(self, force: Floats) -> Series:
        """With these forces (n, PARTS + 1, 3), as samples of a unit."""
        rate = self.rate_radps
        samples = np.ones((len(rate), PARTS + 1, 7))
        samples[..., :3], samples[..., 3:6] = force, rate[:, None]
        when = self.begin[:, None] + np.round(self.lasts_s[:, None] * _SHARE * 1e9).astype(np.int64)
        when[:, 0] += 1  # until it the rate was another
        return Series(when.ravel(), samples.reshape(-1, 7))


_SHARE = np.arange(PARTS + 1) / PARTS


def _rotation(turned: Floats) -> Floats:
    """The rotation vectors (n, 3) of quaternions (n, 4)."""
    turned = turned * np.where(turned[:, :1] < 0.0, -1.0, 1.0)
    sine = np.sqrt(np.sum(turned[:, 1:] ** 2, axis=1))
    angle = 2.0 * np.arctan2(sine, turned[:, 0])
    return np.asarray(turned[:, 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)[:, None])
