"""A vehicle's side of the mission protocol."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from adapters.mavlink_frames import Frame, encode, parse
from adapters.mission_client import ANSWER_NS, QUIET_NS, TRIES, MissionClient
from adapters.mission_server import MissionServer, Said
from adapters.mission_writing import MissionItem

STATION, OTHER = (250, 190), (251, 190)
SERVER = frozenset((16, 22, 21, 177))
ITEMS = (
    MissionItem(16, 47.4, 8.5, 500.0, 0, (0.0, 0.0, 0.0, 0.0)),
    MissionItem(22, 0.0, 0.0, 30.0, 3, (10.0, 0.0, 0.0, 0.0)),
    MissionItem(16, 47.4123457, -8.5123457, 60.5, 3, (5.0, 2.0, 0.0, 90.0)),
)


def heard(name: str, station: tuple[int, int] = STATION, **values: Any) -> Frame:
    frame = parse(encode(name, {"target_system": 1, "target_component": 1, **values}, system=station[0]))
    assert frame is not None
    return frame


def item(sequence: int, told: MissionItem, station: tuple[int, int] = STATION, *, is_float: bool = False) -> Frame:
    parameters = {f"param{number}": value for number, value in enumerate(told.parameters, 1)}
    x, y = (told.latitude_deg, told.longitude_deg) if is_float else (told.latitude_deg * 1e7, told.longitude_deg * 1e7)
    values = {"seq": sequence, "frame": told.frame, "command": told.command, "current": 0, "autocontinue": 1}
    values |= {"x": x if is_float else round(x), "y": y if is_float else round(y), "z": told.altitude_m}
    return heard("MISSION_ITEM" if is_float else "MISSION_ITEM_INT", station, **values, **parameters)


def ask(server: MissionServer, frame: Frame, now: int = 0, items: tuple[MissionItem, ...] = ()) -> Any:
    return server.hear(frame.message, frame.payload, (frame.system, 190), now, items)


def outcome(said: list[Said]) -> int:
    (one,) = said
    assert one.name == "MISSION_ACK"
    return int(one.values["type"])


def test_our_own_client_reads_a_mission_to_its_last_bit() -> None:
    server, client, now, got = MissionServer(SERVER), MissionClient("it", 0), QUIET_NS, []
    while client.finished_at is None:
        name, values = client.due(now) or ("", {})
        said, change = ask(server, heard(name, **values), now, ITEMS)
        assert change is None
        for one in said:
            frame = parse(encode(one.name, one.values, system=1))
            assert frame is not None
            got += [one.values] if one.name == "MISSION_ITEM_INT" else []
            client.hear(frame.message, frame.payload, now)
    assert [(one["seq"], one["command"], one["x"], one["y"], one["z"]) for one in got] == [
        (number, told.command, round(told.latitude_deg * 1e7), round(told.longitude_deg * 1e7), told.altitude_m)
        for number, told in enumerate(ITEMS)
    ]
    assert client.notes == [("info", "it: its mission was read: 3 items.")]


def test_a_mission_that_is_sent_holds_when_its_last_item_has_come_and_not_before() -> None:
    server = MissionServer(SERVER)
    said, change = ask(server, heard("MISSION_COUNT", count=3))
    for number, told in enumerate(ITEMS):
        assert (said[0].name, said[0].values["seq"], change) == ("MISSION_REQUEST_INT", number, None)
        said, change = ask(server, item(number, told))
    assert outcome(said) == 0
    assert change is not None
    assert change.items == ITEMS


def test_items_as_floats_are_taken_and_given_too() -> None:
    server = MissionServer(SERVER)
    ask(server, heard("MISSION_COUNT", count=1))
    said, change = ask(server, item(0, ITEMS[0], is_float=True))
    assert outcome(said) == 0
    assert abs(change.items[0].latitude_deg - 47.4) < 1e-5
    (given,), _ = ask(server, heard("MISSION_REQUEST", seq=2), items=ITEMS)
    assert (given.name, given.values["x"]) == ("MISSION_ITEM", 47.4123457)


def test_an_item_that_does_not_come_is_asked_for_again_and_then_the_transfer_is_cancelled() -> None:
    server, now = MissionServer(SERVER), 0
    ask(server, heard("MISSION_COUNT", count=2), now)
    ask(server, item(0, ITEMS[0]), now)
    again = []
    for _ in range(TRIES):
        assert server.due(now + ANSWER_NS - 1) == []
        now += ANSWER_NS
        again += server.due(now)
    assert [one.name for one in again] == ["MISSION_REQUEST_INT"] * (TRIES - 1) + ["MISSION_ACK"]
    assert {one.values["seq"] for one in again[:-1]} == {1}
    assert outcome(again[-1:]) == 15
    assert outcome(ask(server, item(1, ITEMS[1]), now)[0]) == 13


def test_an_item_twice_is_ignored_and_one_too_early_is_answered_with_the_one_that_is_due() -> None:
    server = MissionServer(SERVER)
    ask(server, heard("MISSION_COUNT", count=3))
    ask(server, item(0, ITEMS[0]))
    assert ask(server, item(0, ITEMS[0])) == ([], None)
    (said,), change = ask(server, item(2, ITEMS[2]))
    assert (said.name, said.values["seq"], change) == ("MISSION_REQUEST_INT", 1, None)


def test_while_one_station_sends_another_is_denied_and_the_same_one_may_begin_anew() -> None:
    server = MissionServer(SERVER)
    ask(server, heard("MISSION_COUNT", count=2))
    assert outcome(ask(server, heard("MISSION_COUNT", OTHER, count=2))[0]) == 14
    assert outcome(ask(server, item(0, ITEMS[0], OTHER))[0]) == 14
    (said,), _ = ask(server, heard("MISSION_COUNT", count=1))
    assert said.values["seq"] == 0


def test_what_cannot_be_flown_is_refused_with_its_reason() -> None:
    first = ITEMS[0]
    refused = {
        3: replace(first, command=2000),
        2: replace(first, frame=1),
        10: replace(first, latitude_deg=91.0),
        11: replace(first, longitude_deg=-181.0),
        12: replace(first, altitude_m=float("nan")),
    }
    for reason, told in refused.items():
        server = MissionServer(SERVER)
        ask(server, heard("MISSION_COUNT", count=1))
        said, change = ask(server, item(0, told))
        assert (outcome(said), change) == (reason, None)
    assert outcome(ask(MissionServer(SERVER), heard("MISSION_COUNT", count=5000))[0]) == 4
    assert outcome(ask(MissionServer(SERVER), heard("MISSION_REQUEST_INT", seq=3), items=ITEMS)[0]) == 13


def test_a_part_of_a_mission_is_replaced() -> None:
    server, new = MissionServer(SERVER), replace(ITEMS[1], altitude_m=45.0)
    ask(server, heard("MISSION_WRITE_PARTIAL_LIST", start_index=1, end_index=1), items=ITEMS)
    _, change = ask(server, item(1, new), items=ITEMS)
    assert change is not None
    assert change.items == (ITEMS[0], new, ITEMS[2])
    beyond = heard("MISSION_WRITE_PARTIAL_LIST", start_index=2, end_index=3)
    assert outcome(ask(server, beyond, items=ITEMS)[0]) == 13


def test_a_mission_is_cleared_and_its_current_item_set() -> None:
    server = MissionServer(SERVER)
    said, change = ask(server, heard("MISSION_CLEAR_ALL"), items=ITEMS)
    assert (outcome(said), change.items) == (0, ())
    assert ask(server, heard("MISSION_SET_CURRENT", seq=2), items=ITEMS)[1].current == 2
    assert outcome(ask(server, heard("MISSION_SET_CURRENT", seq=3), items=ITEMS)[0]) == 13


def test_there_are_no_fences_and_none_are_taken() -> None:
    server = MissionServer(SERVER)
    (said,), _ = ask(server, heard("MISSION_REQUEST_LIST", mission_type=1), items=ITEMS)
    assert (said.name, said.values["count"], said.values["mission_type"]) == ("MISSION_COUNT", 0, 1)
    assert outcome(ask(server, heard("MISSION_COUNT", count=2, mission_type=1))[0]) == 3
    assert ask(server, heard("MISSION_CLEAR_ALL", mission_type=1), items=ITEMS)[1] is None
