"""Gates of a stabilised approach: who is too high, too low, off the centreline, too fast or too slow, and for how long.

Over arrays of any approach, live or archived; `finals` is what is remembered of live ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.predict.approach import Deviations
from gateway.settings import Runway, Stabilised

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

KINDS = ("too high", "too low", "off centreline", "too fast", "too slow")
SPEEDS = KINDS[3:]
UPPER_M, LOWER_M = 304.8, 152.4  # 1000 and 500 ft, the most that the gates are by default
UPPER_S, LOWER_S = 83.0, 41.5  # and how long an airliner has from there to the runway
BEGINS_AFTER, ENDS_AFTER = 2, 3  # seconds in a row
ENDS_BELOW = 0.8  # of what is allowed
ON_FINAL_RAD = math.radians(10.0)  # seen from the aiming point, within this of the centreline
TOWARDS = math.cos(math.radians(30.0))  # of the course against the landing direction
CLIMBS_MPS = 1.5  # who climbs faster goes around


@dataclass(frozen=True, slots=True)
class Excess:
    """How far off (n, 5) approaches are, by kind: m, and m/s of the speed; and that over what is allowed: above 1 is too much.

    NaN where nothing is judged: above the upper gate, or not on the approach.
    """

    off: Floats
    ratio: Floats


def gate_heights(limits: Stabilised, runway: Runway, approach_mps: ArrayLike) -> tuple[Floats, Floats]:
    """The upper and the lower gate (n,), m above the runway, of who approaches at speeds (n,)."""
    sinks = np.asarray(approach_mps, dtype=np.float64) * math.tan(runway.glide_path_rad)
    given = ((UPPER_S, UPPER_M, limits.upper_gate_m), (LOWER_S, LOWER_M, limits.lower_gate_m))
    upper, lower = (
        np.minimum(time_s * sinks, most_m) if gate_m is None else np.full_like(sinks, gate_m)
        for time_s, most_m, gate_m in given
    )
    return upper, lower


def excess(
    limits: Stabilised,
    runway: Runway,
    distance_m: ArrayLike,
    above_m: ArrayLike,
    left_m: ArrayLike,
    speed_mps: ArrayLike,
    approach_mps: ArrayLike,
) -> Excess:
    """How far off each of n instants of approaches is: at `distance_m` (n,) from the threshold, above the glide path, left of the
    centreline, at speeds, and at the speed that it should approach at. NaN in = not known, NaN out.
    """
    distance, above, left, speed, wanted = (
        np.asarray(one, dtype=np.float64) for one in (distance_m, above_m, left_m, speed_mps, approach_mps)
    )
    before_aim = np.maximum(distance + runway.aiming_point_x_m - runway.threshold_x_m, 0.0)
    high = np.maximum(before_aim * math.tan(limits.glide_path_rad), limits.least_vertical_m)
    wide = np.maximum(before_aim * math.tan(limits.centreline_rad), limits.least_lateral_m)
    fast, slow = (
        np.maximum(np.maximum(share * wanted, limits.least_fast_mps), 0.1)
        for share in (limits.speed_share, limits.slow_share)
    )
    off = np.stack([above, -above, np.abs(left), speed - wanted, wanted - speed], axis=-1)
    ratio = off / np.stack([high, high, wide, fast, slow], axis=-1)
    height = before_aim * math.tan(runway.glide_path_rad) + above
    judged = height <= gate_heights(limits, runway, wanted)[0]
    return Excess(np.where(judged[..., None], off, math.nan), np.where(judged[..., None], ratio, math.nan))


def on_final(off: Deviations, velocity_mps: Floats) -> Bools:
    """Who (n,) is on final, of deviations (n,) and velocities (n, 3) in the runway frame: near the centreline, flying at the
    runway, and not going around.
    """
    along, left, up = np.moveaxis(velocity_mps, -1, 0)
    towards = along > TOWARDS * np.sqrt(along * along + left * left)
    return np.asarray((np.abs(off.lateral_rad) < ON_FINAL_RAD) & towards & (up < CLIMBS_MPS))


@dataclass(frozen=True, slots=True)
class Held:
    """An alert with hysteresis: seconds in a row beyond what is allowed, and within again; and whether it stands."""

    beyond: int = 0
    within: int = 0
    stands: bool = False

    def after(self, ratio: float) -> Held:
        """After one second more."""
        if not self.stands:
            beyond = self.beyond + 1 if ratio > 1.0 else 0
            return Held(beyond, 0, beyond >= BEGINS_AFTER)
        within = 0 if ratio >= ENDS_BELOW else self.within + 1  # NaN, nothing to judge, is within
        return Held(0, within, within < ENDS_AFTER)


@dataclass(frozen=True, slots=True)
class Alert:
    """A time in which an approach was not stabilised: from an index to the one at which it ended, and the worst of it."""

    kind: str
    begins: int
    ends: int
    worst: float  # m, or m/s


def alerts(found: Excess) -> list[Alert]:
    """The alerts of one approach, whose instants (n,) are a second apart."""
    told = []
    for place, kind in enumerate(KINDS):
        held, began = Held(), 0
        for row, ratio in enumerate(found.ratio[:, place].tolist()):
            now = held.after(ratio)
            if now.stands and not held.stands:
                began = row - BEGINS_AFTER + 1
            if held.stands and not now.stands:
                told.append(Alert(kind, began, row, float(np.nanmax(found.off[began : row + 1, place]))))
            held = now
        if held.stands:
            told.append(Alert(kind, began, len(found.ratio), float(np.nanmax(found.off[began:, place]))))
    return sorted(told, key=lambda one: one.begins)
