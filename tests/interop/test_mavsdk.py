"""MAVSDK, as the library under many ground stations, sees the traffic that we publish through its transponder plugin."""

from __future__ import annotations

import importlib.util
import json
import queue
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as dialect

from gateway.runtime.links import open_link
from gateway.runtime.loop import run_live
from gateway.runtime.setup import Place, Setup
from gateway.runtime.urls import Url
from sim.run import play
from sim.scenes import build_scene

Child = Callable[..., "subprocess.Popen[str]"]
LISTENER = Path(__file__).with_name("transponder.py")


class Relay(threading.Thread):
    """Passes on what we publish, and keeps a copy: what MAVSDK tells is compared with it."""

    def __init__(self, to_port: int) -> None:
        super().__init__(daemon=True)
        self._wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._wire.bind(("127.0.0.1", 0))
        self._to = ("127.0.0.1", to_port)
        self.port = int(self._wire.getsockname()[1])
        self.frames: list[bytes] = []

    def run(self) -> None:
        while True:
            frame, sender = self._wire.recvfrom(2000)
            if not frame:
                return
            if sender != self._to:  # what MAVSDK answers is not passed on
                self.frames.append(frame)
                self._wire.sendto(frame, self._to)

    def end(self) -> None:
        """An empty datagram ends the thread."""
        self._wire.sendto(b"", ("127.0.0.1", self.port))
        self.join()
        self._wire.close()


@pytest.fixture
def traffic() -> Iterator[Callable[[int], None]]:
    """Simulated aircraft that say where they are to a port, at real speed, while the test lasts."""
    stop, threads = threading.Event(), list[threading.Thread]()

    def start(port: int) -> None:
        changes = ["gps.period_s=0.2", "gps.latency_high_s=0.2", "aircraft=4"]
        scene = build_scene("traffic", start_ns=time.time_ns() // 4000 * 4000, seed=5, changes=changes)
        urls = Url("udpout", "127.0.0.1", port), None
        threads.append(threading.Thread(target=play, args=(scene, *urls), kwargs={"stop": stop}, daemon=True))
        threads[-1].start()

    yield start
    stop.set()
    for thread in threads:
        thread.join()


def told_by(listener: subprocess.Popen[str]) -> queue.SimpleQueue[tuple[str, Any]]:
    """What the listener prints, as it comes: (word, value)."""
    told: queue.SimpleQueue[tuple[str, Any]] = queue.SimpleQueue()

    def read() -> None:
        assert listener.stdout is not None
        for line in listener.stdout:
            word, _, value = line.partition(" ")
            if word.strip() in ("listening", "system", "report"):
                told.put((word.strip(), json.loads(value or "null")))

    threading.Thread(target=read, daemon=True).start()
    return told


def test_mavsdk_tells_each_published_track_with_every_field(
    child: Child, free_port: int, place: Place, traffic: Callable[[int], None]
) -> None:
    if importlib.util.find_spec("mavsdk") is None:
        pytest.skip("mavsdk is not installed")
    told = told_by(child(sys.executable, str(LISTENER), str(free_port)))
    assert told.get(timeout=30) == ("listening", None)
    relay = Relay(free_port)
    relay.start()
    link = open_link(Url("udpin", "127.0.0.1", 0))
    traffic(link.url.port)
    reports: list[dict[str, Any]] = []
    systems: list[Any] = []

    def enough() -> str | None:
        while not told.empty():
            word, value = told.get()
            (reports if word == "report" else systems).append(value)
        heard = {report["icao_address"] for report in reports}
        return "the test" if len(heard) >= 2 and len(reports) >= 8 else None

    setup = Setup(place=place, live=True, publish=Url("udpout", "127.0.0.1", relay.port))
    summary = run_live([link], [], setup, seconds=40.0, asked_to_stop=enough)
    relay.end()
    assert summary.ended == "stopped by the test", (systems, reports)
    assert systems == [[1, [156]]]
    published = [dialect.MAVLink(None).parse_buffer(frame)[0] for frame in relay.frames]
    said = {_key(one): one for one in published if one.get_type() == "ADSB_VEHICLE"}
    for report in reports:
        ours = said[(report["icao_address"], round(report["latitude_deg"] * 1e7), round(report["longitude_deg"] * 1e7))]
        assert report["callsign"] == ours.callsign
        assert report["callsign"].startswith("MAV")
        assert report["altitude_type"] == 1
        assert report["absolute_altitude_m"] == pytest.approx(ours.altitude / 1e3, rel=1e-6)
        assert report["heading_deg"] == pytest.approx(ours.heading / 1e2, rel=1e-6)
        assert report["horizontal_velocity_m_s"] == pytest.approx(ours.hor_velocity / 1e2, rel=1e-6)
        assert report["horizontal_velocity_m_s"] > 20.0
        assert report["vertical_velocity_m_s"] == pytest.approx(ours.ver_velocity / 1e2, rel=1e-6)
        assert (report["emitter_type"], report["squawk"], report["tslc_s"]) == (14, 0, ours.tslc)
    assert summary.counters["publish: frames sent"] == len(relay.frames)


def _key(message: Any) -> tuple[int, int, int]:
    return (message.ICAO_address, message.lat, message.lon)
