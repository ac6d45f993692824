"""Recordings that cannot be replayed, or not all of them."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from adapters.files import open_recording
from adapters.pcap import PcapWriter
from gateway.runtime.wholefile import WholeFile

PLOTS = 1  # the kind of a landing-radar datagram, its fourth byte
Talkdown = Callable[..., Any]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"time,latitude,longitude\n1,2,3\n4,5,6\n", "text file"),
        (bytes(range(256)) * 40, "not a recording"),
        (b"\x89PNG\r\n\x1a\n" + bytes(500), "a picture"),
    ],
)
def test_a_file_that_is_no_recording_is_refused_in_one_sentence(
    talkdown: Talkdown, tmp_path: Path, content: bytes, says: str
) -> None:
    (tmp_path / "flight.tlog").write_bytes(content)
    ended = talkdown("replay", tmp_path / "flight.tlog", "--viewer", "none")
    assert ended.code == 2
    assert says in ended.sentence


def test_a_recording_that_does_not_exist_is_refused_in_one_sentence(talkdown: Talkdown, tmp_path: Path) -> None:
    ended = talkdown("replay", tmp_path / "no.tlog", "--viewer", "none")
    assert ended.code == 2
    assert "cannot be read" in ended.sentence


def test_a_recording_that_was_cut_is_replayed_as_far_as_it_goes(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    whole = (approach / "inputs" / "mavlink-1.tlog").read_bytes()
    (tmp_path / "cut.tlog").write_bytes(whole[: len(whole) * 9 // 10 + 3])
    ended = talkdown("replay", tmp_path / "cut.tlog", "--viewer", "none", "--json")
    assert ended.code == 0
    assert ended.summary["observations"]["GPS reports"] > 20
    assert any("cut at the end" in reason for reason in ended.summary["counters"])


def test_without_a_radar_the_track_is_that_of_the_position_source(talkdown: Talkdown, approach: Path) -> None:
    ended = talkdown("replay", approach / "inputs" / "mavlink-1.tlog", "--viewer", "none", "--json")
    assert ended.code == 0
    assert ended.summary["tracks"] == 1
    assert "gps only" in ended.summary["accuracy"]
    assert "fused" not in ended.summary["accuracy"]
    assert "radar plots" not in ended.summary["observations"]


def test_plots_of_a_radar_that_nobody_knows_are_counted_and_not_used(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    """A radar that is not in the site file and sends no status cannot be placed; the aircraft is tracked without it."""
    target = WholeFile(tmp_path / "radar.pcap")
    writer = PcapWriter(target)
    for arrival in open_recording(approach / "inputs" / "radar-1.pcap").arrivals():
        if arrival.data[3] == PLOTS:
            writer.write(arrival.received_at, arrival.data)
    target.close()
    flight = approach / "inputs" / "mavlink-1.tlog"
    ended = talkdown("replay", flight, tmp_path / "radar.pcap", "--viewer", "none", "--json")
    assert ended.code == 0
    assert ended.summary["counters"]["plots of an unknown radar"] > 50
    assert ended.summary["tracks"] == 1
    assert "is not in the site file" in ended.err


def test_a_session_without_one_of_its_inputs_is_refused_in_one_sentence(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    shutil.copytree(approach, tmp_path / "session")
    (tmp_path / "session" / "inputs" / "radar-1.pcap").unlink()
    ended = talkdown("replay", tmp_path / "session", "--viewer", "none")
    assert ended.code == 2
    assert "radar-1.pcap is missing" in ended.sentence


def test_a_folder_that_is_no_session_is_refused_in_one_sentence(talkdown: Talkdown, tmp_path: Path) -> None:
    ended = talkdown("replay", tmp_path, "--viewer", "none")
    assert ended.code == 2
    assert "session.json" in ended.sentence


@pytest.mark.parametrize(
    ("site", "says"),
    [
        ("[runway\n", "not TOML"),
        ("[runway]\nlatitude = 3\n", "latitude_deg here"),
        ("[runway]\nlatitude_deg = 91\n", "line 2: latitude_deg must be between"),
        ("[runway]\nlatitude_deg = 1\n", "lacks longitude_deg"),
    ],
)
def test_a_wrong_site_file_is_refused_with_what_is_wrong(
    talkdown: Talkdown, approach: Path, tmp_path: Path, site: str, says: str
) -> None:
    (tmp_path / "field.toml").write_text(site)
    ended = talkdown("replay", approach, "--site", tmp_path / "field.toml", "--viewer", "none")
    assert ended.code == 2
    assert says in ended.sentence
