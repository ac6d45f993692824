"""A live session into which more comes than the kernel can hold: what is recorded and what is counted is what was sent."""

import socket
import sys
import time
from pathlib import Path

import pytest

from adapters.mavlink_frames import encode
from adapters.tlog import TlogReader
from gateway.runtime.loop import run_live
from gateway.runtime.setup import Place, Setup
from gateway.runtime.udp import UdpLink
from gateway.runtime.urls import Url
from gateway.settings import DEMO_SITE, format_site

HEARTBEAT = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
BURST, BURSTS = 3000, 4


@pytest.mark.skipif(sys.platform != "linux", reason="Only Linux tells how many datagrams its kernel dropped.")
def test_sent_is_recorded_and_decoded_plus_what_the_kernel_dropped_and_we_counted(tmp_path: Path) -> None:
    """Bursts into a small receive buffer, the last one with nothing after it that could tell of its drops."""
    link = UdpLink(Url("udpin", "127.0.0.1", 0), 8192)
    setup = Setup(place=Place(DEMO_SITE, format_site(DEMO_SITE), "test"), archive=tmp_path, live=True)
    bursts, ended = iter(range(BURSTS)), 0.0

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:

        def burst_or_stop() -> str | None:
            nonlocal ended
            burst = next(bursts, None)
            if burst is None:
                return "the test" if time.monotonic() > ended else None
            for number in range(BURST):
                frame = encode("HEARTBEAT", HEARTBEAT, system=burst + 1, sequence=number & 255)
                sender.sendto(frame, ("127.0.0.1", link.url.port))
            ended = time.monotonic() + 0.2
            return None

        summary = run_live([link], [], setup, asked_to_stop=burst_or_stop)

    assert summary.archive is not None
    (recording,) = summary.archive.glob("inputs/*.tlog")
    with recording.open("rb") as file:
        recorded = sum(1 for _ in TlogReader(file))
    dropped = summary.counters[f"{link.url} dropped by the kernel"]
    assert dropped > 0
    assert recorded + dropped == BURST * BURSTS
    assert summary.counters["mavlink-1 frames"] == recorded
