"""mavlogdump.py (pymavlink) reads what we record. MAVProxy's replay and MAVExplorer read through the same reader."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from adapters import Arrival, Source
from adapters.mavlink_frames import message_name, parse
from gateway.runtime.folder import Record
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.recorder import Recorder
from gateway.runtime.setup import Setup
from gateway.settings import Options

Find = Callable[[str], list[str]]
START_NS = 1_767_225_600_000_000_000
EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"


def dumped(mavlogdump: list[str], path: Path) -> Counter[str]:
    """How many messages of each kind mavlogdump finds."""
    done = subprocess.run(
        [*mavlogdump, "--format", "json", "--show-source", str(path)],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env={"MAVLINK20": "1", "PATH": ""},
    )
    return Counter(json.loads(line)["meta"]["type"] for line in done.stdout.splitlines() if line.startswith("{"))


def ours(path: Path) -> Counter[str]:
    """How many messages of each kind the file holds."""
    found = [parse(frame) for frame in _records(path)]
    return Counter(message_name(frame.message) for frame in found if frame is not None)


def _records(path: Path) -> list[bytes]:
    """The frames of a file, by their lengths alone."""
    data, at, frames = path.read_bytes(), 0, []
    while at < len(data):
        version = data[at + 8]
        size = data[at + 9] + (12 + 13 * (data[at + 10] & 1) if version == 0xFD else 8)
        frames.append(data[at + 8 : at + 8 + size])
        at += 8 + size
    return frames


def test_mavlogdump_finds_every_message_of_a_simulated_session(program: Find, recorded: Path) -> None:
    (tlog,) = (recorded / "inputs").glob("*.tlog")
    found = dumped(program("mavlogdump.py"), tlog)
    assert found == ours(tlog)
    assert found["GLOBAL_POSITION_INT"] > 100


def test_mavlogdump_finds_every_message_that_a_session_kept_of_a_real_recording(program: Find, tmp_path: Path) -> None:
    summary = run_replay(open_playback([EXCERPT]), Setup(archive=tmp_path))
    assert summary.archive is not None
    kept = sorted((summary.archive / "inputs").glob("*.tlog"))
    found = sum((dumped(program("mavlogdump.py"), tlog) for tlog in kept), Counter[str]())
    assert found == sum((ours(tlog) for tlog in kept), Counter[str]())
    assert sum(found.values()) == sum(ours(EXCERPT).values())


def test_mavlogdump_finds_every_frame_that_was_refused(program: Find, recorded: Path, tmp_path: Path) -> None:
    (tlog,) = (recorded / "inputs").glob("*.tlog")
    frames = _records(tlog)[:300]
    (tmp_path / "inputs").mkdir()
    recorder = Recorder(tmp_path, Record("0", (), Options(), START_NS))
    recorder.add(Source(1, "mavlink", "mavlink-1", "a peer"))
    for number, frame in enumerate(frames):
        recorder.refuse(Arrival(START_NS + number * 4_000_000, 1, frame))
    recorder.flush(START_NS, {})
    recorder.close()
    (refused,) = (tmp_path / "inputs").glob("*.refused.tlog")
    assert _records(refused) == frames
    found = dumped(program("mavlogdump.py"), refused)
    assert found == ours(refused)
    assert sum(found.values()) == 300
