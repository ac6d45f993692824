"""The path from bytes to the picture alone, without files and sinks: rows a second, and its ratio to decoding alone.

python -m bench.throughput AIRCRAFT SECONDS RUNS        prints one JSON object
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from bench.measure import Figure, output

if TYPE_CHECKING:
    from adapters import Arrival, Source
    from gateway.settings import Site

_START_NS = 1_780_000_000 * 10**9
_STEP_NS = 1_000_000_000


def throughput(aircraft: int, seconds: float, runs: int) -> list[Figure]:
    """Rows for each second of CPU time, and the whole path's CPU time as a multiple of decoding's."""
    command = [sys.executable, "-m", "bench.throughput", str(aircraft), str(seconds), str(runs)]
    told = json.loads(output(command))
    who = f"{aircraft} aircraft, 2 radars"
    return [
        Figure(f"pipeline, {who}: rows a CPU s", "1/s", tuple(told["rows_per_s"])),
        Figure(f"pipeline, {who}: times real time", "", tuple(told["pace"])),
        Figure(f"pipeline, {who}: CPU / decoding", "", tuple(told["ratio"])),
    ]


def _recorded(aircraft: int, seconds: float, folder: Path) -> tuple[tuple[Source, ...], list[Arrival], Site]:
    from gateway.runtime.playback import open_playback
    from sim.recording import write_session
    from sim.scenes import build_scene

    changes = [f"aircraft={aircraft}", "radars=2", f"duration_s={seconds}"]
    scene = build_scene("traffic", start_ns=_START_NS, changes=changes)
    playback = open_playback([write_session(scene, folder)])
    return playback.sources, list(playback.arrivals()), scene.site


def _decode(sources: tuple[Source, ...], arrivals: list[Arrival]) -> float:
    from adapters.decode import Decoder

    began = time.process_time()
    decoder = Decoder(sources)
    for arrival in arrivals:
        decoder.feed(arrival)
    return time.process_time() - began


def _work(sources: tuple[Source, ...], arrivals: list[Arrival], site: Site) -> tuple[float, int]:
    from adapters.decode import Decoder
    from gateway.pipeline import initial, step
    from gateway.runtime.loop import steps

    began, rows = time.process_time(), 0
    decoder, state = Decoder(sources), initial(site)
    for some, watermark in steps(arrivals, arrivals[0].received_at, _STEP_NS):
        heard = [decoder.feed(arrival) for arrival in some]
        heard.append(decoder.watermark(watermark))
        state, picture = step(state, heard, decoder.health(watermark))
        rows += len(picture.fuse.time)
    return time.process_time() - began, rows


def main() -> None:
    """Measure in this process, turn by turn."""
    aircraft, seconds, runs = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
    with tempfile.TemporaryDirectory() as folder:
        sources, arrivals, site = _recorded(aircraft, seconds, Path(folder))
    told: dict[str, list[float]] = {"rows_per_s": [], "pace": [], "ratio": []}
    for _ in range(runs):
        decoding_s = _decode(sources, arrivals)
        whole_s, rows = _work(sources, arrivals, site)
        told["rows_per_s"].append(rows / whole_s)
        told["pace"].append(seconds / whole_s)
        told["ratio"].append(whole_s / decoding_s)
    print(json.dumps(told))


if __name__ == "__main__":
    main()
