"""Mission files that are written are read again."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.mission_files import read_mission
from adapters.mission_writing import (
    ABOVE_SEA,
    CHANGE_SPEED,
    LAND,
    NO_PLACE,
    TAKE_OFF,
    WAYPOINT,
    Fence,
    MissionItem,
    format_plan,
    format_waypoints,
)

HOME = (-35.363261, 149.165230, 584.09)
PLACES = st.tuples(st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(-400.0, 9000.0)).filter(
    lambda place: abs(place[0]) > 1e-9 or abs(place[1]) > 1e-9
)


@pytest.mark.parametrize("form", ["plan", "waypoints"])
@given(places=st.lists(PLACES, min_size=1, max_size=5))
@settings(max_examples=20, deadline=None)
def test_places_come_back_within_a_ten_millionth_of_a_degree(
    form: str, places: list[tuple[float, float, float]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    items = [MissionItem(WAYPOINT, *place, frame=ABOVE_SEA) for place in places]
    path = tmp_path_factory.getbasetemp() / f"mission.{form}"
    path.write_text(format_plan(items, HOME) if form == "plan" else format_waypoints(items, HOME))
    home, *points = read_mission(path)
    assert home.kind == "home"
    for point, place in zip(points, places, strict=True):
        assert abs(math.degrees(point.latitude_rad) - place[0]) <= 1e-7
        assert abs(math.degrees(point.longitude_rad) - place[1]) <= 1e-7
        assert point.altitude_msl_m == pytest.approx(place[2], abs=1e-3)


@pytest.mark.parametrize("form", ["plan", "waypoints"])
def test_items_keep_their_numbers_kinds_and_what_altitudes_are_above(form: str, tmp_path: Path) -> None:
    """A change of speed is no place, and takes a number."""
    items = [
        MissionItem(TAKE_OFF, -35.36, 149.16, 50.0, parameters=(15.0, 0.0, 0.0, math.nan)),
        MissionItem(CHANGE_SPEED, frame=NO_PLACE, parameters=(1.0, 40.0, -1.0, 0.0)),
        MissionItem(WAYPOINT, -35.35, 149.16, 300.0),
        MissionItem(LAND, -35.36, 149.165, 584.0, frame=ABOVE_SEA),
    ]
    path = tmp_path / "mission"
    path.write_text(format_plan(items, HOME) if form == "plan" else format_waypoints(items, HOME))
    read = [(one.sequence, one.kind, one.altitude_msl_m, one.altitude_above_home_m) for one in read_mission(path)]
    assert read == [
        (0, "home", 584.09, None),
        (1, "take-off", None, 50.0),
        (3, "waypoint", None, 300.0),
        (4, "landing", 584.0, None),
    ]


def test_areas_to_keep_out_of_are_exclusion_fences() -> None:
    fences = [Fence(((1.0, 2.0),), 500.0), Fence(((1.0, 2.0), (1.1, 2.0), (1.1, 2.1)))]
    fence = json.loads(format_plan([MissionItem(WAYPOINT, 1.0, 2.0, 50.0)], HOME, fences=fences))["geoFence"]
    assert fence["circles"] == [
        {"version": 1, "inclusion": False, "circle": {"center": [1.0, 2.0], "radius": 500.0}},
    ]
    assert fence["polygons"] == [
        {"version": 1, "inclusion": False, "polygon": [[1.0, 2.0], [1.1, 2.0], [1.1, 2.1]]},
    ]
