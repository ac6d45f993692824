"""A live session that publishes its tracks to a ground station, which passes everything on, also back to us."""

from __future__ import annotations

import math
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from pymavlink.dialects.v20 import all as dialect

from gateway.runtime.folder import read_record
from gateway.runtime.links import open_link
from gateway.runtime.loop import run_live, run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Place, Setup
from gateway.runtime.summary import Summary
from gateway.runtime.urls import Url
from gateway.settings import parse_site
from sim.run import play
from sim.scenes import build_scene

METRES_A_DEGREE = 111_320.0


class Station(threading.Thread):
    """Hears what is published and sends all of it to a port, as a ground station that forwards does."""

    def __init__(self, back_to: int) -> None:
        super().__init__(daemon=True)
        self._wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._wire.bind(("127.0.0.1", 0))
        self._back = ("127.0.0.1", back_to)
        self.port = int(self._wire.getsockname()[1])
        self.frames: list[tuple[int, bytes]] = []

    def run(self) -> None:
        while frame := self._wire.recv(2000):
            self.frames.append((time.time_ns(), frame))
            self._wire.sendto(frame, self._back)

    def end(self) -> None:
        """An empty datagram ends the thread."""
        self._wire.sendto(b"", ("127.0.0.1", self.port))
        self.join()
        self._wire.close()


@pytest.fixture(scope="module")
def session(approach: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Summary, Path, list[tuple[int, Any]]]:
    """Four seconds of an approach, published: the summary, the folder, and what the station heard and when (ns)."""
    text = str(read_record(approach).site)
    place = Place(parse_site(text), text, "the scene")
    changes = ["gps.period_s=0.2", "gps.latency_low_s=0.01", "gps.latency_high_s=0.05"]
    scene = build_scene("approach", start_ns=time.time_ns() // 4000 * 4000, seed=5, changes=changes)
    mavlink, radar = (open_link(Url("udpin", "127.0.0.1", 0)) for _ in range(2))
    station, stop = Station(mavlink.url.port), threading.Event()
    station.start()
    urls = (Url("udpout", "127.0.0.1", link.url.port) for link in (mavlink, radar))
    sender = threading.Thread(target=play, args=(scene, *urls), kwargs={"stop": stop}, daemon=True)
    sender.start()
    archive = tmp_path_factory.mktemp("published")
    publish = Url("udpout", "127.0.0.1", station.port)
    setup = Setup(place=place, archive=archive, live=True, publish=publish, publish_system=9)
    summary = run_live([mavlink], [radar], setup, seconds=4.5)
    stop.set()
    sender.join()
    station.end()
    assert summary.archive is not None
    heard = [(at, dialect.MAVLink(None).parse_buffer(frame)[0]) for at, frame in station.frames]
    return summary, summary.archive, heard


def test_what_was_published_is_counted(session: tuple[Summary, Path, list[tuple[int, Any]]]) -> None:
    summary, _, heard = session
    kinds = [message.get_type() for _, message in heard]
    assert summary.counters["publish: frames sent"] == len(heard)
    assert summary.counters["publish: heartbeats"] == kinds.count("HEARTBEAT") >= 3
    assert summary.counters["publish: traffic reports"] == kinds.count("ADSB_VEHICLE") >= 3
    assert {(one.get_srcSystem(), one.get_srcComponent()) for _, one in heard} == {(9, 156)}


def test_the_station_is_told_where_the_track_was(session: tuple[Summary, Path, list[tuple[int, Any]]]) -> None:
    _, folder, heard = session
    rows = pq.read_table(folder / "tracks.parquet").to_pylist()
    reports = [(at, one) for at, one in heard if one.get_type() == "ADSB_VEHICLE" and one.callsign == "MAV1"]
    assert reports
    for at, one in reports:
        held = at - one.tslc * 1_000_000_000
        near = min(
            (row for row in rows if row["aircraft"] == "mavlink:1" and row["received"] is not None),
            key=lambda row: abs(row["time"].timestamp() * 1e9 - held),
        )
        north_m = (one.lat / 1e7 - near["latitude_deg"]) * METRES_A_DEGREE
        east_m = (one.lon / 1e7 - near["longitude_deg"]) * METRES_A_DEGREE * math.cos(math.radians(31.0))
        speed_mps = math.hypot(near["velocity_east_mps"], near["velocity_north_mps"])
        apart_s = abs(near["time"].timestamp() - held / 1e9)
        assert math.hypot(north_m, east_m) <= speed_mps * (apart_s + 0.2) + 30.0
        assert one.altitude / 1000.0 == pytest.approx(near["altitude_msl_m"], abs=30.0)


def test_what_comes_back_is_known_again_kept_apart_and_makes_no_track(
    session: tuple[Summary, Path, list[tuple[int, Any]]],
) -> None:
    summary, folder, _ = session
    assert summary.counters["publish: our own heard again"] >= 2
    assert set(summary.aircraft) == {"mavlink:1"}
    refused = {source.file: source.refused for source in read_record(folder).sources if source.refused}
    assert sum(refused.values()) == summary.counters["publish: our own heard again"]


def test_a_replay_of_the_session_gives_the_same_tracks(
    session: tuple[Summary, Path, list[tuple[int, Any]]], tmp_path: Path
) -> None:
    _, folder, _ = session
    again = run_replay(open_playback([folder]), Setup(place=_place(folder), archive=tmp_path))
    assert again.archive is not None
    ours, theirs = (pq.read_table(path / "tracks.parquet") for path in (folder, again.archive))
    assert ours.num_rows > 0
    assert ours.equals(theirs)


def _place(folder: Path) -> Place:
    text = str(read_record(folder).site)
    return Place(parse_site(text), text, "the session")
