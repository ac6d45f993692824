"""The way that a [[vehicle]] of a scene file flies, from its words, its mission file or its points."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from adapters.mission_files import MissionFileError, read_mission
from gateway.observation import PlanPoint
from gateway.settings import Runway, Site, SiteError
from sim.earth import plan_of
from sim.paths import Abeam, CasePath, Delayed
from sim.paths import Path as Way
from sim.routes import RoutePath, RoutePoint
from sim.scene import Craft
from sim.scenes.script import Vehicle, Waypoint
from sim.scenes.traffic import TRAFFIC_WORDS, one_of_the_traffic

WORDS = ("approach", "landing", *TRAFFIC_WORDS)
USUAL_MPS: dict[Craft, float] = {"aeroplane": 70.0, "copter": 12.0, "ship": 8.0}
_AWAY = ("waypoint", "loiter", "take-off", "landing", "other")


def way_of(vehicle: Vehicle, site: Site, seed: int, system: int, where: str) -> Way:
    """Where it flies, in seconds of the scene; `where` names it for a person. Raises SiteError."""
    path = _path(vehicle, site, seed, system, where)
    return Delayed(path, vehicle.begin_s) if vehicle.begin_s else path


def beside(vehicle: Vehicle, way: Way, about: tuple[float, float]) -> Way:
    """The same way turned about a point of the ground plan, for a vehicle that is seen abeam."""
    return Abeam(way, vehicle.abeam_rad, *about) if vehicle.abeam_rad else way


def _path(vehicle: Vehicle, site: Site, seed: int, system: int, where: str) -> Way:
    route = vehicle.route
    if route == "approach":
        return CasePath()
    if route == "landing":
        return CasePath.landing(site.runway)
    if isinstance(route, str):
        return one_of_the_traffic(route, site, seed, system)
    points = _of_mission(route, vehicle, site.runway, where) if isinstance(route, Path) else route
    try:
        return RoutePath([_route_point(point, vehicle, site.runway) for point in points])
    except ValueError as error:
        raise SiteError(f"{where}: {error}.") from error


def _of_mission(path: Path, vehicle: Vehicle, runway: Runway, where: str) -> tuple[Waypoint, ...]:
    """The points of a mission file that are flown to. A landing aeroplane or copter stands there in the end."""
    try:
        mission = read_mission(path)
    except MissionFileError as error:
        raise SiteError(f"{where}: {error}") from error
    home_msl_m = next((point.altitude_msl_m for point in mission if point.kind == "home"), None)
    if home_msl_m is None:
        home_msl_m = runway.height_m - (runway.geoid_separation_m or 0.0)
    points = [_waypoint(point, home_msl_m) for point in mission if point.kind in _AWAY]
    if len(points) < 2:
        raise SiteError(f"{where}: {path} has {len(points)} point(s) to fly to; a route needs two.")
    lands = mission[-1].kind == "landing"
    return (*points[:-1], replace(points[-1], speed_mps=0.0)) if lands else tuple(points)


def _waypoint(point: PlanPoint, home_msl_m: float) -> Waypoint:
    altitude = point.altitude_msl_m
    if altitude is None and point.altitude_above_home_m is not None:
        altitude = home_msl_m + point.altitude_above_home_m
    return Waypoint(latitude_rad=point.latitude_rad, longitude_rad=point.longitude_rad, altitude_msl_m=altitude)


def _route_point(point: Waypoint, vehicle: Vehicle, runway: Runway) -> RoutePoint:
    if point.latitude_rad is not None and point.longitude_rad is not None:
        along_m, left_m = plan_of(runway, point.latitude_rad, point.longitude_rad)
    else:
        along_m, left_m = point.along_m or 0.0, point.left_m or 0.0
    height = point.height_m if point.height_m is not None else vehicle.height_m
    if point.altitude_msl_m is not None:
        height = point.altitude_msl_m + (runway.geoid_separation_m or 0.0) - runway.height_m
    speed = point.speed_mps if point.speed_mps is not None else vehicle.speed_mps
    usual = USUAL_MPS[vehicle.craft]
    return RoutePoint(along_m, left_m, height or 0.0, usual if speed is None else speed)


def ends(way: Way) -> bool:
    """Whether a vehicle is gone at some time."""
    return math.isfinite(way.end_s)
