"""What people tell the gateway: one JSON object a line. Today that is a flight plan:

    {"told": "plan", "aircraft": "mavlink:1", "points": [
        {"sequence": 1, "kind": "waypoint", "latitude_deg": 31.0, "longitude_deg": 104.0, "altitude_above_home_m": 50.0}, ...]}

A point has an altitude above mean sea level (`altitude_msl_m`) or above home, or none; a loiter may have a `radius_m`, positive
to the right, and how many `turns` are flown at least. Aircraft "*", or none: the first vehicle that is heard.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from adapters.told_fields import HIGHEST_M, json_object, number, place_rad
from adapters.vehicles import Registry
from gateway.observation import FlightPlan, Observation, PlanPoint

Observations = tuple[Observation, ...]

ANYBODY = "*"
LONGEST_LINE = 4_000_000
LEAST_RADIUS_M = 1.0
_REALS = ("altitude_msl_m", "altitude_above_home_m", "radius_m", "turns")  # in the order in which a point has them
_KINDS = frozenset(("home", "waypoint", "loiter", "take-off", "landing", "other"))


@dataclass(frozen=True, slots=True)
class ToldPlan:
    """A flight plan as it was told, and of whom: "mavlink:1", or "*" for the first vehicle heard."""

    aircraft: str
    points: tuple[PlanPoint, ...]


def encode_plan(aircraft: str, points: Sequence[PlanPoint]) -> bytes:
    """A flight plan as one told line, without the line's end."""
    told = {"told": "plan", "aircraft": aircraft, "points": [_plain(point) for point in points]}
    return json.dumps(told, allow_nan=False).encode()


def decode(data: bytes) -> ToldPlan | None:
    """What a told line says; None where it is not understood as a whole. Never raises."""
    told = json_object(data, LONGEST_LINE)
    if told is None or told.get("told") != "plan" or not isinstance(told.get("points"), list):
        return None
    aircraft = told.get("aircraft", ANYBODY)
    points = [_point(one) for one in told["points"]]
    if not isinstance(aircraft, str) or not aircraft or None in points:
        return None
    kept = cast(list[PlanPoint], points)
    if len({point.sequence for point in kept}) != len(kept):
        return None
    return ToldPlan(aircraft, tuple(sorted(kept, key=lambda point: point.sequence)))


def _plain(point: PlanPoint) -> dict[str, Any]:
    plain: dict[str, Any] = {
        "sequence": point.sequence,
        "kind": point.kind,
        "latitude_deg": math.degrees(point.latitude_rad),
        "longitude_deg": math.degrees(point.longitude_rad),
    }
    given = {name: getattr(point, name) for name in _REALS}
    return plain | {name: value for name, value in given.items() if value is not None}


def _point(told: object) -> PlanPoint | None:
    if not isinstance(told, dict):
        return None
    sequence, kind, place = told.get("sequence"), told.get("kind", "other"), place_rad(told)
    if type(sequence) is not int or not 0 <= sequence < 1 << 16 or not isinstance(kind, str) or kind not in _KINDS:
        return None
    if place is None:
        return None
    reals = {name: number(told[name], HIGHEST_M) for name in _REALS if told.get(name) is not None}
    radius = reals.get("radius_m")
    if None in reals.values() or (radius is not None and abs(radius) < LEAST_RADIUS_M):
        return None
    return PlanPoint(sequence, kind, *place, *[reals.get(name) for name in _REALS])


class ToldPlans:
    """The plans told in a session, and whose they are; what a vehicle tells of its home leaves them whole."""

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._plans: dict[str, tuple[PlanPoint, ...]] = {}  # by aircraft
        self._unclaimed: tuple[PlanPoint, ...] | None = None

    def __bool__(self) -> bool:
        return self.waits or bool(self._plans)

    @property
    def waits(self) -> bool:
        """Whether a plan is for the first vehicle that will be heard."""
        return self._unclaimed is not None

    def hear(self, plan: ToldPlan, now: int, received_at: int) -> Observations:
        """A plan was told: at `now` in the session's time, at a stamp."""
        if plan.aircraft == ANYBODY:
            self._unclaimed = plan.points
            return self.joined((), now, received_at)
        return (self._keep(plan.aircraft, plan.points, now, received_at),)

    def joined(self, found: Observations, now: int, received_at: int) -> Observations:
        """What was heard, with a plan that waited for its vehicle; and plans that tell but a home with the points told."""
        if self._unclaimed is not None and (vehicles := self._registry.vehicles()):
            found = (*found, self._keep(vehicles[0].name, self._unclaimed, now, received_at))
            self._unclaimed = None
        return tuple(self._whole(one) if isinstance(one, FlightPlan) else one for one in found)

    def _keep(self, aircraft: str, points: tuple[PlanPoint, ...], now: int, received_at: int) -> FlightPlan:
        self._plans[aircraft] = points
        return FlightPlan(aircraft, now, received_at, points)

    def _whole(self, plan: FlightPlan) -> FlightPlan:
        kept = self._plans.get(plan.aircraft)
        if kept is None or any(point.kind != "home" for point in plan.points):
            return plan
        points = (*plan.points, *(point for point in kept if point.kind != "home"))
        return FlightPlan(plan.aircraft, plan.valid_at, plan.received_at, points)
