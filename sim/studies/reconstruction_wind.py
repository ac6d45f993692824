"""Paper 002-2 in a wind that changes: small aircraft, closed with one constant wind, and with accelerations as well.

Ten minutes of straights and turns at 20 m/s. The aircraft stands, rolls, flies, lands and stands again; its accelerometers are
cheap (each shows 0.3 m/s2 too much, one sigma), its attitude wanders by a fifth of a degree, its
heading shows one degree too much.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import from_angles, matrix
from gateway.frames import RunwayFrame
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from gateway.offline.carrying import Place
from gateway.offline.parameters import Parameters
from gateway.offline.reconstruction import How, Sortie, reconstructed
from gateway.settings import Runway
from sim.studies import Table

Floats = NDArray[np.float64]

RATE_HZ, SPEED_MPS = 50.0, 20.0
STANDS_S, ROLLS_S, FLIES_S = 15.0, 8.0, 600.0
WANDERS_MPS_PER_SQRT_S = 0.2  # the wind, an axis
GUSTS_MPS, GUSTS_FOR_S = 0.7, 4.0
BIAS_MPS2, NOISE_MPS2 = 0.3, 0.3
TILT_RAD, TILT_FOR_S = math.radians(0.2), 10.0
HEADING_RAD = math.radians(1.0)
START_NS = 1_700_000_000 * 10**9
LIFT_OFF: Place = (math.radians(47.0), math.radians(8.0))


@dataclass(frozen=True, slots=True)
class Windy:
    """One flight: what was told of it, and where it truly was, (n, 2) m from lift-off at times (n,) ns."""

    told: Parameters
    time: NDArray[np.int64]
    place_m: Floats
    end: Place


def windy(seed: int, wanders: float = WANDERS_MPS_PER_SQRT_S) -> Windy:
    """A flight in a wind that wanders so many m/s in a root second."""
    random = np.random.default_rng(seed)
    step = 1.0 / RATE_HZ
    time = np.arange(0.0, 2.0 * (STANDS_S + ROLLS_S) + FLIES_S, step)
    rolls, flies, lands = STANDS_S, STANDS_S + ROLLS_S, STANDS_S + ROLLS_S + FLIES_S
    share = np.interp(
        time, [rolls, flies, lands, lands + ROLLS_S], [0.0, 1.0, 1.0, 0.0]
    )  # of flying, on the ground less
    flying = np.clip(np.minimum(time - flies, lands - time) / 3.0, 0.0, 1.0)
    compass = _turning(random, time, flies + 5.0, lands - 5.0)
    wind = random.normal(0.0, 4.0, 2) + np.cumsum(random.normal(0.0, wanders * math.sqrt(step), (len(time), 2)), axis=0)
    wind += _wandering(random, time, GUSTS_MPS, GUSTS_FOR_S, 2)
    nose = np.stack([np.sin(compass), np.cos(compass)], axis=-1)
    ground = share[:, None] * SPEED_MPS * nose + flying[:, None] * wind
    place = np.cumsum(ground, axis=0) * step
    air = (
        np.sum((ground - flying[:, None] * wind) * nose, axis=1) + (1.0 - flying) * np.sum(-wind * nose, axis=1) * share
    )
    told = _told(random, time, compass, np.maximum(air, 0.0), ground)
    place = place - place[int(flies * RATE_HZ)]
    frame = RunwayFrame(Runway(*LIFT_OFF, height_m=0.0, landing_compass_rad=0.0))
    end = frame.geodetic_from_enu(np.append(place[int(lands * RATE_HZ)], 0.0))
    return Windy(told, _at(time), place, (float(end[0]), float(end[1])))


def rebuilt(flown: Windy, *, accelerations: bool) -> tuple[Sortie, Floats]:
    """The flight rebuilt, closed on its end, and its distance to the truth at its samples (n,), m."""
    (sortie,) = reconstructed(flown.told, How(lift_off=LIFT_OFF, close_on=flown.end, inertial=accelerations))
    place = np.stack([np.interp(sortie.time, flown.time, axis) for axis in flown.place_m.T], axis=-1)
    return sortie, np.linalg.norm(sortie.path_m - (place - place[0]), axis=1)


def table(runs: int, seed: int, figures: dict[str, float]) -> Table:
    """RMS distance to the truth in % of the length, and how often the truth is within 3 sigma."""
    rows = []
    for wanders, what in (
        (0.0, "is the same all the while"),
        (WANDERS_MPS_PER_SQRT_S, "wanders, 5 m/s in ten minutes"),
    ):
        shares: dict[str, list[float]] = {"one constant wind": [], "accelerations": []}
        inside: dict[str, list[float]] = {name: [] for name in shares}
        for number in range(runs):
            flown = windy(seed + number, wanders)
            for name in shares:
                sortie, off = rebuilt(flown, accelerations=name == "accelerations")
                shares[name].append(100.0 * math.sqrt(float(np.mean(off**2))) / sortie.length_m)
                inside[name].append(float(np.mean(off <= 3.0 * sortie.sigma_m + 1.0)))
        for name, values in shares.items():
            figures[f"wind {what}, {name}"] = float(np.median(values))
            rows.append((what, name, float(np.median(values)), max(values), 100.0 * float(np.mean(inside[name]))))
    columns = ("the wind", "closed by", "median, %", "worst, %", "within 3 sigma, %")
    return Table("002-2: small aircraft, RMS distance of the path, % of its length", columns, tuple(rows))


def _turning(random: np.random.Generator, time: Floats, since_s: float, until_s: float) -> Floats:
    """Headings: straights and turns of 10 degrees a second, either way."""
    rate = np.zeros(len(time))
    at = since_s
    while at < until_s:
        straight, turn = random.uniform(5.0, 30.0), random.uniform(5.0, 30.0)
        turning = (time >= at + straight) & (time < min(at + straight + turn, until_s))
        rate[turning] = random.choice([-1.0, 1.0]) * math.radians(10.0)
        at += straight + turn
    smooth = np.convolve(rate, np.ones(int(RATE_HZ)) / int(RATE_HZ), mode="same")
    return np.asarray(random.uniform(0.0, 2.0 * math.pi) + np.cumsum(smooth) / RATE_HZ)


def _wandering(random: np.random.Generator, time: Floats, sigma: float, for_s: float, width: int) -> Floats:
    """Noise (n, width) that forgets itself in `for_s`."""
    from scipy.signal import lfilter

    keeps = math.exp(-1.0 / (RATE_HZ * for_s))
    steps = random.normal(0.0, sigma * math.sqrt(1.0 - keeps**2), (len(time), width))
    whole = int(RATE_HZ)  # nothing that large follows what is shorter than a second
    return np.asarray(lfilter(np.ones(whole) / whole, [1.0], lfilter([1.0], [1.0, -keeps], steps, axis=0), axis=0))


def _told(
    random: np.random.Generator, time: Floats, compass: Floats, air_mps: Floats, ground_mps: Floats
) -> Parameters:
    """Accelerations at 50 Hz, attitude at 10, airspeed and pressure at 5."""
    acceleration = np.zeros((len(time), 3))
    acceleration[:, 1::-1] = np.gradient(ground_mps, 1.0 / RATE_HZ, axis=0)
    turns = air_mps * np.gradient(compass, 1.0 / RATE_HZ)  # it banks for its turns, and gusts push it about as it lies
    true = np.stack([np.arctan(turns / STANDARD_GRAVITY_MPS2), np.zeros(len(time)), compass], axis=-1)
    acceleration[:, 2] -= STANDARD_GRAVITY_MPS2
    body = (matrix(from_angles(*true.T)).transpose(0, 2, 1) @ acceleration[..., None])[..., 0]
    body += random.normal(0.0, BIAS_MPS2, 3)
    moving = air_mps[:, None] > 0.3 * SPEED_MPS
    body += np.where(moving, NOISE_MPS2, 0.02) * random.standard_normal(body.shape)
    lies = true.copy()
    lies[:, :2] += np.where(moving, _wandering(random, time, TILT_RAD, TILT_FOR_S, 2), 0.0)
    lies[:, 2] += HEADING_RAD
    told, at = Parameters(), _at(time)
    told.feel(1, at, body)
    told.attitude.extend(at[::5], lies[::5])
    seldom = slice(None, None, 10)
    count = len(at[seldom])
    airspeed = np.maximum(air_mps[seldom] + random.normal(0.0, 0.3, count), 0.0)
    told.airspeed.extend(at[seldom], np.stack([airspeed, np.full(count, math.nan)], axis=-1))
    told.pressure.extend(at[seldom], np.tile([101_325.0, math.nan], (count, 1)))
    return told


def _at(time_s: Floats) -> NDArray[np.int64]:
    return START_NS + np.round(time_s * 1e9).astype(np.int64)
