"""What the scenarios share: a recorded approach, a port that is free, and the program, run here or as a process."""

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.app import run
from sim.recording import write_session
from sim.scenes import build_scene

START_NS = 1_767_225_600_000_000_000
PROGRAM = [sys.executable, "-c", "from gateway.cli import main; main()"]


@pytest.fixture(scope="session")
def approach(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session folder with 80 s of an approach: one aircraft (a position every 0.5 s), one radar (a plot every 0.4 s)."""
    changes = ["duration_s=80", "gps.period_s=0.5"]
    scene = build_scene("approach", start_ns=START_NS, seed=3, changes=changes)
    return write_session(scene, tmp_path_factory.mktemp("approach"))


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one command line ended."""

    code: int
    out: str
    err: str

    @property
    def summary(self) -> Any:
        """What --json printed."""
        return json.loads(self.out)

    @property
    def sentence(self) -> str:
        """The one plain sentence of a failure."""
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert "Traceback" not in self.err
        return lines[0]


Talkdown = Callable[..., Outcome]


@pytest.fixture
def talkdown(capsys: pytest.CaptureFixture[str]) -> Talkdown:
    """Run a command line in this process."""

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = run([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start the program as a process of its own, which is gone when the test ends."""
    started: list[subprocess.Popen[str]] = []

    def begin(*arguments: object, **options: Any) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*PROGRAM, *(str(argument) for argument in arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "RERUN_ANALYTICS": "0"},
            **options,
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture
def free_ports() -> tuple[int, int]:
    """Two UDP ports that nobody has at the moment."""
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as two,
    ):
        one.bind(("127.0.0.1", 0))
        two.bind(("127.0.0.1", 0))
        return one.getsockname()[1], two.getsockname()[1]


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any], str], Any]:
    """Wait until something is so; fail with what was waited for when it does not come."""

    def wait(holds: Callable[[], Any], what: str) -> Any:
        give_up = time.monotonic() + 60.0
        while not (found := holds()):
            assert time.monotonic() < give_up, f"waited in vain for {what}"
            time.sleep(0.02)
        return found

    return wait
