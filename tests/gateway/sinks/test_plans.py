"""Plans and intents as they are drawn: which points, where, and when again."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, Intent, PlanPoint
from gateway.picture import Picture
from gateway.settings import DEMO_SITE
from gateway.sinks.scene.entry import Rows
from gateway.sinks.scene.flown import Flights
from gateway.sinks.scene.plans import PlanScene

FRAME = RunwayFrame(DEMO_SITE.runway)
PLAN, NEXT = r"/raw/gps/mavlink\:1/plan", r"/raw/gps/mavlink\:1/next"


def point(sequence: int, kind: str, x_m: float, **altitude: float) -> PlanPoint:
    latitude, longitude, _ = FRAME.geodetic_from_runway([x_m, 0.0, 0.0])
    return PlanPoint(sequence, kind, float(latitude), float(longitude), **altitude)


POINTS = (
    point(0, "home", 0.0, altitude_msl_m=535.0),  # the demo field's: 500 m above the ellipsoid, the geoid 35 m below it
    point(1, "take-off", -2000.0, altitude_above_home_m=100.0),
    point(2, "waypoint", -8000.0, altitude_msl_m=1535.0),
    point(3, "landing", -1000.0, altitude_above_home_m=0.0),
)


def told(picture: Picture, *said: Any) -> Picture:
    """A picture in which this was said."""
    return replace(picture, observations=said)


def plan(picture: Picture, points: tuple[PlanPoint, ...] = POINTS) -> FlightPlan:
    return FlightPlan("mavlink:1", picture.now, picture.now, points)


def column(entries: list[Any], path: str, name: str) -> Any:
    """One component of the only row of an entity."""
    (row,) = [entry for entry in entries if isinstance(entry, Rows) and entry.path == path]
    (found,) = [part.as_arrow_array() for part in row.columns if part.component_descriptor().component == name]
    return found.to_pylist()[0]


def test_a_plan_is_drawn_point_by_point_at_its_heights(pictures):
    entries = PlanScene(DEMO_SITE).entries([told(pictures(0.2)[0], plan(pictures(0.2)[0]))], [])
    assert column(entries, PLAN, "Points3D:labels") == ["home", "1 take-off", "2", "3 landing"]
    place = np.array(column(entries, PLAN, "Points3D:positions"))
    latitude, longitude, height = FRAME.geodetic_from_runway(place)
    assert height == pytest.approx([500.0, 600.0, 1500.0, 500.0], abs=0.01)
    ground = np.array(column(entries, PLAN, "GeoPoints:positions"))
    assert np.degrees(np.stack([latitude, longitude], axis=-1)) == pytest.approx(ground, abs=1e-6)


def test_home_is_no_part_of_the_way(pictures):
    entries = PlanScene(DEMO_SITE).entries([told(pictures(0.2)[0], plan(pictures(0.2)[0]))], [])
    (line,) = column(entries, PLAN, "LineStrips3D:strips")
    assert len(line) == 3
    alone = PlanScene(DEMO_SITE).entries([told(pictures(0.2)[0], plan(pictures(0.2)[0], POINTS[:1]))], [])
    assert column(alone, PLAN, "Points3D:labels") == ["home"]


def test_an_intent_marks_the_point_of_the_plan_that_it_names(pictures):
    one, other = pictures(0.4)
    scene = PlanScene(DEMO_SITE)
    first = Intent("mavlink:1", one.now, one.now, "mission", sequence=3)
    entries = scene.entries([told(one, plan(one), first)], [])
    assert column(entries, NEXT, "Points3D:positions")[0] == column(entries, PLAN, "Points3D:positions")[3]
    assert scene.entries([told(other, replace(first, valid_at=other.now))], []) == []  # nothing new in it
    assert scene.entries([told(other, replace(first, sequence=2))], []) != []


def test_an_intent_may_name_a_place_of_its_own(pictures):
    picture = pictures(0.2)[0]
    there = point(0, "next", -5000.0)
    intent = Intent("mavlink:1", 0, 0, "utm", None, there.latitude_rad, there.longitude_rad, height_m=700.0)
    entries = PlanScene(DEMO_SITE).entries([told(picture, intent)], [])
    _, _, height = FRAME.geodetic_from_runway(column(entries, NEXT, "Points3D:positions")[0])
    assert height == pytest.approx(700.0, abs=0.01)


def test_an_intent_that_names_nothing_known_draws_nothing(pictures):
    picture = pictures(0.2)[0]
    assert PlanScene(DEMO_SITE).entries([told(picture, Intent("mavlink:1", 0, 0, "mission", sequence=9))], []) == []


def test_a_plan_is_drawn_again_for_the_next_track_of_its_aircraft(pictures):
    """When a track ends, what its aircraft said leaves the scene with it; the plan is not told again."""
    made = pictures(14.0)
    scene, flights = PlanScene(DEMO_SITE), Flights(DEMO_SITE)
    first = scene.entries([told(made[0], plan(made[0]))], flights.gather(made[:30]))
    assert any(entry.path == PLAN for entry in first)
    assert scene.entries(made[30:40], flights.gather(made[30:40])) == []
    renamed = [replace(one, fuse=replace(one.fuse, track=one.fuse.track + 6)) for one in made[40:]]
    again = scene.entries(renamed, flights.gather(renamed))
    assert column(again, PLAN, "Points3D:labels")[0] == "home"


def test_a_plan_without_altitudes_lies_on_the_ground(pictures):
    picture = pictures(0.2)[0]
    bare = (point(1, "waypoint", -2000.0), point(2, "waypoint", -4000.0))
    entries = PlanScene(DEMO_SITE).entries([told(picture, plan(picture, bare))], [])
    _, _, height = FRAME.geodetic_from_runway(np.array(column(entries, PLAN, "Points3D:positions")))
    assert height == pytest.approx([500.0, 500.0], abs=0.01)
    assert not math.isnan(height[0])
