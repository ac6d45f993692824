"""A mission is given to a vehicle: the ground station's side against a vehicle's, over links that lose frames."""

import math
import random

import pytest

from adapters.mavlink_frames import Frame, encode, parse
from adapters.mission_server import MissionServer
from adapters.mission_upload import MissionUpload
from adapters.mission_writing import ABOVE_SEA, LAND, TAKE_OFF, WAYPOINT, MissionItem

SECOND = 10**9
HOME = (31.0, 104.0, 535.0)
ITEMS = [
    MissionItem(TAKE_OFF, 31.0, 104.0, 50.0, parameters=(15.0, 0.0, 0.0, math.nan)),
    *(MissionItem(WAYPOINT, 31.0 + 0.01 * number, 104.0, 300.0) for number in range(1, 9)),
    MissionItem(LAND, 31.1, 104.0, 0.0),
]
COMMANDS = frozenset({WAYPOINT, TAKE_OFF, LAND})


def heard(name: str, values: dict[str, object], system: int) -> Frame:
    frame = parse(encode(name, values, system=system))
    assert frame is not None
    return frame


def heartbeat(system: int = 7, autopilot: int = 3) -> Frame:
    values = {
        "type": 1,
        "autopilot": autopilot,
        "base_mode": 0,
        "custom_mode": 0,
        "system_status": 4,
        "mavlink_version": 3,
    }
    return heard("HEARTBEAT", values, system)


def carry_out(upload: MissionUpload, server: MissionServer, lost: float, seed: int = 1) -> tuple[MissionItem, ...]:
    """Run both sides in simulated time, losing this share of the frames; what the vehicle has in the end."""
    chance, items, now = random.Random(seed), (), 0
    upload.hear(heartbeat(), now)
    while not upload.is_done and upload.failure is None:
        now += SECOND // 10
        answers = server.due(now)
        for name, values in upload.due(now):
            frame = heard(name, values, 254)
            if chance.random() >= lost:
                said, change = server.hear(frame.message, frame.payload, (254, 190), now, items)
                answers += said
                items = items if change is None or change.items is None else change.items
        for name, values in answers:
            if chance.random() >= lost:
                upload.hear(heard(name, values, 7), now)
    return items


@pytest.mark.parametrize("lost", [0.0, 0.2])
def test_a_vehicle_gets_home_and_all_items_also_over_a_link_that_loses_frames(lost: float) -> None:
    upload = MissionUpload(ITEMS, HOME, 0)
    got = carry_out(upload, MissionServer(COMMANDS), lost)
    assert upload.failure is None
    assert upload.share == 1.0
    assert got[0].command == WAYPOINT
    assert got[0].frame == ABOVE_SEA
    for one, sent in zip(got, [MissionItem(WAYPOINT, *HOME, frame=ABOVE_SEA), *ITEMS], strict=True):
        assert (one.command, one.frame) == (sent.command, sent.frame)
        assert abs(one.latitude_deg - sent.latitude_deg) <= 1e-7
        assert abs(one.longitude_deg - sent.longitude_deg) <= 1e-7
        assert one.altitude_m == pytest.approx(sent.altitude_m)


def test_px4_gets_no_home_as_item_0() -> None:
    upload = MissionUpload(ITEMS, HOME, 0)
    upload.hear(heartbeat(autopilot=12), 0)
    ((name, values),) = upload.due(0)
    assert (name, values["count"]) == ("MISSION_COUNT", len(ITEMS))


@pytest.mark.parametrize(
    ("wanted", "lost", "commands", "says"),
    [
        (None, 1.0, COMMANDS, "does not answer"),
        (9, 0.0, COMMANDS, "No vehicle with the number 9 was heard"),
        (None, 0.0, frozenset({WAYPOINT, TAKE_OFF}), "refuses the mission at item 10: unsupported"),
    ],
)
def test_a_failure_is_one_sentence(wanted: int | None, lost: float, commands: frozenset[int], says: str) -> None:
    upload = MissionUpload(ITEMS, HOME, 0, wanted)
    carry_out(upload, MissionServer(commands), lost)
    assert not upload.is_done
    assert says in str(upload.failure)


def test_a_vehicle_that_falls_silent_in_the_middle_is_told() -> None:
    upload = MissionUpload(ITEMS, HOME, 0)
    upload.hear(heartbeat(), 0)
    upload.due(0)
    request = {"target_system": 254, "target_component": 190, "seq": 0, "mission_type": 0}
    upload.hear(heard("MISSION_REQUEST_INT", request, 7), 1)
    upload.due(2)
    assert upload.failure is None
    upload.due(11 * SECOND)
    assert "fell silent after item 0" in str(upload.failure)


def test_what_is_for_another_station_is_not_heeded() -> None:
    upload = MissionUpload(ITEMS, HOME, 0)
    upload.hear(heartbeat(), 0)
    upload.due(0)
    refusal = {"target_system": 255, "target_component": 190, "type": 4, "mission_type": 0}
    upload.hear(heard("MISSION_ACK", refusal, 7), 1)
    assert upload.failure is None
