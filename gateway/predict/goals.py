"""Goals: the points that one aircraft may be going to, as arrays that forecasts of many aircraft are stacked of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.turns_and_straights import FULL_TURN
from gateway.frames import RunwayFrame, turn
from gateway.observation import FlightPlan, Intent, PlanPoint
from gateway.predict.modes import circles_at_home, returning
from gateway.predict.told import HOME_NAME, Told
from gateway.settings import Runway, Site

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COUNT = (
    20  # places for candidates: always as many, so that sums over them have the same bits for one aircraft and for many
)
LEGS = 4  # points of a route: the candidate and what the plan has after it
PLANNED = range(0, 10)
DECLARED, HOME = 10, 11
PUBLISHED = range(12, 16)
RUNWAY, GO_AROUND = 16, 17
AROUND = (18, 19)  # an area of weather, to its left and to its right: `weather`
SAME_PLACE_RAD = 1e-6
GO_AROUND_M = 5000.0  # beyond the runway's far end


@dataclass(frozen=True, slots=True, eq=False)
class Goals:
    """The c = COUNT candidates of one aircraft: route (c, 4, 2) east and north, up (c, 4), NaN = none.

    The first point of each route is the candidate.
    """

    route: Floats
    up: Floats
    names: tuple[str | None, ...]
    planned: Bools  # (c,)
    lands: Bools  # (c, 4)
    circles: Bools  # (c,) a point to be flown round, not over
    rounds: Bools  # (c,) such a point, of which the radius is not known, is the last of the route
    radius: Floats  # (c, 4) of what is flown round, positive to the left; NaN = none, or not known
    least: Floats  # (c, 4) radians that are flown round it at least
    over: Bools  # (c, 4) points that are flown over, not by
    begins: Floats  # (2,) where the line to what is declared begins, NaN = it is flown at from anywhere
    declared: int = -1  # which one it is said to go to
    declared_at: int = 0
    lowered: Floats = field(default_factory=lambda: np.ones(COUNT))  # (c,) of the weight, where weather is in the way

    @property
    def heading(self) -> tuple[float, float]:
        """East and north of the point that it is said to fly at, NaN = none, and none that it flies round."""
        if self.declared < 0 or self.circles[self.declared]:
            return math.nan, math.nan
        east, north = self.route[self.declared, 0].tolist()
        return east, north


def goals_of(told: Told | None, site: Site, frame: RunwayFrame, separation_m: float) -> Goals:
    """What is known of one aircraft's goals; `separation_m` lifts altitudes above mean sea level."""
    goals = _of_site(site, frame)
    if told is None:
        return goals
    route, up, names, circles, rounds = goals.route, goals.up, list(goals.names), goals.circles, goals.rounds
    declared, points, home_m = told.declared, _points(told.plan), _home_m(told.plan)
    begins = np.full(2, math.nan)
    if declared is not None and declared.sequence is not None:
        passed = [point for point in points if point.sequence < declared.sequence and point.kind != "take-off"]
        points = points[len(points) - sum(point.sequence >= declared.sequence for point in points) :]
        if passed and passed[-1].kind != "loiter":
            begins = _place(passed[-1], home_m, separation_m, site, frame)[:2]
    count, points = len(points), [*points, *_afterwards(told, points)]
    places = [_place(point, home_m, separation_m, site, frame) for point in points[: len(PLANNED) + LEGS]]
    for slot in PLANNED[:count]:
        following = _until_a_circle(places[slot : slot + LEGS], points[slot : slot + LEGS])
        last = points[slot + len(following) - 1]
        rounds[slot] = last.kind == "loiter" and last.radius_m is None
        for leg, point in enumerate(points[slot : slot + len(following)]):
            if point.kind == "loiter" and point.radius_m is not None:
                goals.radius[slot, leg] = -point.radius_m
                goals.least[slot, leg] = math.inf if point.turns is None else point.turns * FULL_TURN
        route[slot, : len(following)] = [enu[:2] for enu in following]
        up[slot, : len(following)] = [enu[2] for enu in following]
        goals.over[slot, : len(following)] = [
            place == count - 1 < len(places) - 1 for place in range(slot, slot + len(following))
        ]
        kinds = [point.kind for point in points[slot : slot + len(following)]]
        goals.lands[slot, : len(following)] = [kind == "landing" for kind in kinds]
        names[slot], goals.planned[slot] = f"{points[slot].kind} {points[slot].sequence}", True
        circles[slot] = points[slot].kind == "loiter"
    if told.plan is not None and told.plan.points and told.plan.points[0].kind == "home":
        home = told.plan.points[0]
        enu = _place(home, home_m, separation_m, site, frame)
        route[HOME, 0], names[HOME] = enu[:2], HOME_NAME
        if told.status is not None and returning(told.status):
            circles[HOME] = circles_at_home(told.status)
            rounds[HOME] = circles[HOME] and home.radius_m is None
            goals.lands[HOME, 0] = not circles[HOME]
            if circles[HOME]:
                up[HOME, 0] = _place(replace(home, altitude_msl_m=None), home_m, separation_m, site, frame)[2]
            if circles[HOME] and home.radius_m is not None:
                goals.radius[HOME, 0], goals.least[HOME, 0] = -home.radius_m, math.inf
    chosen = _declared(declared, points, names)
    if chosen == DECLARED and declared is not None:
        place = _declared_place(declared, separation_m, site, frame)
        if place is None:
            chosen = -1
        else:
            (route[DECLARED, 0], up[DECLARED, 0]), names[DECLARED] = place, _called(declared)
    since = declared.valid_at if declared is not None else 0
    begins = begins if chosen == PLANNED[0] else np.full(2, math.nan)
    return replace(goals, names=tuple(names), begins=begins, declared=chosen, declared_at=since)


def _of_site(site: Site, frame: RunwayFrame) -> Goals:
    """The goals of who has said nothing: the runway, beyond it, and the published points."""
    route, up = np.full((COUNT, LEGS, 2), math.nan), np.full((COUNT, LEGS), math.nan)
    names: list[str | None] = [None] * COUNT
    lands = np.zeros((COUNT, LEGS), dtype=np.bool_)
    aim, beyond = turn(frame.enu_from_runway, runway_goals(site.runway))
    route[RUNWAY, 0], up[RUNWAY, 0], names[RUNWAY], lands[RUNWAY, 0] = aim[:2], aim[2], "runway", True
    route[GO_AROUND, 0], names[GO_AROUND] = beyond[:2], "go-around"
    for slot, waypoint in zip(PUBLISHED, site.waypoints, strict=False):
        there = frame.enu_from_geodetic(waypoint.latitude_rad, waypoint.longitude_rad, site.runway.height_m)
        route[slot, 0], names[slot] = there[:2], waypoint.name
    planned, circles, rounds = np.zeros((3, COUNT), dtype=np.bool_)
    radius, least, over = np.full(lands.shape, math.nan), np.zeros(lands.shape), np.zeros_like(lands)
    nowhere = np.full(2, math.nan)
    return Goals(route, up, tuple(names), planned, lands, circles, rounds, radius, least, over, nowhere)


def _until_a_circle(places: list[Floats], points: Sequence[PlanPoint]) -> list[Floats]:
    """The places up to the first that is flown round nobody says how."""
    for count, point in enumerate(points, 1):
        if point.kind == "loiter" and point.radius_m is None:
            return places[:count]
    return places


def _afterwards(told: Told, points: Sequence[PlanPoint]) -> list[PlanPoint]:
    """Where it goes from a plan's last point: home, to circle there, as some do whose plan ends in the air."""
    plan = told.plan
    if plan is None or not points or not told.ends_at_home or plan.points[0].kind != "home":
        return []
    last = points[-1]
    if last.kind == "landing" or (last.kind == "loiter" and last.turns is None):
        return []
    return [replace(plan.points[0], kind="loiter", altitude_msl_m=None)]


def _points(plan: FlightPlan | None) -> list[PlanPoint]:
    return [point for point in plan.points if point.kind != "home"] if plan is not None else []


def _home_m(plan: FlightPlan | None) -> float | None:
    """Home's altitude above mean sea level."""
    homes = [point for point in plan.points if point.kind == "home"] if plan is not None else []
    return homes[0].altitude_msl_m if homes else None


def _place(point: PlanPoint, home_m: float | None, separation_m: float, site: Site, frame: RunwayFrame) -> Floats:
    """East, north, up (3,) of a plan's point; up is NaN where its height is not known."""
    altitude = point.altitude_msl_m
    if altitude is None and point.altitude_above_home_m is not None and home_m is not None:
        altitude = home_m + point.altitude_above_home_m
    return _enu(
        point.latitude_rad, point.longitude_rad, None if altitude is None else altitude + separation_m, site, frame
    )


def _enu(latitude: float, longitude: float, height_m: float | None, site: Site, frame: RunwayFrame) -> Floats:
    there = frame.enu_from_geodetic(latitude, longitude, site.runway.height_m if height_m is None else height_m)
    return there if height_m is not None else np.array([there[0], there[1], math.nan])


def _declared(declared: Intent | None, points: Sequence[PlanPoint], names: Sequence[str | None]) -> int:
    """Which candidate a declared intent is: one of that name, the plan's first point, since the plan begins there, or a place
    of its own.
    """
    if declared is None:
        return -1
    if declared.name is not None:
        wanted = declared.name.casefold()
        return next((slot for slot, name in enumerate(names) if name and name.casefold() == wanted), DECLARED)
    if declared.latitude_rad is None or declared.longitude_rad is None:
        return (
            PLANNED[0] if (points and points[0].sequence == declared.sequence) or _by_vehicle(declared, points) else -1
        )
    if declared.sequence is not None and points:
        off_rad = abs(declared.latitude_rad - points[0].latitude_rad) + abs(
            declared.longitude_rad - points[0].longitude_rad
        )
        if off_rad < SAME_PLACE_RAD:
            return PLANNED[0]
    return DECLARED


def _by_vehicle(declared: Intent, points: Sequence[PlanPoint]) -> bool:
    """Whether a vehicle says the item, which may be a command before the plan's next point."""
    return bool(points) and declared.told_by != "declared"


def _called(declared: Intent) -> str:
    if declared.name is not None:
        return declared.name
    if declared.sequence is not None:
        return f"item {declared.sequence}"
    return "declared point" if declared.told_by == "declared" else "next waypoint"


def _declared_place(
    declared: Intent, separation_m: float, site: Site, frame: RunwayFrame
) -> tuple[Floats, float] | None:
    """East and north (2,), and up, of a place that is declared; None of a name that no published point has."""
    latitude, longitude, height = declared.latitude_rad, declared.longitude_rad, declared.height_m
    if declared.name is not None:
        wanted = declared.name.casefold()
        point = next((one for one in site.waypoints if one.name.casefold() == wanted), None)
        latitude, longitude = (None, None) if point is None else (point.latitude_rad, point.longitude_rad)
    if latitude is None or longitude is None:
        return None
    if height is None and declared.altitude_msl_m is not None:
        height = declared.altitude_msl_m + separation_m
    there = _enu(latitude, longitude, height, site, frame)
    return there[:2], float(there[2])


def runway_goals(runway: Runway) -> Floats:
    """Places (2, 3) in the runway frame: where the glide path meets it, and where a go-around leads, beyond its far end."""
    return np.array([[runway.aiming_point_x_m, 0.0, 0.0], [0.5 * runway.length_m + GO_AROUND_M, 0.0, 0.0]])
