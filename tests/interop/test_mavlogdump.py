"""mavlogdump.py (pymavlink) reads what we record. MAVProxy's replay and MAVExplorer read through the same reader."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from adapters.mavlink_frames import message_name, parse
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Setup

Find = Callable[[str], list[str]]
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
    """How many messages of each kind the file holds, by the lengths of its frames."""
    data, at, names = path.read_bytes(), 0, Counter[str]()
    while at < len(data):
        version = data[at + 8]
        size = data[at + 9] + (12 + 13 * (data[at + 10] & 1) if version == 0xFD else 8)
        frame = parse(data[at + 8 : at + 8 + size])
        assert frame is not None
        names[message_name(frame.message)] += 1
        at += 8 + size
    return names


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
