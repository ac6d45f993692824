"""Wireshark (its tshark) reads the captures that we record."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path

from sim.events import events
from sim.scenes import build_scene

Find = Callable[[str], list[str]]
START_NS = 1_767_225_600_000_000_000


def test_tshark_finds_every_radar_datagram_with_its_time_and_its_bytes(program: Find, recorded: Path) -> None:
    (capture,) = (recorded / "inputs").glob("*.pcap")
    fields = [part for name in ("frame.time_epoch", "udp.payload", "udp.dstport") for part in ("-e", name)]
    done = subprocess.run(
        [*program("tshark"), "-r", str(capture), "-T", "fields", *fields],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    scene = build_scene("approach", start_ns=START_NS, seed=3, changes=["duration_s=80", "gps.period_s=0.5"])
    sent = [(event.at, event.data.hex()) for event in events(scene) if event.link.startswith("radar")]
    assert len(sent) > 100
    assert [payload for _, payload, _ in rows] == [data for _, data in sent]
    assert [round(float(f"0.{time.partition('.')[2]}") * 1e6) for time, _, _ in rows] == [
        at // 1000 % 1_000_000 for at, _ in sent
    ]
    assert {port for _, _, port in rows} == {"30070"}
