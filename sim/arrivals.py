"""Synthetic arrivals for paper 002-7: flows that share a final, with gaps, wild points, and flights that follow none."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from gateway.offline.flows import Track

Floats = NDArray[np.float64]

FINAL_M = 28_000.0
SIZES, TIMES_S = (16, 9, 11, 8), (1045.0, 498.0, 813.0, 929.0)  # the paper's four flows
BEARINGS_DEG = (300.0, 0.0, 60.0, 240.0)  # from where each comes, seen from where the final begins
HEIGHTS_M = (5500.0, 2600.0, 4200.0, 5000.0)  # where each begins
GAPS, WILD = 0.3, 0.003  # the share of tracks with a gap, of points that are wild
FINAL_SPEED_MPS = 75.0


@dataclass(frozen=True, slots=True)
class Arrivals:
    """Tracks and the flow that each was made of."""

    tracks: tuple[Track, ...]
    labels: NDArray[np.int64]


def arrivals(
    seed: int,
    sizes: tuple[int, ...] = SIZES,
    bearings_deg: tuple[float, ...] = BEARINGS_DEG,
    heights_m: tuple[float, ...] = HEIGHTS_M,
    times_s: tuple[float, ...] = TIMES_S,
    level_above_final_m: tuple[float, ...] | None = None,
) -> Arrivals:
    """Flights of each flow, shuffled; a point a second. `level_above_final_m`: how much higher halfway than usual."""
    generator = np.random.default_rng(seed)
    made = []
    above = level_above_final_m or (0.0,) * len(sizes)
    kinds = zip(sizes, bearings_deg, heights_m, times_s, above, strict=True)
    for number, (size, bearing, height, time_s, higher) in enumerate(kinds):
        for _ in range(size):
            made.append((number, _flight(generator, math.radians(bearing), height, time_s, higher)))
    order = generator.permutation(len(made))
    tracks = tuple(Track(f"flight {place}", *made[one][1]) for place, one in enumerate(order))
    return Arrivals(tracks, np.array([made[one][0] for one in order]))


def _flight(
    generator: np.random.Generator, bearing: float, height_m: float, time_s: float, higher_m: float
) -> tuple[Floats, Floats]:
    """From its bearing onto the final along the x axis and down it; lateral and vertical scatter that lasts, gaps, damage."""
    final_s = FINAL_M / FINAL_SPEED_MPS
    before_s = time_s * (1.0 + 0.02 * generator.standard_normal()) - final_s
    length_m = before_s * 130.0
    joins = np.array([-FINAL_M, 0.0])
    away = np.array([-math.sin(bearing), math.cos(bearing)])
    bend = np.array([-1.0, 0.0]) * 6000.0 + 900.0 * generator.standard_normal(2) * [1.0, 0.4]
    begin = joins + bend + away * length_m + 1200.0 * generator.standard_normal(2)
    knots_s = np.array([0.0, 0.5 * before_s, 0.9 * before_s, before_s, before_s + final_s])
    halfway = 0.5 * (begin + joins + bend) + 900.0 * generator.standard_normal(2)
    points = np.array([begin, halfway, joins + bend, joins, [0.0, 0.0]])
    time = np.arange(0.0, knots_s[-1])
    level = PchipInterpolator(knots_s, points)(time)
    glide_m = FINAL_M * math.tan(math.radians(3.0))
    heights = np.array(
        [
            height_m + 120.0 * generator.standard_normal(),
            0.6 * height_m + 0.4 * glide_m + higher_m,
            glide_m,
            glide_m,
            0.0,
        ]
    )
    high = PchipInterpolator(knots_s, heights)(time)
    place = np.concatenate([level, high[:, None]], axis=1) + [30.0, 30.0, 8.0] * generator.standard_normal(
        (len(time), 3)
    )
    wild = generator.random(len(time)) < WILD
    place[wild, :2] += generator.uniform(20_000.0, 80_000.0, (np.count_nonzero(wild), 2))
    kept = np.ones(len(time), dtype=bool)
    if generator.random() < GAPS:
        since = int(generator.integers(50, max(int(before_s) - 60, 51)))
        kept[since : since + int(generator.integers(20, 90))] = False
    return time[kept] - time[-1], place[kept]
