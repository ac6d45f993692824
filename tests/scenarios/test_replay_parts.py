"""Parts of a recording: where it begins and ends, what is not listened to, what is told to it; and all of it again."""

import json
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from adapters.mavlink_frames import FrameEncoder, message_name, parse
from adapters.pcap import PcapReader, PcapWriter
from adapters.tlog import TlogReader
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.seeking import SECOND
from gateway.runtime.setup import Setup
from gateway.runtime.wholefile import WholeFile
from gateway.settings import Mute, Options

Talkdown = Callable[..., Any]
PLAN = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t31.0\t104.0\t535.0\t1
1\t0\t0\t16\t0\t0\t0\t0\t31.0\t103.9\t900\t1
2\t0\t0\t21\t0\t0\t0\t0\t31.0\t104.0\t535\t1
"""


def archived(talkdown: Talkdown, folder: Path, *arguments: object) -> Path:
    ended = talkdown("replay", *arguments, "--viewer", "none", "--archive", folder, "--json")
    assert ended.code == 0, ended.err
    return Path(ended.summary["archive"])


def table(session: Path, name: str = "tracks") -> bytes:
    return (session / f"{name}.parquet").read_bytes()


def times(session: Path) -> list[int]:
    """When the rows of the tracks hold, ns."""
    return list(pq.read_table(session / "tracks.parquet")["time"].cast("int64").to_pylist())


def start_of(session: Path) -> int:
    started: int = json.loads((session / "session.json").read_text())["started_at"]
    return started


def test_a_part_of_a_session_has_rows_of_that_part_only(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    """A report may hold up to 2 s before it was heard, a coasting row never comes first."""
    part = archived(talkdown, tmp_path, approach, "--from", "30", "--to", "1:00")
    start = start_of(approach)
    assert start + 28 * SECOND <= min(times(part)) <= start + 31 * SECOND
    assert start + 58 * SECOND <= max(times(part)) <= start + 60 * SECOND


def test_a_part_that_was_archived_gives_the_same_again(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    """With the beginning, the end and what was muted: the session holds all that its options need."""
    line = ("--from", "20", "--to", "70", "--mute", "gps:30:40", "--mute", "radar:1:50:60")
    once = archived(talkdown, tmp_path, approach, *line)
    again = archived(talkdown, tmp_path, once)
    for name in ("tracks", "predictions"):
        assert table(once, name) == table(again, name)
    first, second = (json.loads((one / "session.json").read_text()) for one in (once, again))
    assert first["options"] == second["options"]
    assert first["watermark"] == second["watermark"]


@pytest.mark.parametrize("step_ns", [0, 10**18])
def test_how_arrivals_fall_into_steps_changes_no_bit_of_a_part(approach: Path, tmp_path: Path, step_ns: int) -> None:
    playback = open_playback([approach])
    start = playback.started_at
    mutes = (Mute("gps", None, start + 40 * SECOND, start + 45 * SECOND),)
    options = Options(begins_at=start + 30 * SECOND + 4000, mutes=mutes)
    folders = []
    for step in (step_ns, 1_000_000_000):
        setup = Setup(place=playback.place, options=options, archive=tmp_path, is_watched=False)
        folders.append(run_replay(playback, setup, step_ns=step).archive)
    assert folders[0] is not None
    assert folders[1] is not None
    assert table(folders[0]) == table(folders[1])
    assert table(folders[0], "predictions") == table(folders[1], "predictions")


def test_muted_positions_leave_a_track_of_the_radar(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    """While the position source is muted nothing is updated by it, and its reports are counted."""
    part = archived(talkdown, tmp_path, approach, "--to", "55", "--mute", "gps:30:50")
    start = start_of(approach)
    rows = pq.read_table(part / "tracks.parquet", columns=["received", "updated_by"])
    stamps, by = rows["received"].cast("int64").to_pylist(), rows["updated_by"].to_pylist()
    meanwhile = [(stamp - start) / 1e9 for stamp, who in zip(stamps, by, strict=True) if who == "gps"]
    assert meanwhile
    assert not [second for second in meanwhile if 30.0 <= second < 50.0]
    assert any(who == "radar" and 30 < (stamp - start) / 1e9 < 50 for stamp, who in zip(stamps, by, strict=True))
    counters = json.loads((part / "session.json").read_text())["counters"]
    assert counters["GPS reports muted"] == pytest.approx(40, abs=1)  # one every half second


def test_a_muted_radar_leaves_the_other_alone(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    """The radar of this session is number 1: muting number 2 changes nothing."""
    muted_one = archived(talkdown, tmp_path / "a", approach, "--to", "45", "--mute", "radar:1:20:40")
    muted_other = archived(talkdown, tmp_path / "b", approach, "--to", "45", "--mute", "radar:2:20:40")
    untouched = archived(talkdown, tmp_path / "c", approach, "--to", "45")
    assert table(muted_other) == table(untouched)
    assert table(muted_one) != table(untouched)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (["--from", "500"], "--from 500 is outside: the recording goes from 2026-01-01T00:00:00Z for"),
        (["--to", "2027-01-01T00:00:00Z"], "is outside: the recording goes from"),
        (["--from", "30", "--to", "20"], "--to 20 is not after where the replay begins"),
        (["--from", "noon"], "'noon' is no time"),
        (["--mute", "gps:1"], None),
        (["--mute", "sonar"], "'sonar' is not understood"),
        (["--plan", "boat=x.plan"], "write mavlink:2=FILE"),
        (["--plan", "x.plan"], "replayed alone"),
    ],
)
def test_what_cannot_be_is_one_sentence(talkdown: Talkdown, approach: Path, line: list[str], says: str | None) -> None:
    ended = talkdown("replay", approach, *line, "--viewer", "none", "--quiet")
    if says is None:
        assert ended.code == 0
    else:
        assert ended.code == 2
        assert says in ended.sentence


def test_a_mission_file_is_the_plan_of_the_only_vehicle_also_when_replayed_again(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    flight = approach / "inputs" / "mavlink-1.tlog"
    mission = tmp_path / "circuit.plan"
    mission.write_text(PLAN)
    once = archived(talkdown, tmp_path / "s", flight, mission)
    told = (once / "inputs" / "commands.jsonl").read_text().splitlines()
    assert len(told) == 1
    assert json.loads(told[0])["aircraft"] == "mavlink:1"
    assert json.loads(told[0])["stamp"] == start_of(once)
    record = json.loads((once / "session.json").read_text())
    assert "the landing item of the mission" in record["site_origin"]
    again = archived(talkdown, tmp_path / "s", once)
    assert (again / "inputs" / "commands.jsonl").read_text().splitlines() == told
    assert table(once) == table(again)
    named = archived(talkdown, tmp_path / "s", flight, "--plan", f"mavlink:1={mission}")
    assert table(named) == table(once)


def test_whose_plan_it_is_has_to_be_said_where_there_are_several(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    mission = tmp_path / "circuit.waypoints"
    mission.write_text(PLAN)
    second = tmp_path / "other.tlog"
    second.write_bytes(_as_system_2((approach / "inputs" / "mavlink-1.tlog").read_bytes()))
    ended = talkdown("replay", approach / "inputs" / "mavlink-1.tlog", second, mission, "--viewer", "none")
    assert ended.code == 2
    assert "2 vehicles (mavlink:1, mavlink:2)" in ended.sentence
    assert "--plan mavlink:" in ended.sentence
    alone = talkdown("replay", mission, "--viewer", "none")
    assert alone.code == 2
    assert "along with a recording" in alone.sentence


def _as_system_2(tlog: bytes) -> bytes:
    """The heartbeats of a recording as those of another vehicle."""
    encoder, out = FrameEncoder(2), b""
    for stamp, frame in TlogReader(BytesIO(tlog)):
        parsed = parse(frame)
        assert parsed is not None
        if message_name(parsed.message) == "HEARTBEAT":
            values = {"type": 1, "autopilot": 3, "base_mode": 1, "custom_mode": 0, "system_status": 4}
            out += (stamp // 1000).to_bytes(8, "big") + encoder.encode("HEARTBEAT", **values, mavlink_version=3)
    return out


def test_files_that_never_meet_are_said_and_not_shifted(talkdown: Talkdown, approach: Path) -> None:
    """A radar's capture that was stamped an hour later than the flight: only that is said."""
    inputs = approach / "inputs"
    together = talkdown("replay", inputs / "mavlink-1.tlog", inputs / "radar-1.pcap", "--viewer", "none")
    assert "nothing is shifted" not in together.err
    later = inputs / "later.pcap"
    target = WholeFile(later)
    writer = PcapWriter(target)
    with (inputs / "radar-1.pcap").open("rb") as file:
        for captured in PcapReader(file):
            writer.write(captured.received_at + 3600 * SECOND, captured.data, captured.sender)
    target.close()
    apart = talkdown("replay", inputs / "mavlink-1.tlog", later, "--viewer", "none")
    later.unlink()
    assert "later.pcap begins 35" in apart.err
    assert "nothing is shifted" in apart.err
