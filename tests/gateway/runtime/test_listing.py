"""The sessions of a folder: what a list says of each, what is wrong with them, and how they are mended and removed."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from gateway.runtime.folder import FolderError, Record, read_record, write_record
from gateway.runtime.listing import Listed, listed, look
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.pruning import is_older, remove
from gateway.runtime.repairing import repair
from gateway.runtime.setup import Setup
from gateway.settings import Options
from gateway.sinks.hold import Hold
from gateway.sinks.recording import compact, has_index
from sim.recording import write_session
from sim.scenes import build_scene

DAY = 86_400 * 10**9
BEGAN = 1_767_225_600 * 10**9
PLAIN = Record("0.1.0", ("live",), Options(), BEGAN, ended="done", watermark=BEGAN + 60 * 10**9)


@pytest.fixture(scope="module")
def replayed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with everything that there can be: twenty seconds of an approach, replayed."""
    archive = tmp_path_factory.mktemp("archive")
    scene = build_scene("approach", start_ns=BEGAN, changes=("duration_s=20",))
    playback = open_playback([write_session(scene, archive / "simulated")])
    setup = Setup(place=playback.place, archive=archive / "replayed", is_watched=False)
    summary = run_replay(playback, setup)
    assert summary.archive is not None
    return summary.archive


@pytest.fixture
def session(replayed: Path, tmp_path: Path) -> Path:
    """A copy of it, to be spoiled."""
    return Path(shutil.copytree(replayed, tmp_path / replayed.name))


def _written(folder: Path, record: Record) -> Path:
    folder.mkdir(parents=True)
    write_record(folder, record)
    return folder


def test_a_list_says_where_who_how_long_how_large_and_how_it_ended(session: Path) -> None:
    one = look(session)
    assert (one.site, one.vehicles, one.ended, one.faults) == ("Demo field", ("mavlink:1",), "done", ())
    assert one.length_s == pytest.approx(20.0, abs=1.0)
    assert one.size_bytes == sum(path.stat().st_size for path in session.rglob("*") if path.is_file())


def test_of_a_session_that_was_never_summed_up_the_tracks_tell_who_flew(session: Path) -> None:
    """Not the link that they were heard over."""
    write_record(session, replace(read_record(session), ended="killed", summary={}))
    assert look(session).vehicles == ("mavlink:1",)
    (session / "tracks.parquet").unlink()
    sources = tuple(source.name for source in read_record(session).sources if source.kind == "mavlink")
    assert look(session).vehicles == sources != ("mavlink:1",)


def test_what_is_no_session_is_passed_over_and_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    _written(tmp_path / "good", PLAIN)
    (tmp_path / "photos").mkdir()
    (tmp_path / "notes.txt").write_text("mine")
    (_written(tmp_path / "spoiled", PLAIN) / "session.json").write_text("{")
    good, spoiled = listed(tmp_path)
    assert (good.folder.name, good.ended) == ("good", "done")
    assert (spoiled.folder.name, spoiled.ended) == ("spoiled", "unreadable")
    assert "cannot be read" in spoiled.faults[0].what


def test_a_folder_that_may_not_be_looked_into_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed = _written(tmp_path / "closed", PLAIN)
    for name in ("is_file", "read_text", "stat"):
        may = getattr(Path, name)

        def looks(path: Path, *given: Any, may: Any = may, **named: Any) -> Any:
            if path.parent == closed:
                raise PermissionError(13, "Permission denied", str(path))
            return may(path, *given, **named)

        monkeypatch.setattr(Path, name, looks)
    (one,) = listed(tmp_path)
    assert one.ended == "unreadable"
    assert "Permission denied" in one.faults[0].what


def test_files_that_are_missing_or_cut_are_named_and_made_again_as_they_were(session: Path) -> None:
    """The tables of the same rows; what was left by a program that died goes."""
    tracks = pq.read_table(session / "tracks.parquet")
    os.truncate(session / "tracks.parquet", 500)
    (session / "session.rrd").unlink()
    (session / "session.rrd.part").touch()
    broken = look(session)
    assert sorted(fault.file for fault in broken.faults) == ["session.rrd", "session.rrd.part", "tracks.parquet"]
    mended = repair(broken)
    assert mended.faults == ()
    assert mended.mended == "session.rrd.part removed, session.rrd, tracks.parquet made again from the inputs"
    assert pq.read_table(session / "tracks.parquet").equals(tracks)
    assert (session / "session.rrd").stat().st_size > 100_000


def test_what_nothing_can_make_again_stays_named(session: Path) -> None:
    (session / "inputs" / "radar-1.pcap").unlink()
    left = repair(look(session))
    assert [fault.what for fault in left.faults] == ["inputs/radar-1.pcap is missing"]


def test_a_cut_session_json_is_written_anew_from_what_is_whole_of_it_and_from_the_inputs(session: Path) -> None:
    before = read_record(session)
    path = session / "session.json"
    path.write_text(path.read_text()[: path.read_text().index('"counters"')])
    mended = repair(look(session))
    assert mended.record is not None
    after = mended.record
    assert (after.site, after.options, after.command) == (before.site, before.options, before.command)
    assert [(one.name, one.arrivals) for one in after.sources] == [(one.name, one.arrivals) for one in before.sources]
    assert path.with_name("session.json.broken").exists()


def test_what_is_old_has_both_ended_and_been_written_long_ago(tmp_path: Path) -> None:
    """A recording of years ago that was replayed just now is not old, nor is what runs or cannot be read."""
    one = Listed(tmp_path, PLAIN, BEGAN + 2 * DAY, 0)
    assert is_older(one, BEGAN + 3 * DAY)
    assert not is_older(one, BEGAN + DAY)
    assert not is_older(replace(one, written_at=BEGAN + 9 * DAY), BEGAN + 3 * DAY)
    assert not is_older(replace(one, record=replace(PLAIN, ended=None)), BEGAN + 3 * DAY)
    assert not is_older(replace(one, record=None), BEGAN + 3 * DAY)


def test_a_session_that_somebody_works_on_or_that_is_elsewhere_is_not_removed(tmp_path: Path) -> None:
    held, elsewhere = _written(tmp_path / "held", PLAIN), _written(tmp_path / "else" / "where", PLAIN)
    (tmp_path / "link").symlink_to(elsewhere)
    hold = Hold(held)
    with pytest.raises(FolderError, match="is still being written"):
        remove(held)
    with pytest.raises(FolderError, match="is a link"):
        remove(tmp_path / "link")
    hold.release()
    remove(held)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["else", "link"]
    assert (elsewhere / "session.json").exists()


def test_a_recording_that_was_cut_is_compacted_and_a_compact_one_is_left(session: Path) -> None:
    path = session / "session.rrd"
    assert compact(path) is None
    os.truncate(path, path.stat().st_size * 9 // 10)
    assert not has_index(path)
    assert compact(path)
    assert has_index(path)
    path.write_bytes(b"RRF2" + bytes(500))
    assert compact(path) is False
    assert path.read_bytes() == b"RRF2" + bytes(500)
