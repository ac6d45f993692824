"""What `talkdown check` counts, held against a count by hand of the same bytes; and what it makes of it."""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from adapters.landing_radar import Header, Plot, encode
from adapters.mavlink_frames import FrameEncoder, message_name
from adapters.pcap import PcapWriter
from adapters.tlog import TlogWriter
from gateway.runtime.findings import findings
from gateway.runtime.playback import open_playback
from gateway.runtime.survey import Survey, survey

EXCERPT = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"
RECORDINGS = Path(__file__).parents[4] / "shared" / "data"
SHARED = ("copter-lossy-radio", "sitl-adsb-traffic", "sub-five-components")
START = 1_790_000_000_000_000_000


def _by_hand(path: Path, *, without_outgoing: bool = False) -> Iterator[tuple[int, int, int, int, int]]:
    """Stamp in microseconds, system, component, message and sequence of every record of an undamaged .tlog."""
    data, at = path.read_bytes(), 0
    while at + 16 <= len(data):
        stamp, magic = int.from_bytes(data[at : at + 8], "big"), data[at + 8]
        frame = data[at + 8 : at + 300]
        if magic == 0xFD:
            size, head = (
                frame[1] + 12 + 13 * frame[2],
                (frame[5], frame[6], int.from_bytes(frame[7:10], "little"), frame[4]),
            )
        else:
            assert magic == 0xFE
            size, head = frame[1] + 8, (frame[3], frame[4], frame[5], frame[2])
        at += 8 + size
        if at <= len(data) and not (without_outgoing and stamp & 3 == 3):
            yield stamp & ~3, *head


def _surveyed(*paths: Path) -> Survey:
    return survey(open_playback(list(paths)))


@pytest.mark.parametrize(
    "path", [EXCERPT, *(RECORDINGS / f"{name}.tlog" for name in SHARED)], ids=lambda path: path.stem
)
def test_numbers_rates_and_silences_are_those_of_a_count_by_hand(path: Path) -> None:
    """Every kind of message of every component: how many, how often, and how long the longest silence was."""
    if not path.exists():
        pytest.skip("the recordings beside the project are not here")
    heard: dict[tuple[int, int, int], list[int]] = {}
    for stamp, system, component, message, _ in _by_hand(path, without_outgoing=path.stem == "copter-lossy-radio"):
        heard.setdefault((system, component, message), []).append(stamp)
    found = _surveyed(path)
    streams = {(c.system, c.component, m): s for c in found.components.values() for m, s in c.streams.items()}
    assert {key: stream.count for key, stream in streams.items()} == {key: len(stamps) for key, stamps in heard.items()}
    for key, stamps in heard.items():
        longest_s = max((b - a for a, b in pairwise(stamps)), default=0) / 1e6
        # stamps that repeat or fall back are made to increase, by 4 microseconds each: up to a few milliseconds in a burst
        assert streams[key].longest_gap_ns / 1e9 == pytest.approx(longest_s, abs=0.02), message_name(key[2])
        if len(stamps) > 10 and stamps[-1] - stamps[0] > 10**6:
            rate_hz = (len(stamps) - 1) / ((stamps[-1] - stamps[0]) / 1e6)
            assert streams[key].rate_hz == pytest.approx(rate_hz, rel=0.01), message_name(key[2])


def test_the_copter_s_losses_are_those_of_a_count_by_hand() -> None:
    path = RECORDINGS / "copter-lossy-radio.tlog"
    if not path.exists():
        pytest.skip("the recordings beside the project are not here")
    numbers = [
        s for _, system, component, _, s in _by_hand(path, without_outgoing=True) if (system, component) == (1, 1)
    ]
    steps = Counter((b - a) % 256 for a, b in pairwise(numbers))
    lost = sum((step - 1) * times for step, times in steps.items() if 1 < step < 200)
    assert _surveyed(path).components[0, 1, 1].counters["lost"] == pytest.approx(lost, abs=6)  # it reboots once


def _flight(folder: Path, *, utc: bool = True, gap_s: int = 0) -> Path:
    """Forty seconds of one vehicle at 5 positions a second, and a plot a second of one radar in a file beside it."""
    encoder, path = FrameEncoder(7), folder / "flight.tlog"
    with path.open("wb") as file:
        writer = TlogWriter(file)
        for tick in range(200):
            at, boot_ms = START + tick * 200_000_000, 5_000 + tick * 200
            if tick % 5 == 0:
                beat = {
                    "type": 1,
                    "autopilot": 3,
                    "base_mode": 0,
                    "custom_mode": 0,
                    "system_status": 4,
                    "mavlink_version": 3,
                }
                writer.write(at, encoder.encode("HEARTBEAT", **beat))
                unix_usec = at // 1000 if utc else 0
                writer.write(at + 4000, encoder.encode("SYSTEM_TIME", time_unix_usec=unix_usec, time_boot_ms=boot_ms))
            if not 100 <= tick < 100 + 5 * gap_s:
                place = {"lat": 310_000_000 + tick, "lon": 1_040_000_000, "alt": 500_000, "relative_alt": 0}
                speed = {"vx": 0, "vy": 0, "vz": 0, "hdg": 0}
                frame = encoder.encode("GLOBAL_POSITION_INT", time_boot_ms=boot_ms, **place, **speed)
                writer.write(at + 8000, frame)
    with (folder / "radar.pcap").open("wb") as file:
        pcap = PcapWriter(file)
        for second in range(40):
            at = START + second * 1_000_000_000
            plot = Plot(3, at, 8000.0 - second, 0.5, 3.0 if second % 2 else None)
            pcap.write(at, encode(Header("plots", 2, second, at), [plot]), "127.0.0.1:30070")
    return path


def _said(found: Survey) -> str:
    return "\n".join(f"{finding.kind}: {finding.text}" for finding in findings(found))


def test_a_flight_with_a_radar_is_told_as_what_it_is(tmp_path: Path) -> None:
    """What can be used, what is missing and what is wrong, each in one sentence with its number."""
    said = _said(_surveyed(_flight(tmp_path, gap_s=8), tmp_path / "radar.pcap"))
    assert "good: mavlink:7: 160 positions" in said
    assert "wrong: mavlink:7 tells no position for 8.2 s from second 20" in said
    assert "good: radar 2: 40 plots, 20 of them partial of 1 tracks, 1.0/s." in said
    assert "missing: radar 2 never says where it stands" in said
    assert "missing: mavlink:7: no position says how accurate it is" in said
    assert "missing: mavlink:7 tells no attitude" in said
    assert "lost by sequence" not in said
    assert "never tells UTC" not in said


def test_a_flight_without_utc_is_told_so(tmp_path: Path) -> None:
    said = _said(_surveyed(_flight(tmp_path, utc=False)))
    assert "never tells UTC" in said
    assert "No landing radar" in said


def test_frames_that_are_gone_are_told_as_lost(tmp_path: Path) -> None:
    """One record in ten cut out of the middle of the file: a tenth of the frames is lost, and the sentence says so."""
    path = _flight(tmp_path)
    records, data, at = [], path.read_bytes(), 0
    while at < len(data):
        end = at + 20 + data[at + 9]
        records.append(data[at:end])
        at = end
    kept = [record for place, record in enumerate(records) if place % 10 != 5]
    path.write_bytes(b"".join(kept))
    found = _surveyed(path)
    lost = len(records) - len(kept)
    assert found.components[0, 7, 1].counters["lost"] == lost
    assert f"wrong: 7/1: {lost} frames lost by sequence (10.0%)" in _said(found)
