"""What it costs to put one report that came 2 s late back in its place: in its own track, or by doing everything again.

    python docs/decisions/history.py

The first is what the gateway does. The second keeps every former state (they are immutable, so that is free), goes back to
the one before the report, and steps through everything that was heard since.
"""

from __future__ import annotations

import time
from dataclasses import replace
from statistics import median
from typing import Literal

from adapters import Arrival, Source
from adapters.decode import Decoder
from gateway.observation import GpsReport, Heard
from gateway.pipeline import initial, step
from gateway.state import State
from sim.events import events
from sim.scenes import build_scene

SECOND = 1_000_000_000
WARM_S, LATE_S, TRIES = 60.0, 2.0, 9


def heard_of(aircraft: int) -> tuple[State, list[Heard]]:
    """The first state, and what the gateway hears of a traffic scene in its first minutes."""
    scene = build_scene("traffic", start_ns=1_790_000_000 * SECOND, changes=[f"aircraft={aircraft}", "radars=2"])
    decoder, numbers, heard = Decoder(), dict[str, int](), []
    for sent in events(scene):
        if sent.at - scene.start_ns > (WARM_S + LATE_S + 20.0) * SECOND:
            break
        if sent.link not in numbers:
            numbers[sent.link] = len(numbers)
            kind: Literal["mavlink", "radar"] = "radar" if sent.link.startswith("radar") else "mavlink"
            decoder.add(Source(numbers[sent.link], kind, sent.link, "scene"))
        heard.append(decoder.feed(Arrival(sent.at, numbers[sent.link], sent.data)))
    return initial(scene.site), heard


def measure(aircraft: int) -> tuple[float, float]:
    """Median milliseconds for one late report: in its track, and by doing everything again."""
    state, heard = heard_of(aircraft)
    begin = heard[0].now
    reports = [i for i, one in enumerate(heard) if isinstance(next(iter(one.observations), None), GpsReport)]
    late = [i for i in reports if heard[i].now - begin > WARM_S * SECOND][:TRIES]
    here, own, again = 0, [], []
    for place in late:
        if place > here:
            state, _ = step(state, heard[here:place])
            here = place
        until = next(i for i in range(place, len(heard)) if heard[i].now - heard[place].now > LATE_S * SECOND)
        without, _ = step(state, heard[place + 1 : until])
        began = time.perf_counter()
        step(without, [replace(heard[place], now=heard[until - 1].now)])
        own.append(1e3 * (time.perf_counter() - began))
        began = time.perf_counter()
        step(state, heard[place:until])
        again.append(1e3 * (time.perf_counter() - began))
    return median(own), median(again)


if __name__ == "__main__":
    print(f"{'aircraft':>8}{'its own track, ms':>20}{'everything again, ms':>24}")
    for number in (1, 5, 15, 30):
        own_ms, again_ms = measure(number)
        print(f"{number:>8}{own_ms:>20.2f}{again_ms:>24.2f}", flush=True)
