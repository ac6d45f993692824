"""A mission given to a vehicle over a real link."""

import socket
import threading
import time

import pytest

from adapters.mavlink_frames import FrameEncoder, parse
from adapters.mission_server import TRAFFIC, MissionServer
from adapters.mission_writing import WAYPOINT, MissionItem
from gateway.runtime.uploading import UploadError, upload_mission
from gateway.runtime.urls import Url

HOME = (31.0, 104.0, 535.0)
ITEMS = [MissionItem(WAYPOINT, 31.0 + 0.01 * number, 104.0, 300.0) for number in range(20)]
HEARTBEAT = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}


def fly(
    station: socket.socket, commands: frozenset[int], got: list[tuple[MissionItem, ...]], done: threading.Event
) -> None:
    """A vehicle that listens at a port, as SITL behind a router does."""
    encoder, server, items = FrameEncoder(7), MissionServer(commands), ()
    station.settimeout(0.02)
    heard_from = None
    while not done.is_set():
        try:
            data, heard_from = station.recvfrom(2048)
        except TimeoutError:
            data = b""
        if heard_from is None:
            continue
        said = [("HEARTBEAT", HEARTBEAT)]
        frame = parse(data)
        if frame is not None and frame.message in TRAFFIC:
            answers, change = server.hear(
                frame.message, frame.payload, (frame.system, frame.component), time.monotonic_ns(), items
            )
            said = [tuple(one) for one in answers]
            if change is not None and change.items is not None:
                items = change.items
                got.append(items)
        for name, values in said:
            station.sendto(encoder.encode(name, **values), heard_from)


@pytest.mark.parametrize(("commands", "refuses"), [(frozenset({WAYPOINT}), False), (frozenset(), True)])
def test_a_vehicle_on_a_udp_link_gets_the_mission_or_its_refusal_is_told(
    commands: frozenset[int], refuses: bool
) -> None:
    got: list[tuple[MissionItem, ...]] = []
    done = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        thread = threading.Thread(target=fly, args=(station, commands, got, done))
        thread.start()
        url = Url("udpout", "127.0.0.1", station.getsockname()[1])
        try:
            if refuses:
                with pytest.raises(UploadError, match="refuses the mission at item 0: unsupported"):
                    upload_mission(url, ITEMS, HOME)
            else:
                assert upload_mission(url, ITEMS, HOME) == "Vehicle 7 has the mission: 20 items."
                assert [round(one.latitude_deg, 7) for one in got[0][1:]] == [
                    round(one.latitude_deg, 7) for one in ITEMS
                ]
        finally:
            done.set()
            thread.join()
