"""Live at high rates over UDP on loopback: what is lost, what is counted, what it costs.

python -m bench.live_rates VEHICLES RATE SECONDS [default] [alone]      prints, as JSON, what one run gave

The whole gateway runs in a process of its own: links, receiver, decoder, pipeline, archive (`run_live`, as `talkdown
live` calls it, without its display). The telemetry comes from another process (see `bench.fleet`). With `default` the
receive buffer is the one that the system gives to everybody; a process of its own empties it then, unless `alone`. The
CPU time of that process counts as the gateway's.

A core of one machine is not that of another, and many a machine changes its speed within seconds. So between its steps the
gateway's thread has pymavlink parse some frames of the same fleet, and the CPU time for each is given beside the
gateway's, which it is not counted in: both fall on the same moments.
"""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from itertools import cycle, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bench.measure import Figure, environment, output

if TYPE_CHECKING:
    from gateway.picture import Picture
    from gateway.runtime.run import Run

FAST, FAST_VEHICLES = 50_000, 5
FLEET, FLEET_VEHICLES = 10_000, 100
_ENDS_S = 2.0
_SAMPLE_S = 2.0
_LOOK_S = 0.25
_SLICE = 20  # frames that pymavlink parses between two steps


def live_rates(seconds: float) -> list[Figure]:
    """50 000 messages/s into a large receive buffer, and 10 000/s of 100 vehicles into a default one."""
    fast = _run(FAST_VEHICLES, FAST, int(seconds))
    fleet = _run(FLEET_VEHICLES, FLEET, int(seconds), "default")
    return [
        *_figures(f"live, {FAST} messages/s, buffer of {fast['buffer_kib']} KiB", fast, lost=0.0, share=50.0),
        *_figures(f"live, {FLEET_VEHICLES} vehicles, {FLEET} messages/s, {fleet['buffer_kib']} KiB", fleet, 0.1, None),
    ]


def _figures(name: str, told: dict[str, Any], lost: float, share: float | None) -> list[Figure]:
    sent, recorded, decoded, counted = (float(told[one]) for one in ("sent", "recorded", "decoded", "counted"))
    return [
        Figure(f"{name}: sent", "", (sent,)),
        Figure("… recorded", "", (recorded,)),
        Figure("… decoded", "", (decoded,)),
        Figure("… lost", "%", (100.0 * (sent - min(recorded, decoded)) / sent,), lost),
        Figure("… lost and not counted", "", (abs(sent - recorded - counted),), 0.0),
        Figure("… the gateway's share of a core", "%", tuple(told["shares"]), share),
        # A gateway that is starved by other programs loses datagrams and has a small share: this one tells that apart.
        Figure("… CPU time for each that was decoded", "us", (told["cpu_us"],), share and share / 100.0 * 1e6 / FAST),
        Figure("… pymavlink's parse of such a message, meanwhile", "us", (told["pymavlink_us"],)),
        Figure("… CPU time for each / pymavlink's parse", "", (told["cpu_us"] / told["pymavlink_us"],)),
    ]


def _run(vehicles: int, rate: int, seconds: int, *more: str) -> dict[str, Any]:
    words = [str(vehicles), str(rate), str(seconds), *more]
    told: dict[str, Any] = json.loads(output([sys.executable, "-m", "bench.live_rates", *words]))
    return told


class Yardstick:
    """pymavlink's parser on the frames of a fleet, some at a time: its fastest way that checks checksums."""

    def __init__(self, vehicles: int, rate: int) -> None:
        from pymavlink.dialects.v20 import all as dialect

        from bench.fleet import Fleet

        fleet = Fleet(vehicles, rate)
        fleet.second(0)
        sizes = fleet.sizes.tolist()
        self._frames = cycle([row[:size].tobytes() for row, size in zip(fleet.table, sizes, strict=True)])
        self._parse = dialect.MAVLink(None).parse_char
        self._count, self._used_s = 0, 0.0

    @property
    def used_s(self) -> float:
        """The CPU time that it has taken so far."""
        return self._used_s

    @property
    def each_us(self) -> float:
        """The CPU time for each frame."""
        return 1e6 * self._used_s / max(self._count, 1)

    def __call__(self) -> None:
        """Parse a few."""
        some = list(islice(self._frames, _SLICE))
        began = time.thread_time()
        for frame in some:
            self._parse(frame)
        self._used_s += time.thread_time() - began
        self._count += len(some)


class Meter:
    """Watches a live run: the CPU time of the gateway, sampled, and the longest time between two steps.

    The gateway's are this process, the one that draws, and `other`: the one that empties the socket, if there is one. What
    those use between the last look at them and their end is not seen.
    """

    def __init__(self, other: int | None = None, yardstick: Yardstick | None = None) -> None:
        self._others: dict[int, float] = {} if other is None else {other: 0.0}
        self._yardstick = yardstick
        self.shares: list[float] = []
        self.slowest_tick_s = 0.0
        self._since = self._tick = self._looked = time.monotonic()
        self._began_s = self._used = self.cpu_s

    @property
    def other_s(self) -> float:
        """CPU time of the other processes, as far as it was seen."""
        return sum(self._others.values())

    def _look(self) -> None:
        for process in self._others:
            with contextlib.suppress(FileNotFoundError):  # it has ended
                words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
                self._others[process] = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    @property
    def cpu_s(self) -> float:
        """CPU time of all of them, without the yardstick's."""
        self._look()
        return time.process_time() + self.other_s - (0.0 if self._yardstick is None else self._yardstick.used_s)

    @property
    def spent_s(self) -> float:
        """CPU time since the beginning."""
        return self.cpu_s - self._began_s

    def __call__(self, run: Run, picture: Picture | None) -> None:
        """After each step."""
        now = time.monotonic()
        self.slowest_tick_s = max(self.slowest_tick_s, now - self._tick)
        self._tick = now
        if now - self._looked >= _LOOK_S:
            self._looked = now
            if run.outputs is not None and run.outputs.drawn_by is not None:
                self._others.setdefault(run.outputs.drawn_by, 0.0)
            self._look()
        if now - self._since >= _SAMPLE_S:
            used = self.cpu_s
            self.shares.append(100.0 * (used - self._used) / (now - self._since))
            self._since, self._used = now, used
        if self._yardstick is not None:
            self._yardstick()


def measure(
    vehicles: int, rate: int, seconds: int, *, default_buffer: bool = False, alone: bool = False
) -> dict[str, Any]:
    """One run: the gateway in here, the telemetry of another process."""
    from gateway.runtime.links import RECEIVE_BUFFER_BYTES
    from gateway.runtime.loop import run_live
    from gateway.runtime.setup import Place, Setup
    from gateway.runtime.udp import UdpLink
    from gateway.runtime.urls import Url
    from gateway.settings import DEMO_SITE, format_site

    link = UdpLink(
        Url("udpin", "127.0.0.1", 0),
        None if default_buffer else RECEIVE_BUFFER_BYTES,
        is_drained=False if alone else None,
    )
    yardstick = Yardstick(vehicles, rate)
    meter = Meter(link.drained_by, yardstick)
    place = Place(DEMO_SITE, format_site(DEMO_SITE), "demo site")
    command = [sys.executable, "-m", "bench.fleet", *map(str, (link.url.port, vehicles, rate, seconds))]
    with tempfile.TemporaryDirectory() as folder:
        setup = Setup(place=place, archive=Path(folder), live=True)
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment()) as sender:
            summary = run_live([link], [], setup, watch=meter, asked_to_stop=_Ended(sender))
            sent = json.loads(sender.stdout.read()) if sender.stdout else {}
        cpu_s = meter.spent_s
        recorded = sum(_records(path) for path in Path(folder).glob("*/inputs/*.tlog"))
    decoded = sum(count for reason, count in summary.counters.items() if reason.endswith(" frames"))
    dropped = sum(count for reason, count in summary.counters.items() if "dropped by the kernel" in reason)
    overflow = summary.counters.get("queue overflow", 0)
    return {
        "sent": sent["sent"],
        "latest_beat_s": sent["latest_beat_s"],
        "recorded": recorded,
        "decoded": decoded,
        "other processes cpu_s": meter.other_s,
        "cpu_us": 1e6 * cpu_s / max(decoded, 1),
        "pymavlink_us": yardstick.each_us,
        "dropped by the kernel": dropped,
        "queue overflow": overflow,
        "counted": dropped + overflow,
        "track_rows": summary.track_rows,
        "shares": meter.shares[1:],
        "share": statistics.median(meter.shares[1:] or [0.0]),
        "slowest_tick_s": meter.slowest_tick_s,
        "buffer_kib": link.granted_bytes >> 10,
        "counters": summary.counters,
    }


def _records(path: Path) -> int:
    """How many frames a .tlog holds."""
    from adapters.tlog import TlogReader

    with path.open("rb") as file:
        return sum(1 for _ in TlogReader(file))


class _Ended:
    """Asks for the end a moment after the sender has ended."""

    def __init__(self, sender: subprocess.Popen[bytes]) -> None:
        self._sender = sender
        self._ended: float | None = None

    def __call__(self) -> str | None:
        if self._ended is None and self._sender.poll() is not None:
            self._ended = time.monotonic()
        return "the bench" if self._ended is not None and time.monotonic() - self._ended > _ENDS_S else None


if __name__ == "__main__":
    _vehicles, _rate, _seconds = (int(word) for word in sys.argv[1:4])
    _words = sys.argv[4:]
    print(json.dumps(measure(_vehicles, _rate, _seconds, default_buffer="default" in _words, alone="alone" in _words)))
