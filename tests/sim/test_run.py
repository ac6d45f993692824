"""Scenes on real sockets and in files."""

import socket
from pathlib import Path
from threading import Event

import pyarrow.parquet as pq
import pytest

from adapters.files import open_recording
from adapters.landing_radar import Datagram, decode
from adapters.mavlink_frames import parse
from gateway.runtime.folder import read_record
from gateway.runtime.urls import Url
from gateway.settings import parse_site
from gateway.sinks.batches import TRUTH
from sim.events import events
from sim.recording import write_datagrams, write_session
from sim.run import play
from sim.scenes import build_scene

START_NS = 1_800_000_000_000_000_000
SCENE = build_scene("traffic", start_ns=START_NS, changes=["aircraft=4", "radars=2", "duration_s=3"])


def _listen() -> tuple[socket.socket, Url]:
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    listening.bind(("127.0.0.1", 0))
    listening.setblocking(False)
    return listening, Url("udpout", "127.0.0.1", listening.getsockname()[1])


def _received(listening: socket.socket) -> list[tuple[bytes, int]]:
    found = []
    while True:
        try:
            data, (_, port) = listening.recvfrom(65535)
        except BlockingIOError:
            return found
        found.append((data, port))


def test_a_scene_is_sent_as_it_is() -> None:
    """Everything arrives on the wires byte for byte, each aircraft and each radar from a socket of its own."""
    (mavlink, mavlink_url), (radar, radar_url) = _listen(), _listen()
    with mavlink, radar:
        sent = play(SCENE, mavlink_url, radar_url, speed=None)
        frames, datagrams = _received(mavlink), _received(radar)
    expected = list(events(SCENE))
    assert [data for data, _ in frames] == [event.data for event in expected if event.link.startswith("mavlink")]
    assert [data for data, _ in datagrams] == [event.data for event in expected if event.link.startswith("radar")]
    assert sent == {"MAVLink frames": len(frames), "radar datagrams": len(datagrams)}
    speakers = {(parse(data).system, port) for data, port in frames}
    flying = sum(SCENE.present(one)[1] > SCENE.present(one)[0] for one in SCENE.aircraft)
    assert len(speakers) == len({port for _, port in speakers}) == flying
    assert len({port for _, port in datagrams}) == 2


def test_a_kind_without_an_address_is_left_out() -> None:
    """Without a radar's address nothing but MAVLink is sent."""
    mavlink, url = _listen()
    with mavlink:
        assert set(play(SCENE, url, None, speed=None)) == {"MAVLink frames"}


def test_a_scene_stops_when_asked_to() -> None:
    """A stop that is set from the progress ends the scene there, long before its end at this pace."""
    stop, told = Event(), []

    def progress(elapsed_s: float) -> None:
        told.append(elapsed_s)
        if elapsed_s > 0.5:
            stop.set()

    mavlink, url = _listen()
    with mavlink:
        play(build_scene("approach", start_ns=START_NS), url, None, speed=20.0, stop=stop, progress=progress)
        play(SCENE, url, None, speed=1e-6, stop=stop)  # a stop already set: it does not even wait
    assert 0.5 < max(told) < 1.5
    assert told == sorted(told)


def test_nobody_listening_is_no_error() -> None:
    """Datagrams to a port where nobody listens are sent all the same."""
    mavlink, url = _listen()
    mavlink.close()
    assert play(SCENE, url, None, speed=None)["MAVLink frames"] > 50


def test_a_scene_becomes_a_session_folder(tmp_path: Path) -> None:
    """The folder holds every byte of every link with its stamp, the site, and session.json that names them."""
    folder = write_session(SCENE, tmp_path, command=("simulate", "traffic"))
    record = read_record(folder)
    assert record.ended == "done"
    assert record.command == ("simulate", "traffic")
    assert record.site is not None
    assert parse_site(record.site).runway.length_m == SCENE.site.runway.length_m
    expected = list(events(SCENE))
    assert record.watermark == expected[-1].at
    assert [source.name for source in record.sources] == [name.replace(":", "-") for name in SCENE.links]
    for source in record.sources:
        wanted = [(event.at, event.data) for event in expected if event.link == source.name.replace("-", ":")]
        assert source.arrivals == len(wanted)
        if wanted:
            arrivals = open_recording(folder / source.file).arrivals()
            assert [(one.received_at, one.data) for one in arrivals] == wanted


def test_the_session_holds_the_truth(tmp_path: Path) -> None:
    """truth.parquet has the schema of every session's, in order of time, in degrees above the ellipsoid."""
    folder = write_session(build_scene("approach", start_ns=START_NS, changes=["duration_s=10"]), tmp_path)
    table = pq.read_table(folder / "truth.parquet")
    assert table.schema.equals(TRUTH)
    rows = table.to_pylist()
    assert len(rows) == 40
    assert rows[0]["aircraft"] == "mavlink:1"
    assert rows[0]["height_m"] == pytest.approx(1700.0)
    assert rows[0]["latitude_deg"] == pytest.approx(31.05, abs=0.01)  # 6 km left of an approach to the east: north
    assert rows[0]["velocity_east_mps"] == pytest.approx(130.0, abs=0.2)
    assert rows[0]["mode"] == "straight"
    assert table["time"].cast("int64").to_pylist() == [START_NS + 250_000_000 * index for index in range(40)]


def test_watched_datagrams_become_a_capture(tmp_path: Path) -> None:
    """A capture of datagrams reads back with their stamps and bytes."""
    scene = build_scene("approach", start_ns=START_NS, changes=["duration_s=4"])
    wanted = [(event.at, event.data) for event in events(scene) if event.link == "radar:1"]
    assert write_datagrams(wanted, tmp_path / "radar.pcap") == len(wanted)
    read = [(one.received_at, one.data) for one in open_recording(tmp_path / "radar.pcap").arrivals()]
    assert read == wanted
    assert all(isinstance(decode(data), Datagram) for _, data in read)
