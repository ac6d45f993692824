"""What registration costs: 10 000 pairs solved at once, and what runs along with 1000 pairs a second.

python -m bench.registration RUNS       prints, as JSON, milliseconds of a solution, and CPU seconds of a second of 1000 pairs

A thousand aircraft about one radar, a report and three plots of each every second: the pairs are made of the stages' own
values, learnt, solved every five seconds and stepped towards, as the pipeline does it. Nothing else is in the figure.
"""

from __future__ import annotations

import json
import math
import sys
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.measure import Figure, alone

SOLVED_MS, SHARE_PERCENT = 50.0, 2.0
PAIRS, AIRCRAFT, SECONDS = 10_000, 1000, 60

Floats = NDArray[np.float64]


def registration(runs: int) -> list[Figure]:
    """10 000 pairs solved, and the running update's share of a core at 1000 pairs a second."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.registration", str(runs)]))
    return [
        Figure("registration: 10 000 pairs solved", "ms", tuple(told["solved_ms"]), SOLVED_MS),
        Figure("registration running, 1000 pairs a second", "% of a core", tuple(told["share"]), SHARE_PERCENT),
        Figure("… a second's pairs made", "ms", tuple(told["made_ms"])),
    ]


def solved_ms() -> float:
    """How long 10 000 pairs take, as `talkdown register` solves them."""
    from gateway.estimators.registration import Method, register
    from sim.studies.registration import straight

    pairs = straight(PAIRS).measured(1, 1)
    one = type(pairs)(
        pairs.radars, pairs.which, pairs.polar[0], pairs.polar_sigma, pairs.geodetic[0], pairs.source_sigma_m
    )
    began = time.process_time()
    register(one, Method())
    return 1e3 * (time.process_time() - began)


class Sky:
    """Aircraft about a radar that measures 150 m, 0.5 and 0.2 degrees too much, as associate's and track's own values."""

    def __init__(self) -> None:
        from gateway.associate import Span, Spans
        from gateway.frames import RadarFrame, RunwayFrame
        from gateway.settings import DEMO_SITE

        self.site, self.chance = DEMO_SITE, np.random.default_rng(1)
        self.radar = DEMO_SITE.radars[0]
        self.frame = RadarFrame.of(self.radar, RunwayFrame(DEMO_SITE.runway))
        course = self.chance.uniform(0.0, 2.0 * math.pi, AIRCRAFT)
        level, height = self.chance.uniform(-40e3, 40e3, (AIRCRAFT, 2)), self.chance.uniform(500.0, 6000.0, AIRCRAFT)
        self.place = np.c_[level, height]
        self.speed = np.c_[90.0 * np.cos(course), 90.0 * np.sin(course), np.zeros(AIRCRAFT)]
        self.names = [f"mavlink:{number}" for number in range(AIRCRAFT)]
        self.keys = [(1, number, 0) for number in range(AIRCRAFT)]
        self.spans = Spans(Span(key, name, 0) for key, name in zip(self.keys, self.names, strict=True))

    def second(self, number: int) -> tuple[Any, Any]:
        """A second's checks and plots."""
        from gateway.align import SECOND, Fix, Plot
        from gateway.associate import Association, Check, Ledger
        from gateway.frames import polar_from_xyz
        from gateway.track import RadarTracks

        told = self.place + self.speed * number + self.chance.standard_normal((AIRCRAFT, 3)) * 10.0
        sigma, at = np.full(3, 10.0), number * SECOND + SECOND // 2
        checks, nothing = [], Ledger()
        for row, name in enumerate(self.names):
            fix = Fix(at, 0, at, name, told[row], sigma, self.speed[row], 0.5, True)
            checks.append(Check(fix, (), frozenset(), nothing, nothing, ()))
        checks.sort(key=lambda check: check.order)
        spread, plots = np.array([15.0, 1e-3, 1e-3]), dict[Any, list[Any]]()
        for part in (-0.4, 0.0, 0.4):
            true = self.frame.from_enu(self.place + self.speed * (number + part))
            seen = polar_from_xyz(true) + np.array([150.0, 0.0087, 0.0035])
            seen += self.chance.standard_normal(seen.shape) * spread
            stamp = at + round(part * SECOND)
            for key, polar in zip(self.keys, seen.tolist(), strict=True):
                plots.setdefault(key, []).append(Plot(stamp, 0, stamp, 1, key[1], tuple(polar), tuple(spread.tolist())))
        tracks = RadarTracks({key: tuple(some) for key, some in plots.items()})
        return Association(Ledger({}, self.spans), tuple(checks)), tracks


def running() -> tuple[float, float]:
    """CPU share of a core, percent, of the whole running update; and ms a second of making its pairs."""
    from gateway.align import SECOND
    from gateway.register import Registration, gathered

    sky, state = Sky(), Registration()
    radars, frames = {1: sky.radar}, {1: sky.frame}
    state, _ = state.meeting(radars, "apply")
    made = spent = 0.0
    for number in range(SECONDS):
        association, tracks = sky.second(number)
        at = number * SECOND
        began = time.process_time()
        pairs = gathered(association, sky.spans, tracks, frames, at, at + SECOND)
        made += time.process_time() - began
        state, _ = state.second(pairs, radars, sky.site.position, "apply", at, 10 * SECOND)
        spent += time.process_time() - began
    return 100.0 * spent / SECONDS, 1e3 * made / SECONDS


if __name__ == "__main__":
    shares = [running() for _ in range(int(sys.argv[1]))]
    solutions = [solved_ms() for _ in range(int(sys.argv[1]))]
    print(json.dumps({"solved_ms": solutions, "share": [a for a, _ in shares], "made_ms": [b for _, b in shares]}))
