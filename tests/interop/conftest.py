"""Programs of others, run on what we send and what we keep. Where one is not installed its tests are skipped.

`pip install talkdown[interop]` installs those that PyPI has; tshark comes with Wireshark.
"""

from __future__ import annotations

import contextlib
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gateway.runtime.folder import read_record
from gateway.runtime.setup import Place
from gateway.settings import parse_site
from sim.recording import write_session
from sim.scenes import build_scene

START_NS = 1_767_225_600_000_000_000

Find = Callable[[str], list[str]]
Child = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture(scope="session")
def program() -> Find:
    """The command line that starts a program, from the environment that the tests run in or from the PATH; else skips."""

    def find(name: str) -> list[str]:
        beside = Path(sys.executable).parent / name
        if beside.exists():
            return [sys.executable, str(beside)] if beside.suffix == ".py" else [str(beside)]
        found = shutil.which(name)
        if found is None:
            pytest.skip(f"{name} is not installed")
        return [found]

    return find


@pytest.fixture
def child() -> Iterator[Child]:
    """Start a program; it is ended with the test, whatever happens."""
    with contextlib.ExitStack() as stack:

        def start(*command: str, **how: Any) -> subprocess.Popen[str]:
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **how
            )
            stack.callback(_end, process)
            return process

        yield start


def _end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    try:
        process.communicate(timeout=10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


@pytest.fixture
def eventually() -> Callable[[Callable[[], Any], str], Any]:
    """Wait until something is true, and return it."""

    def wait(look: Callable[[], Any], what: str) -> Any:
        give_up = time.monotonic() + 30.0
        while not (found := look()):
            assert time.monotonic() < give_up, f"waited in vain for {what}"
            time.sleep(0.02)
        return found

    return wait


@pytest.fixture
def free_port() -> int:
    """A UDP port that nobody has at the moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session folder with 80 s of an approach: one aircraft, one radar."""
    scene = build_scene("approach", start_ns=START_NS, seed=3, changes=["duration_s=80", "gps.period_s=0.5"])
    return write_session(scene, tmp_path_factory.mktemp("recorded"))


@pytest.fixture(scope="session")
def place(recorded: Path) -> Place:
    """Where the simulated approach is."""
    text = str(read_record(recorded).site)
    return Place(parse_site(text), text, "the scene")
