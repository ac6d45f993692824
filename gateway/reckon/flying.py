"""What an inertial unit would have told, of a vehicle with wings that tells none: from its attitude and its airspeed.

It turns as its attitude does, and moves through the air along its nose: that is the rate and the force of flight without
sideslip at a steady airspeed. What it does beside that is the noise of this unit, and airspeed, wind and positions tie it.
Source: 002-4; telemetry radios that tell attitude and air data, but few inertial samples or none, are not in the paper.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import matrix, product, turned_by
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from gateway.reckon.told import AIRSPEED, ATTITUDE, INERTIAL, Series, Told

Floats = NDArray[np.float64]

PAUSE_NS = 2_500_000_000  # between two attitudes: beyond it nobody knows how it turned; and so long an airspeed counts
PARTS = 6  # of what is between two attitudes: `cells.GAP_NS` lies between two samples at most
LISTENS_S = 10.0  # before it is said that no unit tells of a vehicle
FEWEST_HZ = 3.0  # samples of a unit that can be used
FORCE_NOISE = (1.5, 1.5, 1.5)  # m/s2 in a root Hz, along the body: gusts, thrust, and angles of attack that change
RATE_NOISE = (math.radians(0.2),) * 3  # rad/s in a root Hz
NOISE = np.array([*FORCE_NOISE, *RATE_NOISE])


def lacks_unit(told: Told) -> bool:
    """Whether a vehicle has told its attitude for a while, and of an inertial unit too little, or nothing."""
    lying, unit = told.series[ATTITUDE].at, told.series[INERTIAL].at
    span_s = int(lying[-1] - lying[0]) / 1e9 if len(lying) else 0.0
    return span_s >= LISTENS_S and len(told.series[AIRSPEED].at) > 0 and len(unit) < FEWEST_HZ * span_s


def with_flight(told: Told) -> Told:
    """The same with what a unit would have told, as it flies, in place of what one told."""
    series = list(told.series)
    series[INERTIAL] = flown(told.series[ATTITUDE], told.series[AIRSPEED])
    return replace(told, series=tuple(series), noise=NOISE)


def flown(attitudes: Series, airspeeds: Series) -> Series:
    """Samples as those of a unit: force, rate, sensor (n, 7), of what was told of attitude (n, 4) and indicated airspeed."""
    later = np.append(attitudes.at[1:] > attitudes.at[:-1], True)[: len(attitudes.at)]
    at, attitude = attitudes.at[later], attitudes.values[later]
    begin = np.flatnonzero(np.diff(at) <= PAUSE_NS)
    told = np.searchsorted(airspeeds.at, at[begin], side="right") - 1
    is_known = told >= 0
    is_known[is_known] = at[begin[is_known]] - airspeeds.at[told[is_known]] <= PAUSE_NS
    begin, speed = begin[is_known], airspeeds.values[told[is_known], 0]
    lasts_s = (at[begin + 1] - at[begin]) / 1e9
    turned = _rotation(product(attitude[begin] * [1.0, -1.0, -1.0, -1.0], attitude[begin + 1]))
    rate = turned / lasts_s[:, None]
    share = np.arange(PARTS + 1) / PARTS
    lies = product(attitude[begin][:, None], turned_by(turned[:, None] * share[:, None]))
    force = -STANDARD_GRAVITY_MPS2 * matrix(lies)[..., 2, :]
    force[..., 1] += (rate[:, 2] * speed)[:, None]
    force[..., 2] -= (rate[:, 1] * speed)[:, None]
    samples = np.ones((len(begin), PARTS + 1, 7))
    samples[..., :3], samples[..., 3:6] = force, rate[:, None]
    when = at[begin][:, None] + np.round(lasts_s[:, None] * share * 1e9).astype(np.int64)
    when[:, 0] += 1  # until it the rate was another
    return Series(when.ravel(), samples.reshape(-1, 7))


def _rotation(turned: Floats) -> Floats:
    """The rotation vectors (n, 3) of quaternions (n, 4)."""
    turned = turned * np.where(turned[:, :1] < 0.0, -1.0, 1.0)
    sine = np.sqrt(np.sum(turned[:, 1:] ** 2, axis=1))
    angle = 2.0 * np.arctan2(sine, turned[:, 0])
    return np.asarray(turned[:, 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 2.0)[:, None])
