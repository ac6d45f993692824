"""Where and when a way touched the runway, and how fast it sank there, told from the way alone.

A runway's height in a site file, a geoid and a source's height may be off by metres; what is sure is that after touchdown
the height no longer changes. So the level that the way rolls on is found first, and then when it came down to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.offline.way import Flown
from gateway.settings import Runway

Floats = NDArray[np.float64]

_SECOND = 1e9
_LEAST_MARGIN_M = 0.1  # above the level of the roll, where the way is taken to come down
_ROLL_S = 5.0  # without sinking or climbing: it rolls, or soon will
_LEVEL_MPS = 0.3
_ROWS = 4  # of those seconds, the fewest that tell a slope
_OFF_RUNWAY_M = 30.0  # higher or lower than the runway nothing rolls
_BEYOND_M = 500.0  # the ends of the runway, where something that landed may still roll
_SINKS_OVER_S = 2.0  # before touchdown, over which the sink rate is told


@dataclass(frozen=True, slots=True)
class Touchdown:
    """When (ns), where (m, along the landing direction and left of it, from the runway's centre), how fast (m/s)."""

    time: int
    along_m: float
    left_m: float
    past_threshold_m: float
    speed_mps: float
    sink_mps: float


def touchdown(runway: Runway, way: Flown, begin: int, end: int) -> Touchdown | None:
    """The touchdown between two instants (ns), None where the way does not come down and roll."""
    rows = (way.time >= begin) & (way.time <= end) & np.isfinite(way.place_m).all(axis=1)
    if np.count_nonzero(rows) < _ROWS:
        return None
    time = (way.time[rows] - begin) / _SECOND
    place, velocity = way.place_m[rows], way.velocity_mps[rows]
    rolls = _roll(runway, time, place)
    if rolls is None:
        return None
    until, height, noise = rolls
    margin = max(_LEAST_MARGIN_M, 3.0 * noise)
    over = np.flatnonzero((place[:, 2] > height + margin) & (time < until))
    if not len(over) or over[-1] + 1 >= len(time):
        return None
    last = int(over[-1])
    share = (place[last, 2] - height - margin) / (place[last, 2] - place[last + 1, 2])
    crossed = float(time[last] + share * (time[last + 1] - time[last]))
    sink = max(_sink(time, place[:, 2], crossed), 0.05)
    at = min(crossed + margin / sink, crossed + _SINKS_OVER_S, float(time[-1]))
    along, left = (float(np.interp(at, time, place[:, axis])) for axis in (0, 1))
    speed = float(np.interp(at, time, np.hypot(velocity[:, 0], velocity[:, 1])))
    return Touchdown(begin + round(at * _SECOND), along, left, along - runway.threshold_x_m, speed, sink)


def _roll(runway: Runway, time: Floats, place: Floats) -> tuple[float, float, float] | None:
    """When it surely rolls, at what height, and that height's noise (robust, 1 sigma), s and m; None where it never does.

    The first seconds in a row over which the height hardly changes may begin in the flare: the next as many tell the level.
    """
    beside = np.abs(place[:, 0]) > 0.5 * runway.length_m + _BEYOND_M
    near = ~beside & (np.abs(place[:, 2]) < _OFF_RUNWAY_M) & (place[:, 0] > runway.threshold_x_m)
    for row in np.flatnonzero(near).tolist():
        if time[row] + 2.0 * _ROLL_S > time[-1]:
            return None
        own = near & (time >= time[row]) & (time <= time[row] + _ROLL_S)
        if np.count_nonzero(own) < _ROWS or abs(float(np.polyfit(time[own], place[own, 2], 1)[0])) > _LEVEL_MPS:
            continue
        later = near & (time >= time[row] + _ROLL_S) & (time <= time[row] + 2.0 * _ROLL_S)
        if np.count_nonzero(later) < _ROWS:
            continue
        height = place[later, 2]
        middle = float(np.median(height))
        return float(time[row] + _ROLL_S), middle, 1.4826 * float(np.median(np.abs(height - middle)))
    return None


def _sink(time: Floats, height: Floats, until: float) -> float:
    """Metres a second downwards over the last seconds before an instant: from heights, which velocities lag behind."""
    own = (time >= until - _SINKS_OVER_S) & (time <= until)
    while np.count_nonzero(own) < 3 and not own[0]:
        own[int(np.flatnonzero(own)[0]) - 1 if own.any() else int(np.searchsorted(time, until)) - 1] = True
    return 0.0 if np.count_nonzero(own) < 2 else -float(np.polyfit(time[own], height[own], 1)[0])
