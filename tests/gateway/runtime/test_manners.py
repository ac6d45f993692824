"""What the gateway sends on MAVLink links, against vehicles that answer as autopilots do."""

import hashlib
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source
from adapters.mavlink_frames import parse
from adapters.signing import Signer, SigningGuard, timestamp_at
from gateway.runtime.manners import COMPONENT, Manners

KEY = hashlib.sha256(b"correct horse").digest()
SECOND = 10**9
START = 1_790_000_000 * SECOND
ALL_RATES = {0: 1.0, 33: 5.0, 24: 2.0, 30: 10.0, 74: 2.0, 2: 1.0, 245: 1.0}
ASKED_IN_ORDER = [33, 24, 30, 74, 2, 245]


def _numbers(vehicle: Any) -> list[int]:
    """The messages that a vehicle was asked for, in order."""
    return [int(one.param1) for one in vehicle.asked if one.get_type() == "COMMAND_LONG"]


def test_nothing_is_ever_sent_when_nothing_is_asked_for(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(key=KEY), {1: [scripted(items=3)]}).run(30)
    assert field.sent == []
    assert not field.manners.counters


@settings(max_examples=40)
@given(frames=st.lists(st.binary(max_size=60), max_size=20), seconds=st.lists(st.integers(0, 100), max_size=20))
def test_no_bytes_make_silent_manners_speak_nor_any_manners_raise(frames: list[bytes], seconds: list[int]) -> None:
    silent, loud = Manners(), Manners(heartbeat=True, request_rates=True, fetch_mission=True)
    for manners in (silent, loud):
        manners.add(Source(1, "mavlink", "mavlink-1", "x"))
    for frame, second in zip(frames, seconds, strict=False):
        for manners in (silent, loud):
            manners.hear([Arrival(second * SECOND, 1, frame), Arrival(second * SECOND, 1, b"\xfd" + frame)])
        assert silent.due(second * SECOND) == []
        assert all(parse(sent) is not None for _, sent in loud.due(second * SECOND))


def test_heartbeats_go_out_once_a_second_as_a_ground_station_that_is_not_255(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(heartbeat=True), {1: [scripted()], 2: [scripted(2)]}).run(20)
    for source in (1, 2):
        times = [when for when, number, _ in field.sent if number == source]
        assert 17 <= len(times) <= 19
        assert all(abs(later - one - SECOND) <= SECOND // 25 for one, later in pairwise(times))
    for _, _, frame in field.sent:
        heartbeat = parse(frame)
        assert heartbeat is not None
        assert (heartbeat.system, heartbeat.component, heartbeat.message) == (254, COMPONENT, 0)
        assert heartbeat.payload[4:6] == bytes([6, 8])  # GCS, no autopilot
    assert {one[1] for one in field.manners.counters.items()} == {len(field.sent)}


def test_each_link_has_its_own_running_sequence(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(heartbeat=True, request_rates=True), {1: [scripted()], 2: [scripted(2)]}).run(30)
    for source in (1, 2):
        numbers = [frame[4] for _, number, frame in field.sent if number == source]
        assert numbers == [index & 255 for index in range(len(numbers))]


def test_a_peer_that_is_gone_gets_no_more_heartbeats(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(heartbeat=True), {1: [scripted()]}).run(5)
    field.vehicles[1].clear()
    field.run(120)
    assert field.now - field.sent[-1][0] >= 59 * SECOND


def test_a_number_that_somebody_has_is_not_taken_and_one_that_somebody_takes_is_given_up(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]
) -> None:
    other = {"component": 190, "type": 6, "autopilot": 8}
    field = flying_field(Manners(heartbeat=True), {1: [scripted()]})
    field.run(1)
    field.hear([(1, frame_of("HEARTBEAT", 254, **other))])
    field.run(3)
    field.hear([(1, frame_of("HEARTBEAT", 253, **other))])
    field.run(3)
    systems = [frame[5] for _, _, frame in field.sent]
    assert list(dict.fromkeys(systems)) == [253, 252]
    assert "Somebody else is system 253" in field.told()


def test_with_every_number_taken_nothing_is_sent_and_that_is_said_once(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]
) -> None:
    field = flying_field(Manners(heartbeat=True), {1: [scripted()]})
    field.run(1)
    field.hear([(1, frame_of("HEARTBEAT", system, type=6, autopilot=8)) for system in range(245, 255)])
    field.run(10)
    assert field.sent == []
    assert field.told().count("Nothing is sent") == 1


def test_our_own_frames_that_a_router_brings_back_are_not_somebody_else(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(heartbeat=True, fetch_mission=True), {1: [scripted(items=2)], 2: []})
    for _ in range(20):
        before = len(field.sent)
        field.run(1)
        field.hear([(number, frame) for _, _, frame in field.sent[before:] for number in (1, 2)])
    assert {frame[5] for _, _, frame in field.sent} == {254}
    assert "2 items" in field.told()


def test_what_a_vehicle_does_not_send_is_asked_for_one_by_one_and_then_comes(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted()
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(20)
    assert _numbers(vehicle) == [*ASKED_IN_ORDER, 242]
    assert {number: vehicle.rates[number] for number in ASKED_IN_ORDER} == pytest.approx(
        {number: ALL_RATES[number] for number in ASKED_IN_ORDER}
    )
    assert "ATTITUDE at 10 Hz (now 10." in field.told()
    assert field.manners.counters == {"COMMAND_LONG sent": 7}


def test_what_comes_often_enough_or_faster_is_left_alone(scripted: Any, flying_field: Any) -> None:
    faster = {number: 2 * rate for number, rate in ALL_RATES.items()}
    for rates in (ALL_RATES, faster):
        vehicle = scripted(rates=dict(rates))
        flying_field(Manners(request_rates=True), {1: [vehicle]}).run(60)
        assert _numbers(vehicle) == [242]
        assert vehicle.rates == rates


def test_system_time_every_two_seconds_is_enough(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(rates={**ALL_RATES, 2: 0.5})
    flying_field(Manners(request_rates=True), {1: [vehicle]}).run(20)
    assert _numbers(vehicle) == [242]


@pytest.mark.parametrize("seed", range(20))
def test_a_link_that_loses_a_third_lowers_no_rate(scripted: Any, flying_field: Any, seed: int) -> None:
    """What comes at a rate a little above the wanted one must not be asked down."""
    before = {0: 1.0, 33: 6.0, 24: 3.0, 30: 12.0, 74: 2.5, 2: 2.0, 245: 2.0}
    vehicle = scripted(rates=dict(before))
    flying_field(Manners(request_rates=True), {1: [vehicle]}, loss=0.33, random=Random(seed)).run(40)
    assert [number for number, rate in before.items() if vehicle.rates[number] < rate - 1e-6] == []


@pytest.mark.parametrize("seed", range(4))
def test_commands_that_are_lost_are_sent_again(scripted: Any, flying_field: Any, seed: int) -> None:
    vehicle = scripted()
    flying_field(Manners(request_rates=True), {1: [vehicle]}, loss=0.2, random=Random(seed)).run(120)
    assert sum(vehicle.rates.get(number, 0.0) > 0.0 for number in ASKED_IN_ORDER) >= 5


def test_a_vehicle_that_does_not_answer_is_asked_four_times_with_growing_pauses(
    scripted: Any, flying_field: Any
) -> None:
    vehicle = scripted(answers_511=None)
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(120)
    assert _numbers(vehicle) == [33] * 4
    assert [one.confirmation for one in vehicle.asked] == [0, 1, 2, 3]
    pauses = [round((later - one) / SECOND) for one, later in pairwise(when for when, _, _ in field.sent)]
    assert pauses == [1, 2, 4]
    assert field.told().count("does not answer") == 1


def test_a_message_that_is_refused_is_said_and_the_others_are_asked_for(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(intervals={245: 4, 24: 2})
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(30)
    assert _numbers(vehicle) == [*ASKED_IN_ORDER, 242]
    assert "does not give GPS_RAW_INT, EXTENDED_SYS_STATE" in field.told()


def test_an_autopilot_that_does_not_know_the_command_is_asked_for_streams(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(answers_511=3, version=1)
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(40)
    asked = Counter(one.get_type() for one in vehicle.asked)
    assert asked["REQUEST_DATA_STREAM"] == 5
    assert vehicle.rates[33] == 5
    assert field.told().count("REQUEST_DATA_STREAM") == 1
    assert "does not give EXTENDED_SYS_STATE" in field.told()


def test_streams_that_do_not_come_are_asked_for_three_times_and_no_more(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(answers_511=3)
    vehicle.rates = _Deaf(vehicle.rates)
    flying_field(Manners(request_rates=True), {1: [vehicle]}).run(120)
    asked = Counter(one.get_type() for one in vehicle.asked)
    assert asked["REQUEST_DATA_STREAM"] == 15


class _Deaf(dict[int, float]):
    """Rates that nobody can set."""

    def __setitem__(self, key: int, value: float) -> None:
        return None


def test_after_a_reboot_it_is_asked_again(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(rates={0: 1.0, 30: 4.0})
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(20)
    vehicle.boot_at, vehicle.rates = field.now, {0: 1.0, 30: 4.0}
    vehicle.asked.clear()
    field.run(20)
    assert _numbers(vehicle) == [*ASKED_IN_ORDER, 242]


def test_the_wrap_of_the_time_since_boot_is_no_reboot(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(rates=dict(ALL_RATES))
    vehicle.step = _wrapping(vehicle)
    flying_field(Manners(request_rates=True), {1: [vehicle]}).run(60)
    assert _numbers(vehicle) == [242]


def _wrapping(vehicle: Any) -> Callable[[int], list[bytes]]:
    """Its time since boot wraps after 20 s."""
    step, wraps_at = vehicle.step, vehicle.now + 20 * SECOND

    def stepped(now: int) -> list[bytes]:
        vehicle.boot_at = wraps_at if now >= wraps_at else wraps_at - 2**32 * 10**6
        return step(now)

    return stepped


def test_home_is_asked_for_again_while_a_vehicle_has_none_yet(scripted: Any, flying_field: Any) -> None:
    vehicle = scripted(rates=dict(ALL_RATES), home=4)
    field = flying_field(Manners(request_rates=True), {1: [vehicle]}).run(50)
    assert _numbers(vehicle) == [242, 242]
    vehicle.home = 0
    field.run(30)
    vehicle.asked.clear()
    field.run(120)
    assert vehicle.asked == []


def test_a_ground_station_is_asked_for_nothing(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]
) -> None:
    field = flying_field(Manners(request_rates=True, fetch_mission=True), {1: []})
    for _ in range(20):
        field.hear([(1, frame_of("HEARTBEAT", 255, 190, type=6, autopilot=8))])
        field.run(1)
    assert field.sent == []


@pytest.mark.parametrize("items", [0, 1, 7])
def test_a_mission_is_read_once_and_acknowledged(scripted: Any, flying_field: Any, items: int) -> None:
    vehicle = scripted(items=items)
    field = flying_field(Manners(fetch_mission=True), {1: [vehicle]}).run(60)
    assert field.kinds() == ["MISSION_REQUEST_LIST", *["MISSION_REQUEST_INT"] * items, "MISSION_ACK"]
    assert [one.seq for one in vehicle.asked if one.get_type() == "MISSION_REQUEST_INT"] == list(range(items))
    assert ("is empty" if not items else f"{items} items") in field.told()


@pytest.mark.parametrize("seed", range(6))
def test_a_mission_is_read_whole_over_a_link_that_loses_a_fifth(scripted: Any, flying_field: Any, seed: int) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [scripted(items=20)]}, loss=0.2, random=Random(seed)).run(120)
    assert "20 items" in field.told()


def test_a_vehicle_that_gives_no_mission_is_asked_six_times(scripted: Any, flying_field: Any) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [scripted(answers_missions=False)]}).run(120)
    times = [when for when, _, _ in field.sent]
    assert len(times) == 6
    assert all(later - one >= 3 * SECOND // 2 for one, later in pairwise(times))
    assert field.told().count("does not answer") == 1


def test_a_refusal_ends_the_reading(scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [scripted(answers_missions=False)]}).run(6)
    field.hear([(1, frame_of("MISSION_ACK", 1, target_system=254, target_component=190, type=2))])
    asked = len(field.sent)
    field.run(60)
    assert len(field.sent) == asked
    assert "does not give its mission (it answers unsupported" in field.told()


def test_while_another_station_reads_nothing_is_asked(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]
) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [scripted(items=3)], 2: []})
    for number in range(20):
        field.hear([(2, frame_of("MISSION_REQUEST_INT", 255, 190, target_system=1, target_component=1, seq=number))])
        field.run(1)
    assert field.sent == []
    assert "3 items" in field.run(10).told()


def test_another_station_that_appears_in_the_middle_is_given_way(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes]
) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [scripted(items=100)]}).run(6)
    assert 10 < len(field.sent) < 100
    field.hear([(1, frame_of("MISSION_REQUEST_LIST", 255, 190, target_system=1, target_component=1))])
    since = field.now + 1
    field.run(10)
    assert next(when for when, _, _ in field.sent if when >= since) - since >= 5 * SECOND - 1
    assert field.kinds(since)[0] == "MISSION_REQUEST_LIST"
    assert "another station" in field.told()
    assert "100 items" in field.told()


@pytest.mark.parametrize("how", ["upload", "current", "reboot"])
def test_a_mission_that_has_changed_is_read_again(
    scripted: Any, flying_field: Any, frame_of: Callable[..., bytes], how: str
) -> None:
    vehicle = scripted(rates={0: 1.0, 30: 4.0}, items=2)
    field = flying_field(Manners(fetch_mission=True), {1: [vehicle]})
    for _ in range(15):
        field.hear([(1, vehicle.say("MISSION_CURRENT", total=2))])
        field.run(1)
    vehicle.items, since = 4, field.now
    if how == "upload":
        field.hear([(1, vehicle.say("MISSION_ACK", target_system=255, target_component=190))])
    elif how == "current":
        field.hear([(1, vehicle.say("MISSION_CURRENT", total=4))])
    else:
        vehicle.boot_at = field.now
    field.run(15)
    assert field.kinds(since).count("MISSION_REQUEST_LIST") == 1
    assert "4 items" in field.told()


def test_a_vehicle_heard_over_two_links_is_read_over_one(scripted: Any, flying_field: Any) -> None:
    """Two of one number that are not the same are read both."""
    rates = {0: 1.0, 30: 4.0}
    for boots_apart_s, readings in ((0, 1), (100, 2)):
        one, other = (scripted(rates=dict(rates), items=2) for _ in range(2))
        other.boot_at -= boots_apart_s * SECOND
        field = flying_field(Manners(fetch_mission=True), {1: [one], 2: [other]}).run(30)
        assert field.kinds().count("MISSION_REQUEST_LIST") == readings


def test_a_second_link_that_joins_later_does_not_read_the_mission_again(scripted: Any, flying_field: Any) -> None:
    one = scripted(rates={0: 1.0, 30: 4.0}, items=2)
    field = flying_field(Manners(fetch_mission=True), {1: [one], 2: []}).run(20)
    field.vehicles[2].append(scripted(rates={0: 1.0, 30: 4.0}, items=2))
    assert field.run(20).kinds().count("MISSION_REQUEST_LIST") == 1


def test_a_peer_of_version_1_is_answered_in_version_1(scripted: Any, flying_field: Any) -> None:
    manners = Manners(heartbeat=True, request_rates=True, fetch_mission=True)
    field = flying_field(manners, {1: [scripted(version=1, items=2)], 2: [scripted(2)]}).run(30)
    assert {(number, frame[0]) for _, number, frame in field.sent} == {(1, 0xFE), (2, 0xFD)}
    assert "2 items" in field.told()


def test_with_a_key_all_is_signed_and_rises_in_time_on_each_link(scripted: Any, flying_field: Any) -> None:
    """pymavlink, which reads for the vehicles, refuses anything else."""
    manners = Manners(heartbeat=True, request_rates=True, fetch_mission=True, key=KEY)
    vehicles = {number: [scripted(number, items=3, signer=Signer(KEY))] for number in (1, 2)}
    field = flying_field(manners, vehicles).run(30)
    guard = SigningGuard(KEY, live=True)
    assert [guard.judge(frame, number, when) for when, number, frame in field.sent] == [None] * len(field.sent)
    assert field.told().count("3 items") == 2
    assert set(_numbers(vehicles[1][0])) == {*ASKED_IN_ORDER, 242}


def test_a_vehicle_whose_time_is_an_hour_ahead_believes_our_heartbeats(scripted: Any, flying_field: Any) -> None:
    """Else it would take ours for a recording."""
    vehicle = scripted(signer=Signer(KEY, last=timestamp_at(START + 3600 * SECOND)))
    field = flying_field(Manners(heartbeat=True, key=KEY), {1: [vehicle]}).run(10)
    ours = [int.from_bytes(frame[-12:-6], "little") for _, _, frame in field.sent]
    assert min(ours) > timestamp_at(START + 3540 * SECOND)


def test_with_a_key_a_stranger_causes_nothing_to_be_sent(scripted: Any, flying_field: Any) -> None:
    manners = Manners(request_rates=True, fetch_mission=True, key=KEY)
    unsigned, forged = scripted(1), scripted(2, signer=Signer(bytes(32)))
    assert flying_field(manners, {1: [unsigned], 2: [forged]}).run(30).sent == []


def test_vehicles_are_bounded(flying_field: Any, frame_of: Callable[..., bytes]) -> None:
    field = flying_field(Manners(fetch_mission=True), {1: [], 2: []})
    crowd = [(1 + system % 2, frame_of("HEARTBEAT", system, component, autopilot=3, type=1))
             for system in range(1, 240) for component in (1, 2)]  # fmt: skip
    field.hear(crowd)
    field.run(10)
    assert field.manners.counters["heartbeats of vehicles too many to be asked"] == len(crowd) - 256
