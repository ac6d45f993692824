"""Arrival flows as candidates of intent: who has told no plan goes on along a way that many came."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, GpsReport, Heard, PlanPoint
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.predict import ArrivalFlow
from gateway.predict.arrival_flows import NARROW_M
from gateway.runtime.flow_tables import corners
from gateway.runtime.flow_ways import FlowsError, flows_near, read_ways, write_ways
from gateway.runtime.folder import FolderError, Record, read_record, write_record
from gateway.runtime.playback import open_playback
from gateway.settings import DEMO_SITE, Options

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
FRAME = RunwayFrame(DEMO_SITE.runway)
SPEED = 60.0
CORNER_M = (-20_000.0, 12_000.0)  # ENU: the flow comes from the north to here, and turns left, east, to the runway


def flow(spread_m: float = 100.0) -> ArrivalFlow:
    enu = [(CORNER_M[0], 30_000.0, 1500.0), (*CORNER_M, 1500.0), (-1500.0, 12_000.0, 800.0), (0.0, 0.0, 0.0)]
    points = []
    for place in enu:
        latitude, longitude, height = FRAME.geodetic_from_enu(np.array(place))
        points.append((float(latitude), float(longitude), float(height) - DEMO_SITE.runway.height_m))
    return ArrivalFlow(1, 12, spread_m, tuple(points))


def flown(flows: tuple[ArrivalFlow, ...], *, aside_m: float = 0.0, plan: FlightPlan | None = None) -> Picture:
    """South along the flow's first leg, or beside it, to 1.5 km before its corner."""
    said = [plan] if plan else []
    for half in range(120):
        at = T0 + half * SECOND // 2
        enu = (CORNER_M[0] + aside_m, CORNER_M[1] + 1500.0 + SPEED * (60.0 - half / 2), 1500.0)
        latitude, longitude, height = (float(part) for part in FRAME.geodetic_from_enu(np.array(enu)))
        msl_m = height - DEMO_SITE.runway.geoid_separation_m
        said.append(GpsReport("mavlink:1", at, at, latitude, longitude, msl_m, None, 0.0, -SPEED, 0.0, 3.0, 5.0, 0.3))
    state = initial(DEMO_SITE, Options(horizons_s=(60.0,)), flows=flows)
    return step(state, [Heard(one.received_at + 4000 * k, (one,)) for k, one in enumerate(said)])[1]


def off_m(picture: Picture, east_m: float, north_m: float) -> float:
    latitude, longitude = picture.predict.latitude_rad[-1], picture.predict.longitude_rad[-1]
    there = FRAME.enu_from_geodetic(latitude, longitude, DEMO_SITE.runway.height_m)
    return math.hypot(float(there[0]) - east_m, float(there[1]) - north_m)


def test_who_flies_along_a_flow_is_foretold_to_turn_where_it_turns() -> None:
    """A minute on it is round the corner, within the size of the turn; without flows it flies straight on."""
    turned = (CORNER_M[0] + 60.0 * SPEED - 1500.0, CORNER_M[1])
    picture = flown((flow(),))
    assert picture.predict.intent[-1] == "flow 1, point 2"
    assert picture.predict.intent_kind[-1] == "inferred"
    assert off_m(picture, *turned) < 700.0
    straight = flown(())
    assert straight.predict.intent[-1] != "flow 1, point 2"
    assert off_m(straight, *turned) > 2500.0


def test_who_flies_beside_it_flies_on_beside_it() -> None:
    """A kilometre aside the corner is where it comes abeam of the flow's."""
    picture = flown((flow(),), aside_m=-1000.0)
    assert picture.predict.intent[-1] == "flow 1, point 2"
    assert off_m(picture, CORNER_M[0] - 1000.0 + 60.0 * SPEED - 1500.0, CORNER_M[1]) < 800.0


def test_a_plan_that_was_told_and_a_flow_of_vectored_flights_leave_flows_out() -> None:
    """Nobody who said where he goes is foretold by others' ways; nor anybody by a mean way that nobody flies."""
    ahead = FRAME.geodetic_from_enu(np.array([CORNER_M[0], CORNER_M[1] - 5000.0, 1500.0]))
    plan = FlightPlan("mavlink:1", T0, T0, (PlanPoint(1, "waypoint", float(ahead[0]), float(ahead[1]), 1500.0),))
    for picture in (flown((flow(),), plan=plan), flown((flow(2.0 * NARROW_M),))):
        assert not any(name and name.startswith("flow") for name in picture.predict.intent)


def test_flows_are_written_for_predictions_and_found_beside_sessions_of_their_airport(tmp_path: Path) -> None:
    """What is written is read again, to the bit of a degree; another airport's are not taken."""
    runway = DEMO_SITE.runway
    airport = math.degrees(runway.latitude_rad), math.degrees(runway.longitude_rad)
    write_ways([flow()], airport, tmp_path)
    (read,) = flows_near(tmp_path, DEMO_SITE)
    assert np.allclose(read.points, flow().points, rtol=0.0, atol=1e-15 * 1e6)
    assert (read.number, read.flights, read.spread_m) == (1, 12, 100.0)
    elsewhere = replace(DEMO_SITE, runway=replace(runway, latitude_rad=runway.latitude_rad + 0.01))
    assert flows_near(tmp_path, elsewhere) == ()
    assert flows_near(tmp_path / "nothing", DEMO_SITE) == ()


@pytest.mark.parametrize("spoil", ["{", '{"format": "x"}', "latitude_deg", "points", "number"])
def test_a_file_of_flows_that_is_damaged_is_a_sentence(tmp_path: Path, spoil: str) -> None:
    """Whatever stands in it."""
    path = write_ways([flow()], (49.0, 2.5), tmp_path)
    document = json.loads(path.read_text())
    if spoil == "latitude_deg":
        document["flows"][0]["points"][0][spoil] = 270.0
    elif spoil == "points":
        document["flows"][0][spoil] = []
    elif spoil == "number":
        document["flows"][0][spoil] = math.inf
    path.write_text(spoil if spoil.startswith("{") else json.dumps(document))
    with pytest.raises(FlowsError, match=r"flows\.json"):
        read_ways(tmp_path)


def test_a_mean_track_becomes_its_corners() -> None:
    """Of fifty points on two straight lines the ends and the corner are kept."""
    line = np.concatenate(
        [np.linspace([0, 0, 0], [10_000, 0, 0], 25), np.linspace([10_000, 400, 0], [10_000, 9000, 0], 25)]
    )
    assert corners(line, 500.0) == [0, 24, 49]


def test_a_session_keeps_the_flows_that_it_began_with(tmp_path: Path) -> None:
    """session.json holds them to the bit, and they are what it is replayed with."""
    write_record(tmp_path, Record("1", ("live",), Options(), T0, flows=(flow(),), watermark=T0, ended="done"))
    assert read_record(tmp_path).flows == (flow(),)
    assert open_playback([tmp_path]).flows == (flow(),)
    document = json.loads((tmp_path / "session.json").read_text())
    document["flows"][0]["points"] = [[9.0, 0.0, 0.0]]
    (tmp_path / "session.json").write_text(json.dumps(document))
    with pytest.raises(FolderError, match="flow 1"):
        read_record(tmp_path)
