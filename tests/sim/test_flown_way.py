"""Vehicles of a scene that fly their missions by themselves: where they come, what they tell, and that a seed decides it."""

import math
from pathlib import Path

import numpy as np
import pytest

from adapters.mavlink_frames import message_name, parse
from adapters.mission_writing import LAND, TAKE_OFF, WAYPOINT, MissionItem, format_plan
from gateway.settings import DEMO_SITE, SiteError
from sim.earth import plan_of
from sim.events import events
from sim.flown_way import FlownWay
from sim.scene import Scene
from sim.scenes import parse_scene, stage

HOME = (31.0, 104.0, 535.0)
ROUND = (
    MissionItem(TAKE_OFF, 31.0, 104.004, 50.0),
    MissionItem(WAYPOINT, 31.001, 104.009, 60.0),
    MissionItem(WAYPOINT, 31.005, 104.012, 60.0),
    MissionItem(WAYPOINT, 31.007, 104.006, 60.0),
)
HOP = (
    MissionItem(TAKE_OFF, *HOME[:2], 20.0),
    MissionItem(WAYPOINT, 31.0005, 104.0005, 20.0),
    MissionItem(LAND, 31.0005, 104.0009, 0.0),
)
SAILS = (MissionItem(WAYPOINT, 31.005, 104.0, 0.0), MissionItem(WAYPOINT, 31.012, 104.002, 0.0))


def scene(folder: Path, kind: str, items: tuple[MissionItem, ...], seed: int = 1) -> Scene:
    """One vehicle, in wind, under the demo field's radar."""
    (folder / "round.plan").write_text(format_plan(items, HOME))
    text = f"""
[scene]
description = "One vehicle."
[wind]
speed_mps = 4.0
from_deg = 200.0
gust_sigma_mps = 1.0
[sea]
current_mps = 0.5
current_to_deg = 0.0
[[vehicle]]
kind = "{kind}"
route = "round.plan"
autopilot = true
begin_s = 5.0
"""
    return stage(parse_scene(text, "test", folder, "test"), start_ns=0, seed=seed)


@pytest.mark.parametrize(("kind", "items"), [("aeroplane", ROUND), ("copter", HOP), ("ship", SAILS)])
def test_every_place_is_passed_within_40_m(kind: str, items: tuple[MissionItem, ...], tmp_path: Path) -> None:
    """And at its height within 15 m; it begins at home when it is to begin."""
    given = scene(tmp_path, kind, items)
    (vehicle,) = given.aircraft
    assert isinstance(vehicle.path, FlownWay)
    assert vehicle.path.start_s == 5.0
    assert vehicle.path.current_mps == pytest.approx((0.0, 0.5))
    way = given.flown(vehicle, np.arange(*given.present(vehicle), 0.1))
    runway = DEMO_SITE.runway
    x, y = np.array([plan_of(runway, *place) for place in zip(way.latitude_rad, way.longitude_rad, strict=True)]).T
    assert math.hypot(x[0], y[0]) < 1.0
    for item in items:
        along, left = plan_of(runway, math.radians(item.latitude_deg), math.radians(item.longitude_deg))
        away = np.hypot(x - along, y - left)
        nearest = int(np.argmin(away))
        assert away[nearest] < 40.0
        if item.command == WAYPOINT:
            assert way.height_m[nearest] - 500.0 == pytest.approx(item.altitude_m, abs=15.0)


def test_a_copter_tells_its_mission_and_lands(tmp_path: Path) -> None:
    """Its type, all items with home, the item that it flies to, which only grows; it stands in the end, and is gone later."""
    given = scene(tmp_path, "copter", HOP)
    found = [frame for one in events(given) if (frame := parse(one.data)) is not None]
    said = [(message_name(frame.message), frame.payload) for frame in found]
    assert {payload[4] for name, payload in said if name == "HEARTBEAT"} == {2}
    assert [np.frombuffer(p[28:30], "<u2")[0] for name, p in said if name == "MISSION_ITEM_INT"] == [0, 1, 2, 3]
    current = [int(np.frombuffer(payload[:2], "<u2")[0]) for name, payload in said if name == "MISSION_CURRENT"]
    assert current == sorted(current)
    assert (current[0] <= 1, current[-1]) == (True, 3)
    (vehicle,) = given.aircraft
    end = given.flown(vehicle, vehicle.path.end_s - 1.0)
    assert end.height_m == pytest.approx(500.0, abs=0.5)
    assert np.linalg.norm(end.velocity_mps) < 0.1
    assert given.duration_s == vehicle.path.end_s


def test_a_seed_decides_the_gusts(tmp_path: Path) -> None:
    """The same seed flies the same way to the last bit, another one a little differently."""
    one, again, other = (scene(tmp_path, "copter", HOP, seed=seed) for seed in (1, 1, 2))
    times = np.arange(6.0, 30.0, 0.5)
    first, same, different = (given.flown(given.aircraft[0], times) for given in (one, again, other))
    assert np.array_equal(first.longitude_rad, same.longitude_rad)
    assert 0.0 < np.max(np.abs(first.longitude_rad - different.longitude_rad)) * 5.5e6 < 20.0


def test_an_autopilot_needs_a_mission(tmp_path: Path) -> None:
    """A word is no mission, and that is said with the line."""
    text = '[scene]\ndescription = "A test."\n[[vehicle]]\nroute = "approach"\nautopilot = true\n'
    with pytest.raises(SiteError, match="line 4: an autopilot flies a mission file"):
        parse_scene(text, "my.toml", tmp_path, "my")
