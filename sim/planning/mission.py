"""A flight as a mission: as few waypoints as keep the polyline near the curve, with heights, a speed, and a landing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from adapters.mission_writing import (
    ABOVE_HOME,
    ABOVE_SEA,
    CHANGE_SPEED,
    LAND,
    LANDING_SEQUENCE,
    NO_PLACE,
    TAKE_OFF,
    WAYPOINT,
    Fence,
    MissionItem,
)
from sim.planning.flight import Flight, heights
from sim.planning.task import TOLERANCE_M

Floats = NDArray[np.float64]

HEIGHT_TOLERANCE_M = 5.0
_GROUND_SPEED = 1.0  # DO_CHANGE_SPEED's kind 0 is airspeed, 1 ground speed
_LONGEST = 400  # points of the curve that one straight may replace


def waypoints(flight: Flight, tolerance_m: float = TOLERANCE_M) -> Floats:
    """The route's waypoints (n, 3): east, north, height above home, m; the first and the last are its ends.

    From each the furthest is taken to which the straight keeps within the tolerance of all of the curve between.
    """
    curve = np.column_stack([flight.route.curve_m, heights(flight)])
    scaled = curve * [1.0, 1.0, tolerance_m / HEIGHT_TOLERANCE_M]
    chosen = [0]
    while chosen[-1] < len(curve) - 1:
        begin = chosen[-1]
        end = begin + 1
        for further in range(min(begin + _LONGEST, len(curve) - 1), begin, -1):
            if _off(scaled[begin : further + 1]) <= tolerance_m:
                end = further
                break
        chosen.append(end)
    return np.asarray(curve[chosen])


def _off(points: Floats) -> float:
    """How far points (n, 3) are at most from the straight between the first and the last."""
    along = points[-1] - points[0]
    length = float(np.linalg.norm(along))
    aside = points[1:-1] - points[0]
    if not len(aside) or length == 0.0:
        return 0.0
    share = np.clip(aside @ along / length**2, 0.0, 1.0)
    return float(np.linalg.norm(aside - share[:, None] * along, axis=1).max())


def mission(flight: Flight, speed_mps: float | None = None) -> tuple[list[MissionItem], tuple[float, float, float]]:
    """The items of a flight, and home: latitude and longitude in degrees, altitude above mean sea level in m.

    With a final, altitudes are above mean sea level, and the items end with a DO_LAND_START, the glide path and the landing;
    else they are above home, wherever it is flown.
    """
    frame = ABOVE_HOME if flight.final is None else ABOVE_SEA
    datum = 0.0 if flight.final is None else flight.altitude_msl_m
    plane = flight.case.plane

    def item(command: int, place_m: Floats, height_m: float) -> MissionItem:
        latitude, longitude = plane.place_deg(place_m).tolist()
        return MissionItem(command, latitude, longitude, datum + float(height_m), frame)

    route = waypoints(flight)
    items = [item(TAKE_OFF, flight.takes_off_m, route[0, 2])]
    if speed_mps is not None:
        items.append(MissionItem(CHANGE_SPEED, frame=NO_PLACE, parameters=(_GROUND_SPEED, speed_mps, -1.0, 0.0)))
    first = 1 if np.array_equal(flight.takes_off_m, route[0, :2]) else 0
    items += [item(WAYPOINT, point[:2], point[2]) for point in route[first:]]
    if (final := flight.final) is not None:
        items.insert(-1, item(LANDING_SEQUENCE, route[-1, :2], route[-1, 2]))
        items.append(item(WAYPOINT, final.meets_m, final.height_m))
        items.append(item(LAND, final.aims_m, 0.0))
    home = plane.place_deg(flight.home_m).tolist()
    return items, (home[0], home[1], flight.altitude_msl_m)


def fences(flight: Flight) -> list[Fence]:
    """The areas that the route keeps out of, as fences."""
    plane = flight.case.plane
    found = []
    for area in flight.areas:
        corners = tuple((latitude, longitude) for latitude, longitude in plane.place_deg(area.corners_m).tolist())
        found.append(Fence(corners, area.radius_m))
    return found


def duration_s(flight: Flight, speed_mps: float) -> float:
    """How long it takes from the take-off to the last point at this speed."""
    final = flight.final
    further = 0.0 if final is None else math.dist(flight.route.curve_m[-1], final.aims_m)
    return (flight.route.measures.length_m + further) / speed_mps
