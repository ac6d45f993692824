"""A runway that follows a ship: the scene stays in the deck's frame, and what stands still moves in it.

Positions of what flies are drawn where they were relative to the deck at their own times, so that who flies down the glide path
draws a straight line down it. What the picture knows in the frame that stands still (predictions, plans, pairs, waypoints,
weather) keeps its coordinates, under a transform of the whole branch, which is written at each whole second. The map shows the
earth, and does not move. Of a runway that stands still nothing is written, and positions are what they were, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.deck import DeckPath
from gateway.frames import DeckPose, RunwayFrame, turn
from gateway.observation import FlightPlan, Intent
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import columns
from gateway.sinks.scene.attitude import quaternion_from_matrix
from gateway.sinks.scene.entry import Entry, entity, rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STANDING = (
    entity("predict"),
    entity("associate"),
    entity("track"),
    entity("fuse", "smoothed"),
    entity("site", "waypoint"),
    entity("site", "weather"),
)
"""Branches whose positions are in the frame that stands still."""
KEPT = 60  # poses: rows are drawn seconds after their time


class DeckScene:
    """Where the deck was, of one recording."""

    def __init__(self, site: Site) -> None:
        self._frame, self._moves = RunwayFrame(site.runway), site.runway.follows is not None
        self._poses: tuple[DeckPose, ...] = ()
        self._planned: dict[str, None] = {}  # branches of plans, which are drawn below what their aircraft said

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """Take the poses of these pictures; what stands still is brought to where it is from the deck."""
        if not self._moves:
            return []
        for picture in pictures:
            for one in picture.observations:
                if isinstance(one, FlightPlan | Intent):
                    for what in ("plan", "next"):
                        self._planned[entity("raw", "gps", one.aircraft, what)] = None
        told = [(pose, picture.step) for picture in pictures for pose in picture.deck]
        if not told:
            return []
        self._poses = (*self._poses, *(pose for pose, _ in told))[-KEPT:]
        turned = np.array([pose.deck_from_enu @ self._frame.enu_from_runway for pose, _ in told])
        place = np.array([-(pose.deck_from_enu @ pose.enu_m) for pose, _ in told])
        moved = columns.poses(place, quaternion_from_matrix(turned), np.ones(len(told)))
        time, step = [pose.at for pose, _ in told], [number for _, number in told]
        return [rows(path, time, step, moved) for path in (*STANDING, *self._planned)]

    def place(self, time: Ints, runway_m: Floats) -> Floats:
        """Positions (n, 3) at times (n,), from the frame that stands still into the deck's as it was then."""
        if not self._poses:
            return runway_m
        return DeckPath(self._poses).place(time, turn(self._frame.enu_from_runway, runway_m))

    def along_mps(self, time: Ints, velocity_mps: Floats) -> Floats:
        """How fast (n,) velocities (n, 3) in the axes that stand still come along the deck, at times (n,)."""
        if not self._poses:
            return np.asarray(velocity_mps[:, 0])
        enu = turn(self._frame.enu_from_runway, np.nan_to_num(velocity_mps))
        return DeckPath(self._poses).velocity(time, enu)[:, 0]

    def compass_rad(self, time: Ints) -> float | Floats:
        """The direction of the frame's x at times (n,), true."""
        if not self._poses:
            return self._frame.runway.landing_compass_rad
        return DeckPath(self._poses).compass_rad(time)

    @property
    def axes_from_enu(self) -> Floats:
        """The matrix (3, 3) from east, north, up to the axes of the scene, now."""
        return self._poses[-1].deck_from_enu if self._poses else self._frame.runway_from_enu
