"""How often a target that a radar numbers anew keeps its track, and how often another one gets it.

    python docs/decisions/renumbering.py [RUNS]

One radar (15 m, 1 mrad, a plot each 0.4 s), targets of 80 m/s at 18 km. A target is seen for 30 s, then not at all for a
while, then under another number: straight on; turning all the while; or, then, it is another one beside where the first
would be, with the same course, or crossing.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gateway import pipeline
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.observation import Heard, RadarPlot
from gateway.settings import DEMO_SITE

SECOND = 1_000_000_000
START = 1_790_000_000 * SECOND
SEEN_S, SCAN_S, SPEED_MPS = 30.0, 0.4, 80.0
GAPS_S = (0.4, 2.0, 5.0, 10.0, 20.0)

Floats = NDArray[np.float64]
Path = Callable[[float], Floats]

_FRAME = RunwayFrame(DEMO_SITE.runway)
_RADAR = RadarFrame.of(DEMO_SITE.radars[0], _FRAME)


def straight(time_s: float) -> Floats:
    """In the runway frame, m."""
    return np.array([-20_000.0 + SPEED_MPS * time_s, 300.0, 1300.0 - 3.0 * time_s])


def turning(degrees_per_s: float) -> Path:
    """The same, in a turn from when it is not seen any more."""
    rate = math.radians(degrees_per_s)

    def path(time_s: float) -> Floats:
        turned = rate * max(time_s - SEEN_S, 0.0)
        there = straight(min(time_s, SEEN_S))
        return np.asarray(there + SPEED_MPS / rate * np.array([math.sin(turned), 1.0 - math.cos(turned), 0.0]))

    return path


def beside(off_m: float) -> Path:
    """Another one, on the same course, aside."""
    return lambda time_s: np.add(straight(time_s), [0.0, off_m, 0.0])


def crossing(gap_s: float) -> Path:
    """Another one, at right angles, that is just where the first would be when it is first seen."""
    at_s = SEEN_S + gap_s
    return lambda time_s: np.add(straight(at_s), [0.0, SPEED_MPS * (time_s - at_s), 0.0])


def keeps(then: Path, gap_s: float, seed: int) -> bool:
    """Whether what is seen after the gap has the track of what was seen before it."""
    random = np.random.default_rng(seed)
    heard = []
    for scan in range(math.ceil((SEEN_S + gap_s + 10.0) / SCAN_S)):
        time_s = scan * SCAN_S
        if SEEN_S < time_s < SEEN_S + gap_s - 0.01:
            continue
        number, path = (3, straight) if time_s <= SEEN_S else (7, then)
        polar = polar_from_xyz(_RADAR.from_enu(_FRAME.enu_from_runway @ path(time_s)))
        distance, azimuth, elevation = (polar + random.normal(0.0, [15.0, 1e-3, 1e-3])).tolist()
        at = START + round(time_s * SECOND)
        heard.append(Heard(at + 20_000_000, (RadarPlot(1, number, at, at + 20_000_000, distance, azimuth, elevation),)))
    _, picture = pipeline.step(pipeline.initial(DEMO_SITE), heard)
    rows = zip(picture.fuse.radar_track, picture.fuse.track.tolist(), strict=True)
    return {track for name, track in rows if name == "1/7"} == {1}


def main() -> None:
    """Print the table."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    cases: dict[str, Callable[[float], Path]] = {
        "straight on": lambda gap_s: straight,
        "turns at 1 degree/s": lambda gap_s: turning(1.0),
        "turns at 3 degrees/s": lambda gap_s: turning(3.0),
        "another, 100 m aside": lambda gap_s: beside(100.0),
        "another, 300 m aside": lambda gap_s: beside(300.0),
        "another, 1000 m aside": lambda gap_s: beside(1000.0),
        "another, crossing": crossing,
    }
    print(f"{runs} runs; gap of".ljust(26) + "".join(f"{gap_s:8.1f} s" for gap_s in GAPS_S))
    for name, path in cases.items():
        shares = [sum(keeps(path(gap_s), gap_s, seed) for seed in range(runs)) / runs for gap_s in GAPS_S]
        print(name.ljust(26) + "".join(f"{100.0 * share:8.0f} %" for share in shares), flush=True)


if __name__ == "__main__":
    main()
