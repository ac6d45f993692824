"""What is sent on a real socket, to a vehicle that answers on it."""

import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from gateway.observation import FlightPlan
from gateway.picture import Picture
from gateway.runtime.folder import read_record
from gateway.runtime.links import open_link
from gateway.runtime.loop import run_live
from gateway.runtime.manners import Manners
from gateway.runtime.run import Run
from gateway.runtime.setup import Place, Setup
from gateway.runtime.urls import Url
from gateway.settings import DEMO_SITE

SECOND = 10**9


class FlyingThread:
    """A scripted vehicle that sends to a port and answers what comes back from it."""

    def __init__(self, vehicle: Any, port: int) -> None:
        self.vehicle, self._port = vehicle, port
        self.heard: list[bytes] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fly, daemon=True)

    def __enter__(self) -> "FlyingThread":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def _fly(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.bind(("127.0.0.1", 0))
            link.setblocking(False)
            while not self._stop.wait(0.005):
                for frame in self.vehicle.step(time.time_ns()):
                    link.sendto(frame, ("127.0.0.1", self._port))
                while (frame := self._received(link)) is not None:
                    self.heard.append(frame)
                    for answer in self.vehicle.hear(frame):
                        link.sendto(answer, ("127.0.0.1", self._port))

    def _received(self, link: socket.socket) -> bytes | None:
        try:
            return link.recv(2048)
        except BlockingIOError:
            return None


@pytest.fixture
def hurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a second of listening is enough for a test."""
    monkeypatch.setattr("gateway.runtime.manners.LISTEN_FIRST_NS", SECOND // 4)
    monkeypatch.setattr("adapters.rate_client.LISTEN_NS", SECOND // 2)
    monkeypatch.setattr("adapters.mission_client.QUIET_NS", SECOND // 2)


@pytest.mark.usefixtures("hurried")
def test_rates_and_mission_are_asked_for_and_the_answers_come_into_the_picture(scripted: Any, tmp_path: Path) -> None:
    vehicle = scripted(rates={0: 5.0, 30: 5.0}, items=3, boot_at=time.time_ns() - 60 * SECOND)
    link = open_link(Url("udpin", "127.0.0.1"))
    plans: list[FlightPlan] = []
    told: list[str] = []

    def watch(run: Run, picture: Picture | None) -> None:
        if picture is not None:
            plans.extend(one for one in picture.observations if isinstance(one, FlightPlan))
            told.extend(event.text for event in picture.events)

    def is_over() -> str | None:
        done = plans and "mission was read" in str(told) and vehicle.rates.get(245)
        return "the test" if done else None

    setup = Setup(place=Place(DEMO_SITE, "", "test"), archive=tmp_path, live=True)
    manners = Manners(heartbeat=True, request_rates=True, fetch_mission=True)
    with FlyingThread(vehicle, link.url.port) as flying:
        summary = run_live([link], [], setup, seconds=20.0, watch=watch, asked_to_stop=is_over, manners=manners)
    assert [point.sequence for point in plans[-1].points if point.kind == "waypoint"] == [1, 2]  # 0 is home
    assert vehicle.rates[33] == pytest.approx(5.0)
    assert manners.counters["COMMAND_LONG sent"] >= 6
    assert manners.counters["HEARTBEAT sent"] >= 1
    assert len(flying.heard) <= manners.counters.total()
    assert summary.archive is not None
    counters = read_record(summary.archive).counters
    assert {kind: counters.get(kind) for kind in manners.counters} == manners.counters
    recorded = (summary.archive / "inputs" / "mavlink-1.tlog").read_bytes()
    assert not any(frame in recorded for frame in flying.heard)
