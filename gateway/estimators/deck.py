"""Where a ship's deck is and which way it points: her track's place, and her heading with the waves taken out of it.

The heading at an instant is the end of a straight line through what she said of her attitude in the last `FIT_S` seconds, those
in the middle counting most (Hann's weights): of waves of 0.6 to 1 rad/s it leaves an eighth at most, a twentieth of usual ones,
and it does not lag in a steady turn. It does where a turn begins: at 1 degree/s by 7 degrees at worst. Who says nothing of her
heading points where she goes.
"""

from __future__ import annotations

import math
from bisect import insort
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.frames import DeckPose, RunwayFrame

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FIT_S = 30.0
LEAST_FIT = 8  # attitudes, over at least half of the time
STEERAGE_MPS = 0.5  # slower than this a course says nothing of a heading


@dataclass(frozen=True, slots=True)
class Deck:
    """What is remembered of the ship that a runway follows."""

    follows: str
    headings: tuple[tuple[int, float], ...] = ()  # (ns, rad) of the last seconds, in the order of time
    pose: DeckPose | None = None
    is_silent: bool = False
    is_lost: bool = False

    def heard(self, at: int, heading_rad: float) -> Deck:
        """The same after a word of her heading, which may come late."""
        headings = list(self.headings)
        insort(headings, (at, heading_rad))
        newest = headings[-1][0]
        return replace(self, headings=tuple(one for one in headings if newest - one[0] <= FIT_S * 1e9))

    def moved(
        self, at: int, enu_m: Floats, velocity_mps: Floats, is_silent: bool, frame: RunwayFrame
    ) -> tuple[Deck, str | None]:
        """The same at an instant, the ship's track being there, and what people should know of it."""
        heading, turns = self._heading(at, velocity_mps)
        pose = frame.deck_pose(at, enu_m, velocity_mps, heading, 0.0 if is_silent else turns)
        said = None
        if self.pose is None:
            said = f"{self.follows} is heard: the runway is where she is from now on"
        elif is_silent and not self.is_silent:
            said = f"{self.follows}, which carries the runway, is silent: the runway is carried on at her last speed"
        elif self.is_silent and not is_silent:
            said = f"{self.follows}, which carries the runway, is heard again"
        return replace(self, pose=pose, is_silent=is_silent, is_lost=False), said

    def lost(self) -> tuple[Deck, str | None]:
        """The same without a track of hers: the runway goes on straight from where it was last."""
        if self.pose is None or self.is_lost:
            return self, None
        said = f"{self.follows}, which carries the runway, is lost: the runway is carried on until she is heard again"
        return replace(self, pose=replace(self.pose, turn_radps=0.0), is_silent=True, is_lost=True), said

    def _heading(self, at: int, velocity_mps: Floats) -> tuple[float, float]:
        """Her heading at an instant, rad, and how it changes, rad/s."""
        told = [one for one in self.headings if at - FIT_S * 1e9 <= one[0] <= at]
        if len(told) >= LEAST_FIT and told[-1][0] - told[0][0] >= 0.5 * FIT_S * 1e9:
            since_s = np.array([(one - at) / 1e9 for one, _ in told])
            angle = np.unwrap(np.array([heading for _, heading in told]))
            weight = np.sin(math.pi * (1.0 + since_s / FIT_S)) ** 2 + 1e-6
            weight /= weight.sum()
            middle, mean = (weight * since_s).sum(), (weight * angle).sum()
            off = since_s - middle
            slope = float((weight * off * (angle - mean)).sum() / (weight * off * off).sum())
            return float(mean - slope * middle), slope
        if told:
            return told[-1][1], 0.0
        east, north = float(velocity_mps[0]), float(velocity_mps[1])
        if math.hypot(east, north) > STEERAGE_MPS:
            return math.atan2(east, north), 0.0
        return 0.0, 0.0


@dataclass(frozen=True, slots=True)
class DeckPath:
    """Where a deck was, one pose or more in the order of time: each holds until the next one's, the first before it too."""

    poses: tuple[DeckPose, ...]

    def place(self, time: Ints, enu_m: Floats) -> Floats:
        """Positions (n, 3) of the ENU at times (n,), ns, in the deck's frame as it was then."""
        found = np.empty_like(enu_m)
        for pose, mine in self._by_pose(time):
            found[mine] = pose.relative(time[mine], enu_m[mine])
        return found

    def velocity(self, time: Ints, velocity_mps: Floats) -> Floats:
        """Velocities (n, 3) of the ENU less the deck's, along its axes as they were at times (n,)."""
        found = np.empty_like(velocity_mps)
        for pose, mine in self._by_pose(time):
            found[mine] = pose.relative_velocity(time[mine], velocity_mps[mine])
        return found

    def compass_rad(self, time: Ints) -> Floats:
        """The landing direction (n,) at times (n,), true."""
        found = np.empty(len(time))
        for pose, mine in self._by_pose(time):
            found[mine] = pose.compass_rad + pose.turn_radps * (time[mine] - pose.at) / 1e9
        return found

    def _by_pose(self, time: Ints) -> Iterator[tuple[DeckPose, NDArray[np.intp]]]:
        """Which of n times each pose holds for."""
        began = np.array([pose.at for pose in self.poses], dtype=np.int64)
        which = np.clip(np.searchsorted(began, time, side="right") - 1, 0, None)
        for one in np.unique(which).tolist():
            yield self.poses[one], np.flatnonzero(which == one)
