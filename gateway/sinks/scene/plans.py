"""Where aircraft have said that they will go: /raw/gps/{aircraft}/plan, and the point they go to now, .../next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, Intent, PlanPoint
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity, once
from gateway.sinks.scene.flown import Flown
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.mapped import label_look, line_look

Floats = NDArray[np.float64]


@dataclass(slots=True)
class _Told:
    """What one aircraft has said of its way, and the track for which it was drawn last."""

    plan: FlightPlan | None = None
    intent: Intent | None = None
    track: int | None = None


class PlanScene:
    """Draws plans and intents as they are told, and again when their aircraft's track begins anew."""

    def __init__(self, site: Site) -> None:
        self._frame, self._geoid_m = RunwayFrame(site.runway), site.runway.geoid_separation_m or 0.0
        self._runway_m = site.runway.height_m
        self._told: dict[str, _Told] = {}
        self._lately: Lately[str] = Lately(self._told.pop)
        self._looked: Lately[str] = Lately()

    def entries(self, pictures: Sequence[Picture], flights: Sequence[Flown]) -> list[Entry]:
        """What these pictures add; `flights` are their tracks."""
        entries: list[Entry] = []
        for picture in pictures:
            for one in picture.observations:
                if isinstance(one, FlightPlan | Intent):
                    entries += self._taken(one, picture.now, picture.step)
        for flown in flights:
            aircraft = next((name for name in flown.aircraft if name in self._told), None)
            if aircraft is None:
                continue
            self._lately.is_new(aircraft, int(flown.time[-1]))
            told = self._told[aircraft]
            if told.track != flown.track:  # with the one before it, what had been drawn left the scene
                told.track = flown.track
                now, step = int(flown.time[-1]), int(flown.step[-1])
                entries += [*self._way(aircraft, told, now, step), *self._goal(aircraft, told, now, step)]
        return entries

    def _taken(self, one: FlightPlan | Intent, now: int, step: int) -> list[Entry]:
        self._lately.is_new(one.aircraft, now)
        told = self._told.setdefault(one.aircraft, _Told())
        if isinstance(one, FlightPlan):
            if told.plan is not None and told.plan.points == one.points:
                return []
            told.plan = one
            return [*self._way(one.aircraft, told, now, step), *self._goal(one.aircraft, told, now, step)]
        if told.intent is not None and _named_by(told.intent) == _named_by(one):
            return []
        told.intent = one
        return self._goal(one.aircraft, told, now, step)

    def _way(self, aircraft: str, told: _Told, now: int, step: int) -> list[Entry]:
        """The points of the plan, with a line along them."""
        points = told.plan.points if told.plan is not None else ()
        if not points:
            return []
        path = entity("raw", "gps", aircraft, "plan")
        place, ground = self._placed(points)
        whats = [_named(point) for point in points]
        along = [row for row, point in enumerate(points) if point.kind != "home"]  # home is no part of the way
        dots = rr.Points3D.columns(positions=place, labels=whats).partition([len(points)])
        flat = rr.GeoPoints.columns(positions=ground).partition([len(points)])
        lines = (
            [columns.strips_3d([place[along]], [1]), columns.strips_on_map([ground[along]], [1])]
            if len(along) > 1
            else []
        )
        return [*self._looks(path, style.PLAN, 2.0, now), once(path, now, step, dots, flat, *lines)]

    def _goal(self, aircraft: str, told: _Told, now: int, step: int) -> list[Entry]:
        """The point that it goes to now."""
        goal = self._next(told)
        if goal is None:
            return []
        path = entity("raw", "gps", aircraft, "next")
        place, ground = self._placed([goal])
        dots = rr.Points3D.columns(positions=place, labels=["next"])
        row = once(path, now, step, dots, rr.GeoPoints.columns(positions=ground))
        return [*self._looks(path, style.NEXT, 5.0, now), row]

    def _looks(self, path: str, colour: style.Colour, size: float, now: int) -> list[Entry]:
        if not self._looked.is_new(path, now):
            return []
        return [Always(path, (*label_look(colour, size), *line_look(colour, 0.5)))]

    def _next(self, told: _Told) -> PlanPoint | None:
        """The point that an intent names, by its place or by its number in the plan."""
        intent = told.intent
        if intent is None:
            return None
        known = told.plan.points if told.plan is not None else ()
        named = next((p for p in known if p.sequence == intent.sequence and p.kind != "home"), None)
        if intent.latitude_rad is None or intent.longitude_rad is None:
            return named
        altitude = intent.altitude_msl_m
        if altitude is None and intent.height_m is not None:
            altitude = intent.height_m - self._geoid_m
        return PlanPoint(intent.sequence or 0, "next", intent.latitude_rad, intent.longitude_rad, altitude)

    def _placed(self, points: Sequence[PlanPoint]) -> tuple[Floats, Floats]:
        """Where points stand in the runway frame (n, 3), and in degrees (n, 2); without an altitude on the ground."""
        home = next((point.altitude_msl_m for point in points if point.kind == "home"), None)
        ground_m = self._runway_m if home is None else home + self._geoid_m
        height = [
            point.altitude_msl_m + self._geoid_m
            if point.altitude_msl_m is not None
            else ground_m + (point.altitude_above_home_m or 0.0)
            for point in points
        ]
        latitude = np.array([point.latitude_rad for point in points])
        longitude = np.array([point.longitude_rad for point in points])
        place = self._frame.runway_from_geodetic(latitude, longitude, height)
        return place, np.degrees(np.stack([latitude, longitude], axis=-1))


def _named(point: PlanPoint) -> str:
    """A label as short as it can be: most points are waypoints, known by their number."""
    if point.kind == "home":
        return "home"
    return str(point.sequence) if point.kind in ("waypoint", "other") else f"{point.sequence} {point.kind}"


def _named_by(intent: Intent) -> tuple[object, ...]:
    """What an intent names, without when it was said."""
    return intent.sequence, intent.latitude_rad, intent.longitude_rad, intent.altitude_msl_m, intent.height_m
