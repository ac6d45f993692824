"""A case planned as a flight: take-off, legs by way of points, a level in a band, and a final onto a runway.

The level is the one of the band at which J is least: threats that have a height are further away higher up, and areas can be
flown over or under where the band allows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.settings import Runway
from sim.planning import modern
from sim.planning.areas import Area
from sim.planning.case import Case, Plane
from sim.planning.field import LAMBDA_M4, Threats, measure, resampled, stations
from sim.planning.task import TOLERANCE_M, TURN_RADIUS_M, PlanError, Route, Task, box_about

Floats = NDArray[np.float64]
Planner = Callable[[Task], Route]

ASIDE_M = 20.0  # that areas are flown over and under at least
DEPARTURE_M = 1_000.0  # straight on beyond the runway's end
FINAL_M = 450.0  # the highest that a final begins above the runway; from further up is come down before
LEVEL_FINAL_M = 1_500.0  # on the centreline before the glide path is met
TAKE_OFF_M = 50.0  # above home, where a take-off ends and the climb along the route begins
GRADIENT = 0.05  # of climbs and descents: 2.9 degrees


@dataclass(frozen=True, slots=True)
class Wishes:
    """How is to be flown: the level's band above home, m, how tightly may be turned, and lambda, m^4."""

    lowest_m: float = 300.0
    highest_m: float = 300.0
    turn_radius_m: float = TURN_RADIUS_M
    lambda_m4: float = LAMBDA_M4


@dataclass(frozen=True, slots=True)
class Final:
    """The way down onto a runway: where the glide path is met, at which height above the runway, and where it leads (2,) m."""

    meets_m: Floats
    height_m: float
    aims_m: Floats


@dataclass(frozen=True, slots=True)
class Flight:
    """What was planned: the route on its level, the areas that are there on that level, and the final if there is one.

    `home_m` (2,): where it sets out; `takes_off_m`: where it leaves the ground.
    """

    case: Case
    route: Route
    level_m: float
    areas: tuple[Area, ...]
    threats: Threats
    home_m: Floats
    takes_off_m: Floats
    final: Final | None
    altitude_msl_m: float

    def shown_m(self) -> Floats:
        """A box (2, 2) about all of it, as wide as high."""
        final = [] if self.final is None else [self.final.aims_m]
        ends = [self.takes_off_m, *final]
        if self.case.box_m is not None:
            return np.stack([np.min([self.case.box_m[0], *ends], axis=0), np.max([self.case.box_m[1], *ends], axis=0)])
        about = box_about(self.route.curve_m, self.threats.place_m, *ends, share=0.08)
        middle, half = about.mean(axis=0), 0.5 * float((about[1] - about[0]).max())
        return np.stack([middle - half, middle + half])


def plan_flight(
    case: Case, wishes: Wishes = Wishes(), planner: Planner = modern.plan, runway: Runway | None = None
) -> Flight:
    """The flight of least J. Raises PlanError, one sentence with what is in the way."""
    if isinstance(case.start, str) and isinstance(case.goal, str) and not case.via_m:
        raise PlanError("A route from the runway to itself needs points between them: via_km or via_deg.")
    best: Flight | None = None
    refused: PlanError | None = None
    for level in _levels(case, wishes):
        try:
            found = _on_level(case, wishes, planner, runway, level)
        except PlanError as error:
            refused = refused or error
            continue
        if best is None or found.route.measures.cost_m < best.route.measures.cost_m:
            best = found
    if best is None:
        raise refused or PlanError("There is no level to fly on.")
    return best


def _levels(case: Case, wishes: Wishes) -> list[float]:
    """The levels that may be best: the band's ends, and those just above and below areas; of equal ones the lowest."""
    low, high = wishes.lowest_m, wishes.highest_m
    if low > high:
        raise PlanError(f"The lowest level, {low:g} m, is above the highest, {high:g} m.")
    tried = {low, high}
    for area in case.areas:
        tried |= {level for level in (area.top_m + ASIDE_M, area.base_m - ASIDE_M) if low <= level <= high}
    by_height = bool(np.isfinite(case.threat_height_m).any())
    different: dict[tuple[object, ...], float] = {}
    for level in sorted(tried):
        there = tuple(_is_there(area, level) for area in case.areas)
        different.setdefault((there, level if by_height else 0.0), level)
    return list(different.values())


def _is_there(area: Area, level_m: float) -> bool:
    return area.base_m - ASIDE_M < level_m < area.top_m + ASIDE_M


def _on_level(case: Case, wishes: Wishes, planner: Planner, runway: Runway | None, level_m: float) -> Flight:
    threats = Threats(case.threat_m, np.nan_to_num(level_m - case.threat_height_m, nan=0.0))
    areas = tuple(area for area in case.areas if _is_there(area, level_m))
    centreline = None if runway is None else _Centreline(runway, case.plane)
    home, takes_off, start, leaving = _departure(case, centreline)
    goal, arriving, final = _arrival(case, centreline, level_m)
    points = [start, *case.via_m, goal]
    passing = [_unit(after - before) for before, after in zip(points, points[2:], strict=False)]
    courses = [leaving, *passing, arriving]
    task = Task(
        start, goal, threats, case.box(*points), areas, wishes.lambda_m4, wishes.turn_radius_m, aside_m=TOLERANCE_M
    )
    legs = [
        planner(replace(task, start_m=begin, goal_m=end, start_course=one, goal_course=other))
        for begin, end, one, other in zip(points, points[1:], courses, courses[1:], strict=False)
    ]
    route = legs[0] if len(legs) == 1 else _joined(legs, task)
    altitude = case.altitude_msl_m if runway is None else runway.height_m - (runway.geoid_separation_m or 0.0)
    flight = Flight(case, route, level_m, areas, threats, home, takes_off, final, altitude)
    _check_areas(flight)
    return flight


def heights(flight: Flight) -> Floats:
    """Heights above home (n,) at the points of the route: up to the level, along it, and down to where a final begins."""
    station = stations(flight.route.curve_m)
    level = np.minimum(flight.level_m, min(TAKE_OFF_M, flight.level_m) + GRADIENT * station)
    if flight.final is None:
        return np.asarray(level)
    return np.asarray(np.minimum(level, flight.final.height_m + GRADIENT * (station[-1] - station)))


def _check_areas(flight: Flight) -> None:
    """Climb, descent and the straight ways from and to the ground have not been planned around areas. Raises PlanError."""
    curve, height = flight.route.curve_m, heights(flight)
    ways = [(curve, height), (resampled(np.stack([flight.takes_off_m, curve[0]])), height[:1])]
    if (final := flight.final) is not None:
        ways.append((resampled(np.stack([curve[-1], final.meets_m])), np.array([final.height_m])))
        down = resampled(np.stack([final.meets_m, final.aims_m]))
        ways.append((down, np.linspace(final.height_m, 0.0, len(down))))
    for area in flight.case.areas:
        for way, level in ways:
            if ((area.distance(way)[0] < 0.0) & (level > area.base_m) & (level < area.top_m)).any():
                named = f" {area.name!r}" if area.name else ""
                raise PlanError(
                    f"The climb, the descent or the final crosses the area{named}; it cannot be flown around."
                )


@dataclass(frozen=True, slots=True)
class _Centreline:
    """A runway as it lies on the plane of a case."""

    runway: Runway
    plane: Plane

    def at(self, x_m: float) -> Floats:
        """The point (2,) of the centreline at this x of the runway frame."""
        latitude, longitude, _ = RunwayFrame(self.runway).geodetic_from_runway([x_m, 0.0, 0.0])
        return self.plane.place_m(np.degrees([latitude, longitude]))


def _departure(case: Case, centreline: _Centreline | None) -> tuple[Floats, Floats, Floats, Floats | None]:
    """Home, where it leaves the ground, where the route starts, and the course there."""
    if not isinstance(case.start, str):
        return case.start, case.start, case.start, None
    if centreline is None:
        raise PlanError("A route from the runway needs the site file that says where it is: --site FILE.")
    threshold = centreline.runway.threshold_x_m
    takes_off, start = centreline.at(-threshold), centreline.at(-threshold + DEPARTURE_M)
    return centreline.at(threshold), takes_off, start, _unit(start - takes_off)


def _arrival(case: Case, centreline: _Centreline | None, level_m: float) -> tuple[Floats, Floats | None, Final | None]:
    """Where the route ends, the course there, and the final from there."""
    if not isinstance(case.goal, str):
        return case.goal, None, None
    if centreline is None:
        raise PlanError("A route to the runway needs the site file that says where it is: --site FILE.")
    runway = centreline.runway
    height = min(level_m, FINAL_M)
    meets = runway.aiming_point_x_m - height / math.tan(runway.glide_path_rad)
    final = Final(centreline.at(meets), height, centreline.at(runway.aiming_point_x_m))
    goal = centreline.at(meets - LEVEL_FINAL_M)
    return goal, _unit(final.meets_m - goal), final


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.hypot(*vector))


def _joined(legs: list[Route], task: Task) -> Route:
    """Legs as one route; each leg's other candidates are kept."""
    curve = np.concatenate([legs[0].curve_m, *(leg.curve_m[1:] for leg in legs[1:])])
    radius = min(leg.measures.turn_radius_m for leg in legs)
    measures = replace(measure(curve, task.threats, task.lambda_m4), turn_radius_m=radius)
    return Route(legs[0].name, curve, measures, tuple(one for leg in legs for one in leg.candidates))
