"""A scene written to files instead of the network: a session folder that `talkdown replay` reads, with its truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from adapters import Arrival, Source
from adapters.pcap import PcapWriter
from gateway import __version__
from gateway.runtime.folder import Record, make_folder, session_name
from gateway.runtime.recorder import Recorder
from gateway.runtime.wholefile import WholeFile
from gateway.settings import Options, format_site
from gateway.sinks.batches import TRUTH, truth_batch
from sim.events import events, truth
from sim.scene import Scene

_TOLD_EVERY_NS = 5_000_000_000


def write_session(
    scene: Scene,
    parent: Path,
    *,
    command: tuple[str, ...] = (),
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write everything that a scene says into a new session folder inside `parent`; the folder.

    inputs/mavlink-N.tlog for each aircraft, inputs/radar-N.pcap for each radar, the site in session.json,
    truth.parquet. Raises FolderError when the folder cannot be made, OSError when the disk refuses.
    """
    folder = make_folder(parent, session_name(scene.start_ns, scene.name))
    record = Record(
        __version__,
        command,
        Options(),
        scene.start_ns,
        format_site(scene.stated_site),
        f"scene {scene.name}",
        ended="done",
    )
    recorder = Recorder(folder, record)
    numbers = {name: number for number, name in enumerate(scene.links, 1)}
    for name, number in numbers.items():
        kind, _, which = name.partition(":")
        origin = f"scene {scene.name}"
        recorder.add(Source(number, "radar" if kind == "radar" else "mavlink", f"{kind}-{which}", origin))
    last = told = scene.start_ns
    for event in events(scene):
        recorder.keep(Arrival(event.at, numbers[event.link], event.data))
        last = event.at
        if progress is not None and last - told >= _TOLD_EVERY_NS:
            told = last
            progress((last - scene.start_ns) / 1e9)
    write_truth(scene, folder / "truth.parquet")
    recorder.close()
    recorder.flush(last, {})
    return folder


def write_truth(scene: Scene, path: Path) -> None:
    """truth.parquet of a scene: where every aircraft was, four times a second, and its motion mode."""
    rows = sorted(truth(scene), key=lambda row: row.valid_at)
    batch = truth_batch(rows, scene.geoid_separation_m)
    pq.write_table(pa.Table.from_batches([batch], TRUTH), path, compression="zstd")


def write_datagrams(datagrams: Iterable[tuple[int, bytes]], path: Path) -> int:
    """A .pcap of radar datagrams (stamp ns UTC, bytes), such as those of a watching radar; how many. Raises OSError."""
    whole = WholeFile(path)
    count = 0
    try:
        writer = PcapWriter(whole)
        for at, data in datagrams:
            writer.write(at, data)
            count += 1
    finally:
        whole.close()
    return count
