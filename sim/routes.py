"""Routes through points: coordinated turns of bounded bank, climbs, descents and speed changes, as smooth
functions of time.

The ground track is made of straights and turns that roll in at a bounded rate (clothoid, arc, clothoid) and
touch both legs of a corner. Between points the square of the speed and the height are linear in the distance
flown, so accelerations and gradients are constant; gradients are rounded out over `ROUND_OUT_M`. The result
is sampled each half second and held as cubic splines: position, velocity and acceleration are one function
and its derivatives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d

from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.paths import Motion

Floats = NDArray[np.float64]

BANK_RAD = math.radians(25.0)
ROLL_RATE_RADPS = math.radians(5.0)
ROUND_OUT_M = 600.0
_STEP_M = 5.0  # of the table along the track
_KNOT_S = 0.5  # of the splines
_SHARPEST_RAD = math.radians(170.0)


@dataclass(frozen=True, slots=True)
class RoutePoint:
    """A corner of a route on the ground plan (m) and the height above the runway and speed to have there.

    A speed of 0 stands for stopping there; it can only be the last.
    """

    x_m: float
    y_m: float
    height_m: float
    speed_mps: float


class RoutePath:
    """A route flown from `start_s` on; after the last point the aircraft is gone, or stands if it stopped."""

    def __init__(self, points: Sequence[RoutePoint], start_s: float = 0.0) -> None:
        """Raises ValueError where corners are too near to each other for turns at their speeds."""
        time, track, self.passes_s = _fly_track(points)
        stops = points[-1].speed_mps == 0.0
        rest = (1, np.zeros(3)) if stops else "not-a-knot"
        self._position = CubicSpline(time, track, bc_type=("not-a-knot", rest))
        self._velocity, self._acceleration = self._position.derivative(1), self._position.derivative(2)
        self._start_s, self._flown_s, self._stops = start_s, float(time[-1]), stops

    @property
    def start_s(self) -> float:
        """When it sets out."""
        return self._start_s

    passes_s: Floats
    """When each point of the route is passed (of a corner: the middle of its turn), s after setting out."""

    @property
    def flown_s(self) -> float:
        """How long it takes to the last point."""
        return self._flown_s

    @property
    def end_s(self) -> float:
        """When it reaches the last point; never where it stops there."""
        return math.inf if self._stops else self._start_s + self._flown_s

    def starting_at(self, start_s: float) -> RoutePath:
        """The same route, flown at another time."""
        other = object.__new__(RoutePath)
        other.__dict__.update(self.__dict__, _start_s=start_s)
        return other

    def motion(self, time_s: ArrayLike) -> Motion:
        """Position, velocity, acceleration at times (...), seconds of the scene."""
        flown = np.asarray(time_s, dtype=np.float64) - self._start_s
        within = np.clip(flown, 0.0, self._flown_s)
        moves = (flown < self._flown_s)[..., None] | (not self._stops)
        velocity = np.where(moves, self._velocity(within), 0.0)
        return Motion(self._position(within), velocity, np.where(moves, self._acceleration(within), 0.0))


@dataclass(frozen=True, slots=True)
class _Curve:
    """Curvature (left is positive) along a track, linear between stations (n,) m; headings (n,) rad there."""

    station: Floats
    curvature: Floats
    heading: Floats

    @classmethod
    def of(cls, lengths: Sequence[float], curvatures: Sequence[float], heading: float) -> _Curve:
        """From the lengths of pieces (n,) and the curvatures at their ends (n + 1,)."""
        length, curvature = np.asarray(lengths), np.asarray(curvatures)
        turned = np.concatenate([[0.0], np.cumsum(0.5 * length * (curvature[:-1] + curvature[1:]))])
        return cls(np.concatenate([[0.0], np.cumsum(length)]), curvature, heading + turned)

    def heading_at(self, station: Floats) -> Floats:
        """Heading (...) at stations (...), the exact integral of the curvature."""
        piece = np.clip(np.searchsorted(self.station, station, side="right") - 1, 0, len(self.station) - 2)
        along = station - self.station[piece]
        length = np.maximum(self.station[piece + 1] - self.station[piece], 1e-12)
        growth = (self.curvature[piece + 1] - self.curvature[piece]) / length
        return self.heading[piece] + along * (self.curvature[piece] + 0.5 * growth * along)

    def track(self, start: Floats) -> tuple[Floats, Floats]:
        """Stations (m,) every 5 m, the last one on the end, and positions (m, 2) there, by Simpson's rule."""
        total = self.station[-1]
        station = np.append(np.arange(0.0, total - 0.5 * _STEP_M, _STEP_M), total)
        step = np.diff(station)
        ends, middles = self.heading_at(station), self.heading_at(station[:-1] + 0.5 * step)
        moves = [step / 6.0 * (part(ends[:-1]) + 4.0 * part(middles) + part(ends[1:])) for part in (np.cos, np.sin)]
        return station, start + np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack(moves, axis=-1), axis=0)])


def _turn(angle_rad: float, speed_mps: float) -> tuple[list[float], list[float], float]:
    """A turn (left positive): piece lengths (3,), curvatures (4,), how far before the corner it begins."""
    if abs(angle_rad) < 1e-9:
        return [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], 0.0
    curvature = STANDARD_GRAVITY_MPS2 * math.tan(BANK_RAD) / speed_mps**2
    rolling_m = speed_mps * BANK_RAD / ROLL_RATE_RADPS
    if abs(angle_rad) < curvature * rolling_m:  # too short to reach the full bank
        shorter_m = math.sqrt(abs(angle_rad) * rolling_m / curvature)
        curvature, rolling_m = curvature * shorter_m / rolling_m, shorter_m
    arc_m = max(abs(angle_rad) / curvature - rolling_m, 0.0)
    signed = math.copysign(curvature, angle_rad)
    lengths, curvatures = [rolling_m, arc_m, rolling_m], [0.0, signed, signed, 0.0]
    _, track = _Curve.of(lengths, curvatures, 0.0).track(np.zeros(2))
    return lengths, curvatures, abs(float(track[-1, 1])) / math.sin(abs(angle_rad))


def _curve_through(points: Sequence[RoutePoint]) -> tuple[_Curve, list[float]]:
    """The curve of a route, and the station of each point (of a corner: the middle of its turn)."""
    corners = np.array([[point.x_m, point.y_m] for point in points])
    legs = np.diff(corners, axis=0)
    length = np.hypot(legs[:, 0], legs[:, 1])
    heading = np.arctan2(legs[:, 1], legs[:, 0])
    lengths: list[float] = []
    curvatures, stations, used = [0.0], [0.0], 0.0
    for index in range(1, len(points) - 1):
        angle = math.remainder(heading[index] - heading[index - 1], 2.0 * math.pi)
        if abs(angle) > _SHARPEST_RAD:
            raise ValueError(f"route point {index} turns back on itself: put another corner between")
        # no faster than this between the neighbours, so the bank stays within its bound all the way
        fastest = max(point.speed_mps for point in points[index - 1 : index + 2])
        pieces, bends, tangent = _turn(angle, fastest)
        straight = length[index - 1] - used - tangent
        if straight < 0.0:
            raise ValueError(f"points {index - 1} and {index} of the route are too near for turns at {fastest:g} m/s")
        stations.append(sum(lengths) + straight + 0.5 * sum(pieces))
        lengths += [straight, *pieces]
        curvatures += [0.0, *bends[1:]]
        used = tangent
    lengths.append(length[-1] - used)
    if lengths[-1] <= 0.0:
        raise ValueError("the last two points of the route are too near to each other for the turn between them")
    return _Curve.of(lengths, [*curvatures, 0.0], float(heading[0])), [*stations, sum(lengths)]


def _fly_track(points: Sequence[RoutePoint]) -> tuple[Floats, Floats, Floats]:
    """Times (n,) from 0 and positions (n, 3): x, y, height, of a route; and when each of its points is passed."""
    curve, stations = _curve_through(points)
    station, track = curve.track(np.array([points[0].x_m, points[0].y_m]))
    square = np.interp(station, stations, [point.speed_mps**2 for point in points])
    speed = np.sqrt(square)
    passed = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(station) / (speed[:-1] + speed[1:]))])
    level = np.interp(station, stations, [point.height_m for point in points])
    height = uniform_filter1d(level, size=int(ROUND_OUT_M / _STEP_M) | 1, mode="nearest")
    passes_s = np.interp(stations, station, passed)
    time = np.linspace(0.0, passed[-1], max(math.ceil(passed[-1] / _KNOT_S), 4) + 1)
    cell = np.clip(np.searchsorted(passed, time, side="right") - 1, 0, len(station) - 2)
    since = time - passed[cell]
    gain = np.diff(square)[cell] / (2.0 * np.diff(station)[cell])
    along = since * (speed[cell] + 0.5 * gain * since)
    middle = curve.heading_at(station[cell] + 0.5 * along)
    x, y = track[cell, 0] + along * np.cos(middle), track[cell, 1] + along * np.sin(middle)
    return time, np.stack([x, y, np.interp(station[cell] + along, station, height)], axis=-1), passes_s
