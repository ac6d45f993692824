"""What dead reckoning costs while it runs: one vehicle with an inertial unit at 50 Hz, and a hundred, in CPU of one thread.

python -m bench.reckoning ROUNDS        prints, as JSON, per cent of a core that each takes

Of the same minute of the same arrivals, with dead reckoning and without; these take turns. A hundred have positions twice a
second.
"""

from __future__ import annotations

import json
import math
import sys
import time
from typing import Any

from bench.measure import Figure, alone

VEHICLES = (1, 100)
ONE_PERCENT = 3.0
LENGTH_S = {1: 60.0, 100: 20.0}


def reckoning(rounds: int) -> list[Figure]:
    """Dead reckoning of one vehicle, and of a hundred."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.reckoning", str(rounds)]))
    targets = {"1": ONE_PERCENT, "100": None}
    return [
        Figure(f"dead reckoning, {vehicles} at 50 Hz", "% of a core", tuple(samples), targets[vehicles])
        for vehicles, samples in told.items()
    ]


def measured_percent(rounds: int) -> dict[str, list[float]]:
    """By how many vehicles: CPU with dead reckoning less that without, per cent of the time that was flown."""
    import numpy as np

    from gateway.pipeline import initial, step
    from gateway.settings import Options, Runway, Site
    from sim.inertial import aeroplane
    from sim.told_rides import Teller, heard

    start = 1_700_000_000_000_000_000
    site = Site("here", Runway(math.radians(47.4), math.radians(8.5), 500.0, 0.0, geoid_separation_m=0.0))
    found: dict[str, list[float]] = {}
    for vehicles in VEHICLES:
        length_s, tellers = LENGTH_S[vehicles], []
        for number in range(vehicles):
            generator = np.random.default_rng(number)
            ride = aeroplane(generator, length_s)
            tellers.append(Teller.of(f"mavlink:{number + 1}", 1, ride, generator))
        said = list(heard(tellers, start, 5))
        samples = found[str(vehicles)] = []
        for _ in range(rounds):
            costs = {}
            for choice in ("on", "off"):
                state = initial(site, Options(dead_reckoning=choice))
                began = time.process_time()
                for place in range(0, len(said), 10):
                    state, _picture = step(state, said[place : place + 10])
                costs[choice] = time.process_time() - began
            samples.append(100.0 * (costs["on"] - costs["off"]) / length_s)
    return found


if __name__ == "__main__":
    print(json.dumps(measured_percent(int(sys.argv[1]))))
