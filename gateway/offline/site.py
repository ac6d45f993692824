"""A site for a recording or a link that came without one: where its aircraft would land, told by what they say.

Looked at in this order, over all aircraft in the order they were heard:
1. the landing item of a mission: the aiming point, in the direction of the leg that leads to it;
2. HOME_POSITION: the runway's centre, in the direction in which the aircraft stands or first moves;
3. where an aircraft stood still for 5 s, with its nose in the landing direction;
4. after a minute without any of these, or at the end of a recording, the first position that was reported.
No radar is invented: where none is known, none is there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from statistics import median
from typing import Any

from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, GpsReport, Observation, PlanPoint, VehicleStatus
from gateway.settings import Runway, Site, SiteError, format_site, parse_site

LENGTH_M, WIDTH_M, CROSSING_HEIGHT_M = 600.0, 30.0, 5.0  # a small aircraft's field
_STANDING_M, _STANDING_NS = 3.0, 5_000_000_000
_STANDING_MPS, _MOVING_MPS = 1.0, 5.0
_SHORTEST_LEG_M = 50.0
_SETTLED_NS = 10_000_000_000
_PATIENCE_NS = 60_000_000_000


@dataclass(frozen=True, slots=True)
class SiteProposal:
    """A site and, for a person, where it comes from and what was assumed in it."""

    site: Site
    origin: str


@dataclass(slots=True)
class _Told:
    """What one aircraft has told of the place."""

    aircraft: str
    reports: list[GpsReport] = field(default_factory=list)
    plan: FlightPlan | None = None

    def home(self) -> PlanPoint | None:
        return next((point for point in self._points() if point.kind == "home"), None)

    def landing(self) -> tuple[PlanPoint, PlanPoint] | None:
        """The mission's landing item, and the point before it that is far enough away to give a direction."""
        points = self._points()
        for index in range(len(points) - 1, 0, -1):
            if points[index].kind == "landing":
                for before in reversed(points[:index]):
                    if before.kind != "home" and _leg(before, points[index])[0] >= _SHORTEST_LEG_M:
                        return before, points[index]
        return None

    def _points(self) -> tuple[PlanPoint, ...]:
        return self.plan.points if self.plan is not None else ()

    def standing(self) -> GpsReport | None:
        """The last report of the first 5 s in which it stood still."""
        begin: GpsReport | None = None
        for report in self.reports:
            if _speed_mps(report) > _STANDING_MPS or (begin and _distance_m(begin, report) > _STANDING_M):
                begin = None
                continue
            if begin and report.valid_at < begin.valid_at:
                begin = report  # its clock was set meanwhile
            begin = begin or report
            if report.valid_at - begin.valid_at >= _STANDING_NS:
                return report
        return None

    def has_moved(self) -> bool:
        """Whether a report tells of a speed that gives a course."""
        return any(_speed_mps(report) >= _MOVING_MPS for report in self.reports)

    def separation_m(self) -> float | None:
        """Height above the ellipsoid minus altitude above mean sea level, where reports give both."""
        given = [
            report.height_m - report.altitude_msl_m
            for report in self.reports
            if report.height_m is not None and report.altitude_msl_m is not None
        ]
        return median(given) if given else None


def propose_site(observations: Iterable[Observation], *, complete: bool = False) -> SiteProposal | None:
    """The site that these observations tell of, or None as long as they do not.

    Observations in the order they were heard; what is no GpsReport, FlightPlan or VehicleStatus is passed over.
    `complete`: nothing more will come, so that what there is must do.
    """
    told: dict[str, _Told] = {}
    for observation in observations:
        if isinstance(observation, GpsReport | FlightPlan | VehicleStatus):
            aircraft = told.setdefault(observation.aircraft, _Told(observation.aircraft))
            if isinstance(observation, GpsReport):
                aircraft.reports.append(observation)
            elif isinstance(observation, FlightPlan):
                aircraft.plan = observation
    reporting = [aircraft for aircraft in told.values() if aircraft.reports]
    for propose in (_from_landing, _from_home, _from_standing, _from_first_report):
        for aircraft in reporting:
            proposal = propose(aircraft, complete)
            if proposal is not None and _is_possible(proposal.site):
                return proposal
    return None


def _is_possible(site: Site) -> bool:
    """Whether a site file could say this: not where somebody tells a home 2000 km above the sea."""
    try:
        parse_site(format_site(site))
    except SiteError:
        return False
    return True


def _from_landing(told: _Told, complete: bool) -> SiteProposal | None:
    found = told.landing()
    if found is None:
        return None
    before, landing = found
    home = told.home()
    altitude, told_by = _ground_altitude(told, landing, home)
    if altitude is None:
        return None
    _, direction = _leg(before, landing)
    why = (
        f"the landing item of the mission of {told.aircraft}, in the direction of its last leg; altitude from {told_by}"
    )
    height = altitude + (told.separation_m() or 0.0)
    aiming = Runway(landing.latitude_rad, landing.longitude_rad, height, direction, **_SIZE)
    back = RunwayFrame(aiming).geodetic_from_runway((-aiming.aiming_point_x_m, 0.0, 0.0))
    return _proposal(told, (float(back[0]), float(back[1])), altitude, direction, why)


def _ground_altitude(told: _Told, landing: PlanPoint, home: PlanPoint | None) -> tuple[float | None, str]:
    """Altitude of the landing point above mean sea level and what tells it; None while nothing does."""
    if landing.altitude_msl_m is not None:
        return landing.altitude_msl_m, "the item"
    if home is not None and home.altitude_msl_m is not None:
        return home.altitude_msl_m + (landing.altitude_above_home_m or 0.0), "home"
    standing = told.standing()
    if standing is not None and standing.altitude_msl_m is not None:
        return standing.altitude_msl_m, "where it stands"
    return None, ""


def _from_home(told: _Told, complete: bool) -> SiteProposal | None:
    home = told.home()
    if home is None or home.altitude_msl_m is None:
        return None
    heard_ns = told.reports[-1].received_at - told.reports[0].received_at
    if not complete and heard_ns < _SETTLED_NS and told.standing() is None and not told.has_moved():
        return None  # a compass that was just switched on still turns
    direction, meaning = _direction(told)
    why = f"the home position of {told.aircraft}, in the direction {meaning}"
    return _proposal(told, (home.latitude_rad, home.longitude_rad), home.altitude_msl_m, direction, why)


def _from_standing(told: _Told, complete: bool) -> SiteProposal | None:
    return _at_report(told, told.standing(), "where {} stands, in the direction {}")


def _from_first_report(told: _Told, complete: bool) -> SiteProposal | None:
    if not complete and told.reports[-1].received_at - told.reports[0].received_at < _PATIENCE_NS:
        return None
    return _at_report(told, told.reports[0], "where {} was heard first, in the direction {}: there is no better hint")


def _at_report(told: _Told, report: GpsReport | None, text: str) -> SiteProposal | None:
    if report is None:
        return None
    altitude = report.altitude_msl_m
    if altitude is None and report.height_m is not None:
        altitude = report.height_m - (told.separation_m() or 0.0)
    if altitude is None:
        return None
    direction, meaning = _direction(told)
    place = (report.latitude_rad, report.longitude_rad)
    return _proposal(told, place, altitude, direction, text.format(told.aircraft, meaning))


def _direction(told: _Told) -> tuple[float, str]:
    """A landing direction (compass, rad) and what it is: the standing aircraft's nose, else its first course."""
    standing = told.standing()
    if standing is not None and standing.compass_heading_rad is not None:
        return standing.compass_heading_rad, "in which it stands"
    for report in told.reports:
        if _speed_mps(report) >= _MOVING_MPS:
            return math.atan2(report.velocity_east_mps or 0.0, report.velocity_north_mps or 0.0), "in which it moves"
    heading = next((r.compass_heading_rad for r in told.reports if r.compass_heading_rad is not None), None)
    return (heading, "of its nose") if heading is not None else (0.0, "north, for want of a better one")


_SIZE: dict[str, Any] = {"length_m": LENGTH_M, "width_m": WIDTH_M, "threshold_crossing_height_m": CROSSING_HEIGHT_M}


def _proposal(
    told: _Told, place: tuple[float, float], altitude_msl_m: float, direction: float, why: str
) -> SiteProposal:
    separation = told.separation_m()
    if separation is None:
        why += "; the geoid separation is not given, 0 is assumed"
    degrees = math.degrees(direction) % 360.0
    runway = Runway(
        *place,
        altitude_msl_m + (separation or 0.0),
        direction % (2.0 * math.pi),
        geoid_separation_m=separation or 0.0,
        **_SIZE,
    )
    origin = f"{why}; landing direction {degrees:.0f} degrees, length {LENGTH_M:.0f} m assumed"
    return SiteProposal(Site(f"Landing of {told.aircraft}", runway), origin)


def _speed_mps(report: GpsReport) -> float:
    return math.hypot(report.velocity_east_mps or 0.0, report.velocity_north_mps or 0.0, report.velocity_up_mps or 0.0)


def _distance_m(one: GpsReport | PlanPoint, other: GpsReport | PlanPoint) -> float:
    return _leg(one, other)[0]


def _leg(one: GpsReport | PlanPoint, other: GpsReport | PlanPoint) -> tuple[float, float]:
    """Horizontal distance (m) and compass direction (rad) from one point to another near it."""
    frame = RunwayFrame(Runway(other.latitude_rad, other.longitude_rad, 0.0, 0.0))
    east, north, _ = (float(x) for x in frame.enu_from_geodetic(one.latitude_rad, one.longitude_rad, 0.0))
    return math.hypot(east, north), math.atan2(-east, -north)
