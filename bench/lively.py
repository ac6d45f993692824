"""Live over UDP on loopback: what one aircraft costs, and how long a late GPS report takes to be in the picture.

python -m bench.lively SECONDS          prints, as JSON, how late the pictures are, in ms
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from bench.measure import Figure, environment, output, talkdown
from bench.replays import RATES, late, settings

if TYPE_CHECKING:
    from gateway.picture import Picture
    from gateway.runtime.run import Run

_SETTLE_S = 8.0  # imports, the first messages, the geoid, the first association
_LATE_S = 2.0


def core_share(folder: Path, seconds: float) -> list[Figure]:
    """CPU time of `talkdown live` for each second, once it runs: archive on, a server for viewers, nobody looking."""
    import psutil

    mavlink, radar, viewers = _free_port(socket.SOCK_DGRAM), _free_port(socket.SOCK_DGRAM), _free_port()
    command = talkdown(
        "live", "--mavlink", f"udpin:127.0.0.1:{mavlink}", "--radar", f"udpin:127.0.0.1:{radar}", "--viewer", "none",
        "--serve", f"127.0.0.1:{viewers}", "--archive", str(folder / "live"), "--quiet",
        "--seconds", str(seconds + _SETTLE_S + 2.0), *_site(folder),
    )  # fmt: skip
    quiet = subprocess.DEVNULL
    with (
        subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, env=environment()) as gateway,
        _world(mavlink, radar, *RATES, *late(0.05, 0.2)) as world,
    ):
        process = psutil.Process(gateway.pid)
        time.sleep(_SETTLE_S)
        began, before = time.monotonic(), _cpu_s(process)
        shares = []
        while time.monotonic() - began < seconds:
            since = time.monotonic()
            time.sleep(min(5.0, seconds))
            now = _cpu_s(process)
            shares.append(100.0 * (now - before) / (time.monotonic() - since))
            before = now
        gateway.wait()
        world.terminate()
    return [Figure("live, one aircraft: share of a core", "%", tuple(shares), 10.0)]


def lateness(seconds: float) -> list[Figure]:
    """From the arrival of GPS reports that are 2 s late to the picture that has their rows."""
    told = sorted(json.loads(output([sys.executable, "-m", "bench.lively", str(seconds)])))
    worst = told[min(int(0.99 * len(told)), len(told) - 1)]
    return [
        Figure("live, GPS 2 s late, to the picture", "ms", tuple(told), 30.0),
        Figure("… 99 % of them", "ms", (worst,), 30.0),
    ]


def _cpu_s(process: object) -> float:
    times = process.cpu_times()  # type: ignore[attr-defined]
    return float(times.user + times.system)


def _free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(type=kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _site(folder: Path) -> tuple[str, str]:
    from gateway.settings import DEMO_SITE, format_site

    path = folder / "site.toml"
    path.write_text(format_site(DEMO_SITE), encoding="utf-8")
    return "--site", str(path)


def _world(mavlink: int, radar: int, *changes: str) -> subprocess.Popen[bytes]:
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        talkdown(
            "simulate", "approach", "--mavlink", f"udpout:127.0.0.1:{mavlink}",
            "--radar", f"udpout:127.0.0.1:{radar}", "--quiet", *settings(*changes),
        ),
        stdin=quiet, stdout=quiet, stderr=quiet, env=environment(),
    )  # fmt: skip


class Stopwatch:
    """Watches a live run: for each GPS report, how long after its arrival a picture had its row."""

    def __init__(self) -> None:
        self.told_ms: list[float] = []
        self._newest = 0

    def __call__(self, run: Run, picture: Picture | None) -> None:
        """After each step, when the picture is also with every sink."""
        now = time.time_ns()
        if picture is None:
            return
        heard = picture.fuse.received
        gps = [one == "gps" for one in picture.fuse.updated_by]
        fresh = sorted({int(at) for at, by_gps in zip(heard, gps, strict=True) if by_gps and at > self._newest})
        self.told_ms += [1e-6 * (now - at) for at in fresh]
        self._newest = max([self._newest, *fresh])


def _measure(seconds: float) -> list[float]:
    """Runs the gateway in here, archive and viewers' server on, the world in another process."""
    from gateway.runtime.links import open_link
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import Place, Serve, Setup
    from gateway.runtime.urls import Url
    from gateway.settings import DEMO_SITE, format_site

    watch = Stopwatch()
    links = [open_link(Url("udpin", "127.0.0.1", 0)) for _ in range(2)]
    place = Place(DEMO_SITE, format_site(DEMO_SITE), "demo site")
    with tempfile.TemporaryDirectory() as folder:
        setup = Setup(place=place, archive=Path(folder), serve=Serve(), live=True)
        with _world(links[0].url.port, links[1].url.port, *RATES, *late(_LATE_S, _LATE_S)) as world:
            run_live(links[:1], links[1:], setup, seconds=seconds + _SETTLE_S, watch=watch)
            world.terminate()
    return watch.told_ms


if __name__ == "__main__":
    print(json.dumps(_measure(float(sys.argv[1]))))
