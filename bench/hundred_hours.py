"""A hundred hours of traffic that comes and goes: what a session holds in memory at the end, and at its beginning.

python -m bench.hundred_hours [HOURS]      prints a table; exit code 1 where memory has grown
python -m bench --only memory [--long]     20 hours, or 100

A visitor comes every minute and stays for one or two: a vehicle, traffic that others tell of, a target that only the radar
sees, or two of these. Links drop for a while and come back, radars lose targets and number them anew, some plots are of
nothing. All of it goes the whole way, from bytes to the sinks: decoder, picture, totals, drawing (sent to nobody), and
what is published. In the first quarter of an hour a crowd of 2400 addresses passes, which fills what the decoder keeps of the
last 2048. The last 70 minutes of each tenth are quiet: then everybody has left, and what is held
is counted.
"""

from __future__ import annotations

import gc
import math
import resource
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import BuiltinFunctionType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters import Arrival, Source, landing_radar
from adapters.mavlink_frames import FrameEncoder
from bench.measure import Figure
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.runtime.run import Run
from gateway.runtime.setup import Place, Setup
from gateway.settings import DEMO_SITE
from gateway.sinks.publish import PublishSink
from gateway.sinks.rerun import RerunSink

SECOND, HOUR = 10**9, 3600
START = 1_790_000_000 * SECOND
EVERY_S, GPS_S, SCAN_S, STEP_S = 60, 5, 4, 30
VEHICLES, CROWD_S, CROWD_EACH_S, CROWD_STAYS_S = 40, 800, 3, 17
PARTS, QUIET_S = 10, 70 * 60
APART = {"site", "options", "frame", "radars"}  # of the state: what was settled before the first arrival
HEADINGS = "  hour   tracks   state, kB decoder, kB  others, kB     RSS, MB"
NOISE_MB = 8.0  # of the process: what allocators keep differs from hour to hour

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Visitor:
    """One that comes and goes: when, by which sources it is known, and what of them fails."""

    number: int
    since: int  # s
    until: int
    kind: str  # "vehicle", "traffic", "crowd" (traffic, each second), "target" (of the radar alone)
    is_seen: bool
    drops_at: int | None  # s: the link is gone for 40 s
    lost_at: int | None  # s: the radar loses it for 6 s, and numbers it anew
    left_m: float

    def place_m(self, second: float) -> Floats:
        """In the runway frame, (3,): straight in, at 80 m/s."""
        return np.array([-20_000.0 + 80.0 * (second - self.since), self.left_m, 1100.0 - 3.0 * (second - self.since)])


def visitors(hours: int) -> Iterator[Visitor]:
    """Everybody, in order of coming; nobody stays into the quiet end of a part."""
    random, part_s = np.random.default_rng(1), hours * HOUR // PARTS
    for number in range(hours * HOUR // EVERY_S):
        since, stays = number * EVERY_S, int(random.integers(60, 120))
        if since % part_s + stays >= part_s - QUIET_S:
            continue
        kind = ("vehicle", "traffic", "target")[int(random.integers(3))]
        fails = random.uniform(size=2) < 0.3
        middle = since + stays // 2
        is_seen = kind == "target" or bool(random.uniform() < 0.6)
        left_m = float(random.uniform(-4000.0, 4000.0))
        drops_at, lost_at = middle if fails[0] else None, middle - 10 if fails[1] else None
        yield Visitor(number, since, since + stays, kind, is_seen, drops_at, lost_at, left_m)


class Voices:
    """What visitors make their sources say, as bytes."""

    def __init__(self) -> None:
        self._frame = RunwayFrame(DEMO_SITE.runway)
        self._radar = RadarFrame.of(DEMO_SITE.radars[0], self._frame)
        self._geoid_m = DEMO_SITE.runway.geoid_separation_m or 0.0
        self._random = np.random.default_rng(2)
        self._encoders = {system: FrameEncoder(system) for system in range(1, VEHICLES + 1)}
        self._sequence = 0

    def say(self, visitor: Visitor, second: int) -> Iterator[tuple[int, bytes]]:
        """What is heard of a visitor in one second: source, bytes."""
        is_away = visitor.drops_at is not None and visitor.drops_at <= second < visitor.drops_at + 40
        is_due = visitor.kind == "crowd" or (second - visitor.since) % GPS_S == 0
        if visitor.kind != "target" and not is_away and is_due:
            yield from ((0, data) for data in self._report(visitor, second))
        is_lost = visitor.lost_at is not None and visitor.lost_at <= second < visitor.lost_at + 6
        if visitor.is_seen and not is_lost and second % SCAN_S == 0:
            yield 1, self._plots(visitor, second)

    def _report(self, visitor: Visitor, second: int) -> Iterator[bytes]:
        here = visitor.place_m(second) + self._random.normal(0.0, 5.0, 3)
        latitude, longitude, height = (float(part) for part in self._frame.geodetic_from_runway(here))
        degrees = round(math.degrees(latitude) * 1e7), round(math.degrees(longitude) * 1e7)
        altitude = round((height - self._geoid_m) * 1e3)
        east, north, up = (round(100.0 * float(part)) for part in self._frame.enu_from_runway @ [80.0, 0.0, -3.0])
        if visitor.kind == "vehicle":
            encoder, boot_ms = self._encoders[visitor.number % VEHICLES + 1], (second - visitor.since + 60) * 1000
            usec = START // 1000 + second * 1_000_000
            yield encoder.encode("SYSTEM_TIME", time_unix_usec=usec, time_boot_ms=boot_ms)
            yield encoder.encode(
                "GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=degrees[0], lon=degrees[1], alt=altitude,
                relative_alt=altitude, vx=north, vy=east, vz=-up, hdg=65535,
            )  # fmt: skip
            return
        yield self._encoders[1].encode(
            "ADSB_VEHICLE", ICAO_address=0x100000 + visitor.number, lat=degrees[0], lon=degrees[1], altitude_type=1,
            altitude=altitude, heading=9000, hor_velocity=8000, ver_velocity=-300, callsign=b"V%d" % visitor.number,
            emitter_type=3, tslc=0, flags=1 | 2 | 4 | 8 | 16, squawk=0,
        )  # fmt: skip

    def _plots(self, visitor: Visitor, second: int) -> bytes:
        anew = visitor.lost_at is not None and second >= visitor.lost_at
        number = (2 * visitor.number + anew) % 65_000 + 1
        found = [self._plot(number, visitor.place_m(second), second)]
        if self._random.uniform() < 0.05:  # nothing: one plot, never seen again
            nothing = self._random.uniform([-25_000.0, -5000.0, 300.0], [-5000.0, 5000.0, 3000.0])
            found.append(self._plot(65_001 + second % 500, nothing, second))
        self._sequence = self._sequence + 1 & 0xFFFFFFFF
        header = landing_radar.Header("plots", 1, self._sequence, START + second * SECOND)
        return landing_radar.encode(header, found)

    def _plot(self, number: int, place_m: Floats, second: int) -> landing_radar.Plot:
        polar = polar_from_xyz(self._radar.from_enu(self._frame.enu_from_runway @ place_m))
        polar += self._random.normal(0.0, [15.0, 1e-3, 1e-3])
        azimuth, elevation = (math.degrees(float(angle)) for angle in polar[1:])
        return landing_radar.Plot(number, START + second * SECOND, float(polar[0]), azimuth, elevation)


def _crowd(second: int) -> list[Visitor]:
    """Those who pass at the very beginning: as many, and as long, as is ever remembered of traffic."""
    if second >= CROWD_S:
        return []
    numbers = range(CROWD_EACH_S * second, CROWD_EACH_S * (second + 1))
    return [
        Visitor(1_000_000 + number, second, second + CROWD_STAYS_S, "crowd", False, None, None, 0.0)
        for number in numbers
    ]


def arrivals(hours: int) -> Iterator[tuple[list[Arrival], int]]:
    """Everything that arrives, in steps, with how far time has come after each, in s."""
    coming, voices = visitors(hours), Voices()
    here: list[Visitor] = []
    following = next(coming, None)
    for first in range(0, hours * HOUR, STEP_S):
        some: list[Arrival] = []
        for second in range(first, first + STEP_S):
            here += _crowd(second)
            while following is not None and following.since <= second:
                here.append(following)
                following = next(coming, None)
            here = [visitor for visitor in here if second < visitor.until]
            said = [one for visitor in here for one in voices.say(visitor, second)]
            for place, (source, data) in enumerate(said):
                some.append(Arrival(START + second * SECOND + 300_000_000 + 4000 * place, source, data))
        yield some, first + STEP_S


_SHARED = (type, ModuleType, FunctionType, BuiltinFunctionType, MethodType)


def deep_size(*roots: object) -> int:
    """Bytes of everything that some objects hold, each thing once; not of code."""
    seen: set[int] = set()
    waiting: list[Any] = list(roots)
    total = 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, _SHARED):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
        if isinstance(one, np.ndarray) and one.base is not None:
            waiting.append(one.base)
    return total


def resident_mb() -> float:
    """What the process has in memory now; where the system does not tell, the most that it ever had."""
    status = Path("/proc/self/status")
    if status.exists():
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


@dataclass(frozen=True, slots=True)
class Held:
    """What is held at a quiet hour: bytes of the picture's state (but for `APART`), of the decoder, of all else; MB."""

    hour: float
    state: int
    decoder: int
    others: int
    resident_mb: float
    tracks: int


def run(hours: int, say: Callable[[str], None]) -> list[Held]:
    """Work through so many hours; what is held at the beginning, and at the end of each tenth."""
    session = Run(Setup(Place(DEMO_SITE, "", "the demo"), is_watched=False), START)
    session.add(Source(0, "mavlink", "mavlink", "bench"))
    session.add(Source(1, "radar", "radar", "bench"))
    drawn, published = RerunSink(DEMO_SITE, period_s=30.0, rows_limit=4096), PublishSink(lambda frame: None)

    def held(hour: float) -> Held:
        gc.collect()
        assert session._state is not None
        names = set(session._state.__dataclass_fields__) - APART
        state, decoder = (
            deep_size(*(getattr(session._state, name) for name in names)),
            deep_size(session._hearing.decoder),
        )
        others = deep_size(session, drawn, published) - state - decoder
        return Held(hour, state, decoder, others, resident_mb(), session._state.lanes.next_track - 1)

    found, began = [held(0.0)], time.monotonic()
    for some, second in arrivals(hours):
        picture = session.work(some, START + second * SECOND)
        if picture is not None:
            drawn.write(picture)
            published.write(picture)
        if second % (hours * HOUR // PARTS) == 0:
            found.append(held(second / HOUR))
            say(_line(found[-1]) + f"   after {time.monotonic() - began:.0f} s")
    return found


def _line(one: Held) -> str:
    sizes = "".join(f"{size / 1024.0:12.1f}" for size in (one.state, one.decoder, one.others))
    return f"{one.hour:6.0f}{one.tracks:9d}{sizes}{one.resident_mb:12.1f}"


def hundred_hours(say: Callable[[str], None], hours: int = 100) -> list[Figure]:
    """What has grown between the first tenth of the hours and the last. `hours`: 12 at least, for quiet ends."""
    found = run(hours, say)
    began, first, last = found[0], found[1], found[-1]
    since = f"more than after {first.hour:.0f}"
    left_kb = (last.state - began.state) / 1024.0
    all_kb = (last.state + last.decoder + last.others - first.state - first.decoder - first.others) / 1024.0
    return [
        Figure(f"{hours} hours: the picture's state, more than at the beginning", "kB", (left_kb,), 8.0),
        Figure(f"… everything that is held, {since}", "kB", (all_kb,), 64.0),
        Figure(f"… memory of the process, {since}", "MB", (last.resident_mb - first.resident_mb,), NOISE_MB),
    ]


def main() -> None:
    """Run, print, and fail where memory has grown."""
    hours = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(HEADINGS, flush=True)
    figures = hundred_hours(lambda text: print(text, flush=True), hours)
    for figure in figures:
        print(f"{figure.name}: {figure.median:.1f} {figure.unit} ({figure.target})")
    raise SystemExit(0 if all(figure.holds for figure in figures) else 1)


if __name__ == "__main__":
    main()
