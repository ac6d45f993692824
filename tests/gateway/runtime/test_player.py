"""A recording onto the wires."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from adapters.mavlink_frames import parse
from gateway.runtime.playback import open_playback
from gateway.runtime.player import play_onto
from gateway.runtime.urls import Url

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture
def listening() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        made.bind(("127.0.0.1", 0))
        made.setblocking(False)
        yield made


def received(listening: socket.socket) -> list[bytes]:
    found = []
    while True:
        try:
            found.append(listening.recv(65535))
        except BlockingIOError:
            return found


@pytest.mark.parametrize("name", ["sitl-landing-excerpt.tlog", "sitl-landing-excerpt.BIN"])
def test_a_part_of_a_recording_is_sent_frame_by_frame_and_nothing_before_or_after(
    listening: socket.socket, name: str
) -> None:
    """Half a second, so that it fits into a receiver's buffer."""
    playback = open_playback([DATA / name])
    arrivals = list(playback.arrivals())
    begin = arrivals[len(arrivals) // 2].received_at
    playback.watermark = begin + 500_000_000
    wanted = [one.data for one in arrivals if begin <= one.received_at <= playback.watermark]
    url = Url("udpout", "127.0.0.1", listening.getsockname()[1])
    sent = play_onto(playback, url, url, speed=None, begins_at=begin)
    assert sent == {"MAVLink frames": len(wanted)}
    came = received(listening)
    assert came == wanted
    assert all(parse(frame) is not None for frame in came)
