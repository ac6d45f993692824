"""Mission files of ground stations."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from adapters.mission_files import MissionFileError, mission_kind, read_mission

WAYPOINTS = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t-35.363261\t149.165230\t584.09\t1
1\t0\t3\t22\t15\t0\t0\t0\t-35.3600\t149.1650\t50\t1
2\t0\t0\t16\t0\t0\t0\t0\t-35.3500\t149.1640\t700\t1
3\t0\t3\t178\t0\t20\t0\t0\t0\t0\t0\t1
4\t0\t3\t21\t0\t0\t0\t0\t-35.3632\t149.1652\t0\t1
"""


def simple(command: int, *place: float | None, frame: int = 3) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": [0, 0, 0, None, *place]}


def plan(*items: Any, **mission: Any) -> str:
    return json.dumps({"fileType": "Plan", "version": 1, "mission": {"items": list(items), **mission}}, indent=2)


def read(tmp_path: Path, text: str) -> list[tuple[int, str, float, float | None, float | None]]:
    """Sequence, kind, latitude (degrees), altitude above mean sea level, above home."""
    path = tmp_path / "mission"
    path.write_text(text)
    return [
        (
            one.sequence,
            one.kind,
            round(math.degrees(one.latitude_rad), 6),
            one.altitude_msl_m,
            one.altitude_above_home_m,
        )
        for one in read_mission(path)
    ]


def test_a_waypoint_file_gives_home_and_the_places_to_fly_to(tmp_path: Path) -> None:
    """Item 3 only sets a speed; items keep their numbers."""
    assert read(tmp_path, WAYPOINTS) == [
        (0, "home", -35.363261, 584.09, None),
        (1, "take-off", -35.36, None, 50.0),
        (2, "waypoint", -35.35, 700.0, None),
        (4, "landing", -35.3632, None, 0.0),
    ]


def test_a_plan_gives_home_simple_items_a_surveys_own_and_a_landing(tmp_path: Path) -> None:
    survey = {"type": "ComplexItem", "complexItemType": "survey"}
    survey["TransectStyleComplexItem"] = {
        "Items": [simple(16, 1.0, 2.0, 60.0), simple(206, None, None, None), simple(16, 1.1, 2.0, 60.0)]
    }
    landing = {"type": "ComplexItem", "complexItemType": "fwLandingPattern", "altitudesAreRelative": True}
    landing |= {"landingApproachCoordinate": [1.3, 2.0, 40.0], "landCoordinate": [1.4, 2.0, 0.0]}
    text = plan(simple(22, 0.9, 2.0, 30.0), survey, landing, plannedHomePosition=[0.8, 2.0, 480.0], firmwareType=3)
    assert read(tmp_path, text) == [
        (0, "home", 0.8, 480.0, None),
        (1, "take-off", 0.9, None, 30.0),
        (2, "waypoint", 1.0, None, 60.0),
        (4, "waypoint", 1.1, None, 60.0),
        (6, "loiter", 1.3, None, 40.0),
        (7, "landing", 1.4, None, 0.0),
    ]


def test_circles_keep_their_radius_and_turns(tmp_path: Path) -> None:
    """Of waypoint files, of a plan's items, and of a landing pattern, whose height may also be left straight on."""
    path = tmp_path / "mission"
    circle = {"type": "SimpleItem", "command": 18, "frame": 3, "params": [2, 0, -150, None, 1.0, 2.0, 60.0]}
    landing = {"type": "ComplexItem", "complexItemType": "fwLandingPattern", "loiterRadius": 75.0}
    landing |= {"landingApproachCoordinate": [1.3, 2.0, 40.0], "landCoordinate": [1.4, 2.0, 0.0]}
    left, straight = {**landing, "loiterClockwise": False}, {**landing, "useLoiterToAlt": False}
    line = "1\t0\t3\t18\t1.5\t0\t220\t0\t-35.36\t149.165\t50\t1\n"
    told = {}
    for name, text in {
        "lines": f"QGC WPL 110\n{line}",
        "circle": plan(circle),
        "landing": plan(landing),
        "left": plan(left),
        "straight": plan(straight),
    }.items():
        path.write_text(text)
        first = read_mission(path)[0]
        told[name] = (first.kind, first.radius_m, first.turns)
    assert told == {
        "lines": ("loiter", 220.0, 1.5),
        "circle": ("loiter", -150.0, 2.0),
        "landing": ("loiter", 75.0, None),
        "left": ("loiter", -75.0, None),
        "straight": ("waypoint", None, None),
    }


def test_px4_numbers_its_items_from_zero(tmp_path: Path) -> None:
    text = plan(simple(22, 0.9, 2.0, 30.0), simple(16, 1.0, 2.0, 60.0), firmwareType=12)
    assert [row[:2] for row in read(tmp_path, text)] == [(0, "take-off"), (1, "waypoint")]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (WAYPOINTS.replace("110", "120"), "line 1: version '120'"),
        (WAYPOINTS.replace("\t700\t1", "\t700"), "line 4: an item has 12 columns, here are 11"),
        (WAYPOINTS.replace("149.1640", "east"), "line 4: 'east' is not a number"),
        (WAYPOINTS.replace("2\t0\t0\t16", "2\t0\t0\t1.5"), "line 4: '1.5' is not a whole number"),
        ("QGC WPL 110\n", "no item that is a place"),
        (plan(simple(16, 1.0, 2.0, 3.0))[:-3] + ",,", "is not JSON"),
        (WAYPOINTS.replace("22\t15", "22\tup"), "line 3: 'up' is not a number"),
        (plan(simple(16, 1.0, 2.0)), "item 1: params has 6 values"),
        (plan(simple(16, 1.0, 2.0, 3.0), {"type": "SimpleItem"}), "item 2: params is missing"),
        (plan({"type": "ComplexItem", "complexItemType": "StructureScan"}), "type 'StructureScan'"),
        (plan({"type": "Odd"}), "type 'Odd' is not known"),
        ('{"fileType": "Plan"}', "mission is missing"),
        (plan(simple(16, 1.0, 2.0, 3.0), plannedHomePosition=7), "plannedHomePosition: a place is"),
        ("42\n", "no mission file"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence_with_where(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(MissionFileError) as refused:
        read(tmp_path, text)
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError, match="cannot be read"):
        read_mission(tmp_path / "none.plan")


def test_a_deeply_nested_plan_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissionFileError):
        read(tmp_path, '{"fileType": "Plan", "mission": ' + "[" * 100_000)


def test_mission_files_are_told_by_their_beginning() -> None:
    assert mission_kind(WAYPOINTS.encode()) == "waypoints"
    assert mission_kind(plan().encode()) == "plan"
    assert mission_kind(b'{"fileType": "Other"}') is None
