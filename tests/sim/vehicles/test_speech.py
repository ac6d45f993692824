"""What vehicles say and answer: a ground station made of pymavlink alone, in memory and over UDP on the loopback."""

from __future__ import annotations

import math
import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings, strategies
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import WHOLE_SIZES, Frame, encode, parse
from adapters.mission_writing import MissionItem
from gateway.runtime.links import open_link
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Setup
from gateway.runtime.urls import Url
from sim.vehicles.answering import HEARD
from sim.vehicles.answering import INT as INT_NUMBER
from sim.vehicles.answering import LONG as LONG_NUMBER
from sim.vehicles.flying import Flyer, aeroplane, rotorcraft
from sim.vehicles.motion import Arm, Home, SetMode
from sim.vehicles.recording import write_flight
from sim.vehicles.serving import LinkedVehicles, serve
from sim.vehicles.speaking import Speaker, sensors_of
from sim.vehicles.wind import WindParameters

Place = Callable[..., MissionItem]
START_NS = 1_767_225_600_000_000_000
LONG, MODE, ARM, MISSION_START = "COMMAND_LONG", 176, 400, 300


def speaker(vehicle: Flyer, system: int = 1) -> Speaker:
    return Speaker.of(system, vehicle, sensors_of(1, system), START_NS)


def decoded(frames: list[bytes]) -> list[Any]:
    reader = dialect.MAVLink(None)
    return [reader.parse_buffer(frame)[0] for frame in frames]


def command(number: int, *parameters: float, target: int = 1) -> bytes:
    told = (*parameters, *[0.0] * 7)[:7]
    values = {f"param{place}": value for place, value in enumerate(told, 1)}
    whole = {"target_system": target, "target_component": 1, "command": number, "confirmation": 0, **values}
    return encode(LONG, whole, system=250)


def answers(to: Speaker, frame: bytes) -> list[Any]:
    found = parse(frame)
    assert found is not None
    return decoded(to.hear(found, 0))


def said_until(one: Speaker, until_s: float) -> list[bytes]:
    """What a vehicle says by itself, step by step, until a time of its own."""
    frames: list[bytes] = []
    while one.vehicle.moment.time_s < until_s - 1e-9:
        frames += one.say(round(one.vehicle.step().time_s * 1e9))
    return frames


def test_messages_come_at_their_rates_and_say_what_is_true(home: Home, place: Place) -> None:
    """An aeroplane that stands: ten seconds of everything, decoded by pymavlink."""
    one = speaker(aeroplane(home, (place(0, 0, 40, 22),), wind=WindParameters(5.0)))
    said = decoded(said_until(one, 10.0))
    counts = Counter(message.get_type() for message in said)
    wanted = {"HEARTBEAT": 10, "SYSTEM_TIME": 10, "HIGHRES_IMU": 500, "ATTITUDE": 100, "GLOBAL_POSITION_INT": 100}
    wanted |= {"GPS_RAW_INT": 50, "VFR_HUD": 50, "SCALED_PRESSURE": 50, "SIM_STATE": 50, "MISSION_CURRENT": 10}
    assert {name: counts[name] for name in wanted} == pytest.approx(wanted, abs=1)
    assert "WIND" not in counts  # standing it cannot tell
    last = {message.get_type(): message for message in said}
    position, raw, clock = last["GLOBAL_POSITION_INT"], last["GPS_RAW_INT"], last["SYSTEM_TIME"]
    assert position.alt / 1e3 == pytest.approx(home.altitude_msl_m, abs=6.0)
    assert (raw.alt_ellipsoid - raw.alt) / 1e3 == pytest.approx(home.geoid_separation_m, abs=1e-3)
    assert clock.time_unix_usec * 1000 - clock.time_boot_ms * 1_000_000 == START_NS
    assert last["HIGHRES_IMU"].zacc == pytest.approx(-9.81, abs=0.2)
    assert last["MISSION_CURRENT"].total == 1


def test_several_vehicles_on_one_link_answer_only_what_is_for_them(home: Home) -> None:
    pair = [speaker(rotorcraft(home, system=number), number) for number in (1, 2)]
    for frame, wanted in ((command(ARM, 1.0, target=2), [0, 1]), (command(ARM, 1.0, target=0), [1, 1])):
        assert [len(answers(one, frame)) for one in pair] == wanted
    assert [one.vehicle.is_armed for one in pair] == [True, True]


def test_commands_are_acknowledged_with_what_comes_of_them(home: Home, place: Place) -> None:
    one = speaker(rotorcraft(home, (place(0, 0, 10, 22), place(0, 0, 0, 21))))

    def result(number: int, *parameters: float) -> int:
        (found,) = answers(one, command(number, *parameters))
        assert (found.get_type(), found.command) == ("COMMAND_ACK", number)
        return int(found.result)

    assert result(22, 0, 0, 0, 0, 0, 0, 20.0) == 2  # not armed
    assert result(31010) == 3
    assert result(ARM, 1.0) == 0
    assert result(MODE, 1.0, 99.0) == 3
    assert result(MODE, 1.0, 3.0) == 0
    assert one.vehicle.mode == "AUTO"
    assert result(511, 33, 500_000.0) == 0
    assert result(511, 4711, 1e6) == 3
    assert result(224, 7.0) == 2


def test_what_is_asked_for_once_is_told_once_and_rates_are_the_links_own(home: Home) -> None:
    craft = rotorcraft(home)
    one, other = speaker(craft), speaker(craft)
    acknowledged, version = answers(one, command(512, 148))
    assert (acknowledged.result, version.get_type(), version.uid) == (0, "AUTOPILOT_VERSION", 1)
    assert [found.get_type() for found in answers(one, command(410))] == ["COMMAND_ACK", "HOME_POSITION"]
    answers(one, command(511, 33, -1.0))
    answers(one, command(511, 27, 40_000.0))
    counts = []
    for _ in range(100):
        craft.step()
        counts.append([Counter(found.get_type() for found in decoded(link.say(0))) for link in (one, other)])
    mine, theirs = (sum((pair[which] for pair in counts), Counter[str]()) for which in (0, 1))
    assert (mine["GLOBAL_POSITION_INT"], theirs["GLOBAL_POSITION_INT"]) == (0, 20)
    assert (mine["RAW_IMU"], theirs["RAW_IMU"]) == (50, 0)


def test_a_lost_fix_and_a_spoofed_one_are_told_as_a_receiver_would(home: Home) -> None:
    one = speaker(rotorcraft(home))
    sensors = one.answerer.teller.sayings.sensors
    sensors.spoofed_m = (100.0, 0.0, 0.0)
    said = decoded(said_until(one, 1.0))
    north = [math.radians(found.lat / 1e7) for found in said if found.get_type() == "GLOBAL_POSITION_INT"]
    assert (north[-1] - home.latitude_rad) * 6.37e6 == pytest.approx(100.0, abs=5.0)
    sensors.has_fix = False
    said = decoded(said_until(one, 2.0))
    assert {found.fix_type for found in said if found.get_type() == "GPS_RAW_INT"} == {1}
    assert "GLOBAL_POSITION_INT" not in {found.get_type() for found in said}


NUMBERS = strategies.sampled_from((math.nan, math.inf, -math.inf, 0.0, -1.0, 1.0, 2.0, 47.0, 1e5, 1e30))
COMMANDS = (17, 20, 21, 22, 176, 178, 191, 192, 193, 224, 300, 400, 410, 511, 512, 520, 4711)


@strategies.composite
def said_by_a_station(draw: strategies.DrawFn) -> tuple[int, bytes]:
    """Any payload in any message that a vehicle hears; numbers and commands that get further than random bytes."""
    message = draw(strategies.sampled_from(sorted(HEARD)))
    size = WHOLE_SIZES[message]
    payload = draw(strategies.binary(min_size=size, max_size=size))
    if message in (LONG_NUMBER, INT_NUMBER):
        numbers = draw(strategies.lists(NUMBERS, min_size=7, max_size=7))
        payload = struct.pack("<7fH", *numbers, draw(strategies.sampled_from(COMMANDS))) + payload[30:]
    return message, payload


@pytest.mark.parametrize("made", [aeroplane, rotorcraft])
@settings(max_examples=25, deadline=None)
@given(heard=strategies.lists(said_by_a_station(), min_size=1, max_size=5))
def test_whatever_a_station_says_a_vehicle_answers_or_not_and_goes_on(
    made: Callable[..., Flyer], heard: list[tuple[int, bytes]]
) -> None:
    """While it stands or flies: nothing that is said to it raises, or makes it say what cannot be sent."""
    vehicle = made(Home(0.8, 0.15, 500.0), (MissionItem(22, 0.0, 0.0, 30.0), MissionItem(21, 0.0, 0.0, 0.0)))
    vehicle.order(Arm(True))
    vehicle.order(SetMode("AUTO"))
    one = speaker(vehicle)
    for message, payload in heard:
        for said in one.answerer.hear(Frame(2, 250, 190, 0, message, payload, False, "good"), 0):
            assert encode(said.name, said.values, system=1)
        for _ in range(10):
            vehicle.step()
            one.say(0)


class GroundStation:
    """pymavlink on a UDP socket: waits for messages, sends others."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(20.0)
        self.port = int(self._socket.getsockname()[1])
        self._mavlink = dialect.MAVLink(None, srcSystem=250, srcComponent=190)
        self._vehicle: Any = None
        self.heard: list[Any] = []

    def wait(self, name: str, is_it: Callable[[Any], bool] = lambda message: True) -> Any:
        while True:
            data, self._vehicle = self._socket.recvfrom(4096)
            for message in self._mavlink.parse_buffer(data) or ():
                self.heard.append(message)
                if message.get_type() == name and is_it(message):
                    return message

    def send(self, message: Any) -> None:
        self._socket.sendto(message.pack(self._mavlink), self._vehicle)

    def close(self) -> None:
        self._socket.close()


def test_a_ground_station_sends_a_mission_starts_it_and_sees_it_flown(home: Home, place: Place) -> None:
    """Over UDP, forty times as fast as real time; each waypoint is passed within 5 m by the positions that were told."""
    items = (place(0, 0, 0), place(0, 0, 15, 22), place(60, 0, 15), place(60, 50, 20), place(0, 0, 0, 21))
    station, stop = GroundStation(), threading.Event()
    craft = rotorcraft(home, wind=WindParameters(4.0, 1.0, 0.5))
    link = open_link(Url("udpout", "127.0.0.1", station.port), is_drained=False)
    linked = LinkedVehicles(link, [speaker(craft)])
    flight = threading.Thread(
        target=serve, args=([craft], [linked]), kwargs={"speed": 40.0, "asked_to_stop": stop.is_set}
    )
    flight.start()
    try:
        station.wait("HEARTBEAT")
        station.send(dialect.MAVLink_mission_count_message(1, 1, len(items)))
        for number, item in enumerate(items):
            station.wait("MISSION_REQUEST_INT", lambda asked, number=number: asked.seq == number)
            numbers = (
                *item.parameters,
                round(item.latitude_deg * 1e7),
                round(item.longitude_deg * 1e7),
                item.altitude_m,
            )
            station.send(dialect.MAVLink_mission_item_int_message(1, 1, number, 3, item.command, 0, 1, *numbers))
        assert station.wait("MISSION_ACK").type == 0
        for number, *parameters in ((ARM, 1.0), (MISSION_START,)):
            told = (*parameters, *[0.0] * 7)[:7]
            station.send(dialect.MAVLink_command_long_message(1, 1, number, 0, *told))
            assert station.wait("COMMAND_ACK", lambda said, number=number: said.command == number).result == 0
        station.wait("HEARTBEAT", lambda said: said.base_mode & 128)
        station.wait("MISSION_ITEM_REACHED", lambda said: said.seq == len(items) - 1)
        station.wait("HEARTBEAT", lambda said: not said.base_mode & 128)
    finally:
        stop.set()
        flight.join()
        link.close()
        station.close()
    track = [(one.lat, one.lon) for one in station.heard if one.get_type() == "GLOBAL_POSITION_INT"]
    east = math.cos(home.latitude_rad)
    for item in items[2:]:
        offs = [(lat / 1e7 - item.latitude_deg, (lon / 1e7 - item.longitude_deg) * east) for lat, lon in track]
        assert min(math.hypot(*off) for off in offs) * 111_195.0 < 5.0
    assert [one.seq for one in station.heard if one.get_type() == "MISSION_ITEM_REACHED"] == [1, 2, 3, 4]


def test_the_gateway_takes_a_simulated_vehicle_for_a_real_one(home: Home, place: Place, tmp_path: Path) -> None:
    """Its mission is overheard, its inertial unit heard, nothing is counted as wrong; the track is within 3 m of the truth."""
    items = (place(0, 0, 15, 22), place(60, 0, 15), place(0, 0, 0, 21))
    one = speaker(rotorcraft(home, items, wind=WindParameters(4.0, 1.0, 0.5)))
    for frame in (command(ARM, 1.0), command(MISSION_START)):
        assert answers(one, frame)[0].result == 0
    folder = write_flight([one], tmp_path, START_NS, longest_s=12.0)
    summary = run_replay(open_playback([folder]), Setup())
    assert summary.observations["IMU samples"] == 600
    assert summary.observations["flight plans"] == 2  # home, and then the mission
    assert summary.observations["intents"] >= 1
    assert set(summary.counters) == {"mavlink-1 frames"}
    assert summary.accuracy["gps only"].rmse_m < 3.0
    assert summary.predictions > 0
