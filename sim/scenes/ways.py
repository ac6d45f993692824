"""The way that a [[vehicle]] of a scene file flies, from its words, its mission file or its points."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from adapters.mission_files import MissionFileError, read_items, read_mission
from gateway.observation import PlanPoint
from gateway.settings import Runway, Site, SiteError
from sim.earth import plan_of
from sim.flown_way import Craft, FlownWay
from sim.paths import Abeam, CasePath, Delayed
from sim.paths import Path as Way
from sim.routes import RoutePath, RoutePoint
from sim.scenes.script import Script, Vehicle, Waypoint
from sim.scenes.traffic import TRAFFIC_WORDS, one_of_the_traffic
from sim.vehicles.motion import Home

WORDS = ("approach", "landing", *TRAFFIC_WORDS)
USUAL_MPS: dict[Craft, float] = {"aeroplane": 70.0, "airliner": 110.0, "copter": 12.0, "helicopter": 25.0, "ship": 8.0}
_AWAY_M = 50.0
_AWAY = ("waypoint", "loiter", "take-off", "landing", "other")


def way_of(vehicle: Vehicle, site: Site, seed: int, system: int, where: str) -> Way:
    """Where it flies, in seconds of the scene; `where` names it for a person. Raises SiteError."""
    path = _path(vehicle, site, seed, system, where)
    return Delayed(path, vehicle.begin_s) if vehicle.begin_s else path


def autopilots_way(vehicle: Vehicle, script: Script, site: Site, seed: int, system: int, where: str) -> FlownWay:
    """How a vehicle's own autopilot takes it along its mission, in the scene's wind and sea.

    It begins at home, or at the first place where there is none, as high as the runway. It points along the runway where
    it stands there, else to the first place that the mission leads to. Raises SiteError.
    """
    assert isinstance(vehicle.route, Path)
    try:
        items, home = read_items(vehicle.route)
    except MissionFileError as error:
        raise SiteError(f"{where}: {error}") from error
    places = [(one.latitude_deg, one.longitude_deg) for one in items if one.latitude_deg or one.longitude_deg]
    if not places:
        raise SiteError(f"{where}: {vehicle.route} has no place to go to.")
    separation_m = site.runway.geoid_separation_m or 0.0
    height_m = site.runway.height_m
    if home is not None:
        begins = math.degrees(home.latitude_rad), math.degrees(home.longitude_rad)
        height_m = height_m if home.altitude_msl_m is None else home.altitude_msl_m + separation_m
    else:
        begins = places[0]
    heading_rad = _heading_rad(begins, places, site.runway, on_runway=vehicle.craft != "ship")
    stands = Home(math.radians(begins[0]), math.radians(begins[1]), height_m, heading_rad, separation_m)
    return FlownWay(
        craft=vehicle.craft,
        home=stands,
        items=items,
        wind=script.wind,
        speed_mps=vehicle.speed_mps,
        goes_around=vehicle.goes_around,
        steering=vehicle.steering,
        current_mps=script.current_mps,
        seed=seed,
        system=system,
        start_s=vehicle.begin_s,
    )


def _heading_rad(
    begins_deg: tuple[float, float], places_deg: list[tuple[float, float]], runway: Runway, *, on_runway: bool
) -> float:
    x_m, y_m = plan_of(runway, math.radians(begins_deg[0]), math.radians(begins_deg[1]))
    if on_runway and abs(x_m) < 0.5 * runway.length_m and abs(y_m) < runway.width_m:
        return runway.landing_compass_rad
    for latitude_deg, longitude_deg in places_deg:
        to_x_m, to_y_m = plan_of(runway, math.radians(latitude_deg), math.radians(longitude_deg))
        if math.hypot(to_x_m - x_m, to_y_m - y_m) > _AWAY_M:
            return (runway.landing_compass_rad - math.atan2(to_y_m - y_m, to_x_m - x_m)) % (2.0 * math.pi)
    return runway.landing_compass_rad


def later(way: Way | FlownWay, by_s: float) -> Way | FlownWay:
    """The same way, later."""
    return way.starting(by_s) if isinstance(way, FlownWay) else Delayed(way, by_s)


def beside(vehicle: Vehicle, way: Way | FlownWay, about: tuple[float, float]) -> Way | FlownWay:
    """The same way turned about a point of the ground plan, for a vehicle that is seen abeam. Raises SiteError."""
    if not vehicle.abeam_rad:
        return way
    if isinstance(way, FlownWay):
        raise SiteError("abeam_deg turns ways; a mission that an autopilot flies leads where it leads.")
    return Abeam(way, vehicle.abeam_rad, *about)


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
