"""Many aircraft live over UDP on loopback: how long an observation takes from its arrival to the picture that it is in.

python -m bench.live_fleet KIND AIRCRAFT SECONDS       prints, as JSON, what one run gave; KIND as in `bench.sky`

The whole gateway runs with its archive and a server for viewers, the sky in another process. The time of an observation
ends when its picture is made and handed to every sink. The CPU time of the process that draws counts as the gateway's.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.live_rates import Meter
from bench.measure import Figure, environment, output

if TYPE_CHECKING:
    from gateway.picture import Picture
    from gateway.runtime.run import Run

ENDS_S = 1.0
SETTLED_S = 12.0  # the first pairs, the first tracks
CASES = (("vehicles", 100, 30.0), ("traffic", 1000, 50.0))


def live_fleet(seconds: float) -> list[Figure]:
    """100 vehicles at 10 Hz with two radars, and 1000 aircraft at 1 Hz."""
    figures = []
    for kind, aircraft, target_ms in CASES:
        told = json.loads(output([sys.executable, "-m", "bench.live_fleet", kind, str(aircraft), str(int(seconds))]))
        figures += [
            Figure(f"live, {aircraft} {kind}: arrival to picture, 99 %", "ms", (told["99_ms"],), target_ms),
            Figure("… median", "ms", (told["median_ms"],)),
            Figure("… observations a second", "1/s", (told["a_second"],)),
            Figure("… lost", "", (told["lost"],), 0.0),
            Figure("… the gateway's share of a core", "%", tuple(told["shares"]), 100.0),
        ]
    return figures


class Stopwatch:
    """Watches a live run: for each position and plot, how long after its arrival its picture was made."""

    def __init__(self) -> None:
        self.meter = Meter()
        self.told_ms: list[float] = []
        self._first_ns: int | None = None

    def __call__(self, run: Run, picture: Picture | None) -> None:
        """After each step."""
        from gateway.observation import GpsReport, RadarPlot

        now = time.time_ns()
        self.meter(run, picture)
        if picture is None:
            return
        heard = [one.received_at for one in picture.observations if isinstance(one, GpsReport | RadarPlot)]
        if heard and self._first_ns is None:
            self._first_ns = heard[0]
        if self._first_ns is not None and now - self._first_ns > SETTLED_S * 1e9:
            self.told_ms += [1e-6 * (now - at) for at in heard]


def measure(kind: str, aircraft: int, seconds: int) -> dict[str, Any]:
    """One run: the gateway in here, the sky in another process."""
    from bench.sky import SITE
    from gateway.runtime.links import open_link
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import Place, Serve, Setup
    from gateway.runtime.urls import Url
    from gateway.settings import format_site

    watch = Stopwatch()
    links = [open_link(Url("udpin", "127.0.0.1", 0)) for _ in range(2)]
    ports = [str(link.url.port) for link in links]
    command = [sys.executable, "-m", "bench.sky", kind, str(aircraft), str(seconds), *ports]
    gone_at: list[float] = []
    looked_at = 0.0

    def ended() -> str | None:
        nonlocal looked_at
        now = time.monotonic()
        if not gone_at and now - looked_at > ENDS_S:  # at each tick it would be a fortieth of what is measured
            looked_at = now
            if sender.poll() is not None:
                gone_at.append(now)
        return "the bench" if gone_at and now - gone_at[0] > ENDS_S else None

    with tempfile.TemporaryDirectory() as folder:
        place = Place(SITE, format_site(SITE), "bench")
        setup = Setup(place=place, archive=Path(folder), serve=Serve(), live=True)
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment()) as sender:
            summary = run_live(links[:1], links[1:], setup, watch=watch, asked_to_stop=ended)
            sent = json.loads(sender.stdout.read()) if sender.stdout else {}
    told = sorted(watch.told_ms)
    return {
        **sent,
        "observations": summary.observations,
        "median_ms": statistics.median(told),
        "99_ms": told[int(0.99 * len(told))],
        "worst_ms": told[-1],
        "a_second": len(told) / (seconds - SETTLED_S),
        "lost": sent["sent"] - sum(int(row["arrivals"]) for row in summary.sources),
        "shares": watch.meter.shares[int(SETTLED_S / 2) : -1],
        "slowest_tick_s": watch.meter.slowest_tick_s,
        "tracks": summary.tracks,
        "track_rows": summary.track_rows,
        "associations": summary.associations,
        "counters": summary.counters,
    }


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])), indent=1))
