"""Arrival flows as candidates: who has told no plan, and flies along a way that many came, may go on along it.

Source: 000 2.2 and 002-7. The flows come from archived sessions, `talkdown flows`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.geodesy import wrap_rad
from gateway.predict.goals import LEGS, PLANNED, Goals
from gateway.predict.states import State
from gateway.settings import Site

Floats = NDArray[np.float64]

FLOWS_AT_MOST = 50
NARROW_M = (
    926.0  # sigma of RNAV 1; flights of a wider flow are vectored: each turns elsewhere, and the mean of them nowhere
)
WIDE_M = 4630.0  # 2.5 nautical miles: who flies further aside of a flow's mean way came another way
FINAL_M = 20_000.0  # before their end flights of one flow come together
ALONG_RAD = math.radians(30.0)  # who flies more across it than that is not on it
NAME = "flow"


@dataclass(frozen=True, slots=True)
class ArrivalFlow:
    """A way that many came: its points from afar to the landing (latitude, longitude rad, height above the runway m).

    `spread_m` is how far flights were aside of it, one sigma; `flights` how many there were.
    """

    number: int
    flights: int
    spread_m: float
    points: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True, slots=True, eq=False)
class On:
    """A flow that an aircraft is on: which, its next point, how far aside (2,) the aircraft is, and how far it has to go, m."""

    flow: int
    point: int
    aside: Floats
    to_go_m: float


@dataclass(frozen=True, slots=True, eq=False)
class FlowWays:
    """The legs (l,) of all flows about one runway."""

    flows: tuple[ArrivalFlow, ...]
    places: tuple[Floats, ...]  # of each flow, its points (k, 3) ENU
    to_go: tuple[Floats, ...]  # of each flow, from its points (k,) to its end over the ground
    first: tuple[int, ...]  # of each flow, how many points the flows before it have
    legs: tuple[tuple[int, int], ...]  # of each leg its flow, and the point that it ends at
    begin: Floats  # (l, 2)
    step: Floats  # (l, 2)
    course: Floats  # (l,)

    @classmethod
    def of(cls, flows: Sequence[ArrivalFlow], site: Site, frame: RunwayFrame) -> FlowWays | None:
        """About a site's runway, those narrow enough to foretell a flight by; None where there are none."""
        flows = tuple(flow for flow in flows if flow.spread_m <= NARROW_M)[:FLOWS_AT_MOST]
        if not flows:
            return None
        places = []
        for flow in flows:
            latitude, longitude, above = np.array(flow.points).T
            places.append(frame.enu_from_geodetic(latitude, longitude, site.runway.height_m + above))
        steps = [np.diff(place[:, :2], axis=0) for place in places]
        to_go = [np.append(np.cumsum(np.linalg.norm(step, axis=1)[::-1])[::-1], 0.0) for step in steps]
        legs = tuple((number, end) for number, place in enumerate(places) for end in range(1, len(place)))
        begin, step = np.concatenate([place[:-1, :2] for place in places]), np.concatenate(steps)
        first = tuple(np.cumsum([0, *(len(place) for place in places[:-1])]).tolist())
        course = np.arctan2(step[:, 1], step[:, 0])
        return cls(flows, tuple(places), tuple(to_go), first, legs, begin, step, course)

    def along(self, goals: Sequence[Goals], state: State) -> list[Goals]:
        """The goals of n aircraft, with flows as candidates of those that have told no plan and are on one."""
        joined = list(goals)
        free = [row for row, one in enumerate(goals) if one.declared < 0 and not one.planned.any()]
        if free:
            for row, flows in zip(free, self._on(state.position[free], state.velocity[free]), strict=True):
                if flows:
                    joined[row] = self._joined(goals[row], flows)
        return joined

    def _on(self, position: Floats, velocity: Floats) -> list[tuple[On, ...]]:
        """Of n aircraft the flows that each is on, the nearest first."""
        to = position[:, None] - self.begin
        squared = np.maximum(self.step[:, 0] * self.step[:, 0] + self.step[:, 1] * self.step[:, 1], 1e-9)
        share = np.clip((to[..., 0] * self.step[:, 0] + to[..., 1] * self.step[:, 1]) / squared, 0.0, 1.0)
        off = to - share[..., None] * self.step
        distance = np.sqrt(off[..., 0] * off[..., 0] + off[..., 1] * off[..., 1])
        across = wrap_rad(np.arctan2(velocity[:, 1], velocity[:, 0])[:, None] - self.course)
        rest = (1.0 - share) * np.sqrt(squared)
        # abeam of the leg's end, if it flies straight on: along the leg's normal at its end
        left = np.stack([-self.step[:, 1], self.step[:, 0]], axis=-1) / np.sqrt(squared)[:, None]
        beside = (
            off[..., 0] * left[:, 0] + off[..., 1] * left[:, 1] + rest * np.tan(np.clip(across, -ALONG_RAD, ALONG_RAD))
        )
        near = (np.maximum(distance, np.abs(beside)) <= WIDE_M) & (np.abs(across) <= ALONG_RAD)
        distance = np.where(near, distance, math.inf)
        found: list[tuple[On, ...]] = []
        for row, far in enumerate(distance):
            on: dict[int, On] = {}
            for leg in np.argsort(far, kind="stable")[: np.count_nonzero(np.isfinite(far))].tolist():
                flow, point = self.legs[leg]
                if flow not in on:
                    to_go_m = float(self.to_go[flow][point] + rest[row, leg])
                    on[flow] = On(flow, point, beside[row, leg] * left[leg], to_go_m)
            found.append(tuple(on.values()))
        return found

    def _joined(self, base: Goals, flows: Sequence[On]) -> Goals:
        """Goals with the next points of flows as candidates and, while there is room, those after them: shortcuts.

        Who flies beside the mean track flies on beside it, and comes to it on the final. A point keeps its
        place among the candidates when the one before it is passed, so that what was thought of it stays.
        """
        ahead = [(on, on.point + later) for later in range(LEGS) for on in flows]
        ahead = [(on, point) for on, point in ahead if point < len(self.places[on.flow])]
        route, up, lands = base.route.copy(), base.up.copy(), base.lands.copy()
        names, planned = list(base.names), base.planned.copy()
        free = list(PLANNED)
        for on, point in ahead[: len(free)]:
            wanted = PLANNED[(self.first[on.flow] + point) % len(PLANNED)]
            slot = min(free, key=lambda one: (one - wanted) % len(PLANNED))
            free.remove(slot)
            points = self.places[on.flow][point : point + LEGS]
            beside = np.minimum(self.to_go[on.flow][point : point + LEGS] / min(max(on.to_go_m, 1.0), FINAL_M), 1.0)
            route[slot, : len(points)] = points[:, :2] + beside[:, None] * on.aside
            up[slot, : len(points)] = points[:, 2]
            lands[slot, : len(points)] = np.arange(point, point + len(points)) == len(self.places[on.flow]) - 1
            names[slot], planned[slot] = f"{NAME} {self.flows[on.flow].number}, point {point + 1}", True
        return replace(base, route=route, up=up, lands=lands, names=tuple(names), planned=planned)
