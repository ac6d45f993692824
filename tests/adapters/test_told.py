"""What people tell the gateway."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameEncoder
from adapters.told import ToldPlan, decode, encode_plan
from gateway.observation import FlightPlan, PlanPoint

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
TOLD, LINK = Source(0, "told", "commands", "field.plan"), Source(1, "mavlink", "link", "udpin:0")
POINTS = (
    PlanPoint(1, "take-off", math.radians(31.0), math.radians(104.0), altitude_above_home_m=20.0),
    PlanPoint(2, "waypoint", math.radians(31.1), math.radians(104.1), altitude_msl_m=600.0),
    PlanPoint(4, "loiter", math.radians(31.1), math.radians(104.2), radius_m=-150.0, turns=1.5),
    PlanPoint(5, "landing", math.radians(31.0), math.radians(104.0)),
)


def _plans(observations: tuple[object, ...]) -> list[FlightPlan]:
    return [one for one in observations if isinstance(one, FlightPlan)]


def test_a_plan_that_is_told_is_read_as_it_was_written() -> None:
    plan = decode(encode_plan("mavlink:1", POINTS))
    assert plan is not None
    assert plan.aircraft == "mavlink:1"
    assert [(one.sequence, one.kind, one.altitude_msl_m, one.altitude_above_home_m) for one in plan.points] == [
        (1, "take-off", None, 20.0), (2, "waypoint", 600.0, None), (4, "loiter", None, None), (5, "landing", None, None),
    ]  # fmt: skip
    assert [(one.radius_m, one.turns) for one in plan.points] == [
        (None, None),
        (None, None),
        (-150.0, 1.5),
        (None, None),
    ]
    assert plan.points[1].latitude_rad == pytest.approx(math.radians(31.1), abs=1e-15)


def test_a_told_plan_of_a_named_aircraft_is_heard_at_once() -> None:
    (plan,) = _plans(Decoder([TOLD]).feed(Arrival(T0, 0, encode_plan("mavlink:2", POINTS))).observations)
    assert (plan.aircraft, len(plan.points), plan.valid_at) == ("mavlink:2", 4, T0)


def test_a_told_plan_of_nobody_in_particular_is_the_first_vehicles_once_there_is_one() -> None:
    decoder, plane = Decoder([TOLD, LINK]), FrameEncoder(7)
    assert decoder.feed(Arrival(T0, 0, encode_plan("*", POINTS))).observations == ()
    beat = plane.encode(
        "HEARTBEAT", type=1, autopilot=3, base_mode=0, custom_mode=0, system_status=4, mavlink_version=3
    )
    (plan,) = _plans(decoder.feed(Arrival(T0 + SECOND, 1, beat)).observations)
    assert plan.aircraft == "mavlink:7"
    assert _plans(decoder.feed(Arrival(T0 + 2 * SECOND, 1, beat)).observations) == []


def test_a_home_that_is_heard_joins_the_told_plan_and_does_not_replace_it() -> None:
    decoder, plane = Decoder([TOLD, LINK]), FrameEncoder(7)
    decoder.feed(Arrival(T0, 0, encode_plan("mavlink:7", POINTS)))
    home = plane.encode("HOME_POSITION", latitude=310_000_000, longitude=1_040_000_000, altitude=500_000,
                        **dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0),
                        q=[1.0, 0, 0, 0])  # fmt: skip
    (plan,) = _plans(decoder.feed(Arrival(T0 + SECOND, 1, home)).observations)
    assert [one.kind for one in plan.points] == ["home", "take-off", "waypoint", "loiter", "landing"]


@pytest.mark.parametrize(
    "change",
    [
        {"told": "weather"},
        {"points": None},
        {"aircraft": 1},
        {"points": [{"sequence": 1, "kind": "waypoint", "latitude_deg": 91.0, "longitude_deg": 0.0}]},
        {"points": [{"sequence": 1, "kind": "waypoint", "latitude_deg": "31", "longitude_deg": 0.0}]},
        {"points": [{"sequence": True, "kind": "waypoint", "latitude_deg": 31.0, "longitude_deg": 0.0}]},
        {"points": [{"sequence": 1, "kind": ["waypoint"], "latitude_deg": 31.0, "longitude_deg": 0.0}]},
        {"points": [{"sequence": 1, "latitude_deg": math.nan, "longitude_deg": 0.0}]},
        {"points": [{"sequence": 1, "latitude_deg": 1.0, "longitude_deg": 0.0, "altitude_msl_m": "high"}]},
        {"points": [{"sequence": 1, "latitude_deg": 1.0, "longitude_deg": 0.0, "radius_m": 0.0}]},
        {"points": [{"sequence": 1, "latitude_deg": 1.0, "longitude_deg": 0.0}] * 2},
    ],
)
def test_a_line_that_is_wrong_anywhere_is_not_understood_as_a_whole(change: dict[str, Any]) -> None:
    line = json.dumps(json.loads(encode_plan("mavlink:1", POINTS)) | change).encode()
    decoder = Decoder([TOLD])
    assert decoder.feed(Arrival(T0, 0, line)).observations == ()
    assert decoder.counters() == {"commands not understood": 1}


@given(st.one_of(st.binary(max_size=60), st.text(max_size=60).map(str.encode), st.just(b"[" * 100_000)))
def test_no_line_raises(line: bytes) -> None:
    told = decode(line)
    assert told is None or isinstance(told, ToldPlan)
