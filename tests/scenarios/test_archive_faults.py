"""Archives that cannot be written, at the start or while a session runs."""

import os
import resource
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from adapters.files import open_recording

Talkdown = Callable[..., Any]
LIMIT_BYTES = 300_000


def test_each_run_archives_into_a_new_folder_beside_the_others(
    talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    for _ in range(2):
        assert talkdown("replay", approach, "--viewer", "none", "--archive", tmp_path, "--quiet").code == 0
    assert len(list(tmp_path.iterdir())) == 2


def test_a_session_is_not_archived_into_a_session(talkdown: Talkdown, approach: Path) -> None:
    before = sorted(approach.rglob("*"))
    ended = talkdown("replay", approach, "--viewer", "none", "--archive", approach)
    assert ended.code == 2
    assert "is a session already" in ended.sentence
    assert sorted(approach.rglob("*")) == before


def test_a_file_in_place_of_the_archive_is_refused(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine")
    ended = talkdown("replay", approach, "--viewer", "none", "--archive", tmp_path / "taken")
    assert ended.code == 2
    assert "is a file" in ended.sentence
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="the administrator may write everywhere")
def test_an_archive_that_may_not_be_written_is_refused(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    ended = talkdown("replay", approach, "--viewer", "none", "--archive", tmp_path)
    tmp_path.chmod(0o700)
    assert ended.code == 2
    assert "cannot be written to" in ended.sentence


def test_an_archive_on_a_device_that_takes_nothing_is_refused(talkdown: Talkdown, approach: Path) -> None:
    ended = talkdown("replay", approach, "--viewer", "none", "--archive", "/proc/no/sessions")
    assert ended.code == 2
    assert "choose another folder for --archive" in ended.sentence


def test_a_disk_that_fills_ends_the_session_and_leaves_whole_records(
    start: Callable[..., Any], talkdown: Talkdown, approach: Path, tmp_path: Path
) -> None:
    """No file may grow beyond 300 kB here, as on a disk that is full in the middle of a session."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES))

    process = start("replay", approach, "--viewer", "none", "--archive", tmp_path, "--quiet", preexec_fn=limited)
    _, err = process.communicate(timeout=40)
    assert process.returncode == 1
    assert "Traceback" not in err
    assert "could not be written" in err.strip().splitlines()[-1]
    (folder,) = tmp_path.iterdir()
    recorded = open_recording(folder / "inputs" / "mavlink-1.tlog")
    original = open_recording(approach / "inputs" / "mavlink-1.tlog")
    kept = [arrival.data for arrival in recorded.arrivals()]
    assert kept == [arrival.data for arrival, _ in zip(original.arrivals(), kept, strict=False)]
    assert not recorded.counters["cut at the end"]
    (listed,) = talkdown("sessions", tmp_path, "--json").summary
    assert listed["ended"].startswith("failed")
    assert (folder / "tracks.parquet").exists()
    assert not list(folder.glob("*.arrows"))


def test_the_wrong_order_of_files_and_folders_is_refused(talkdown: Talkdown, approach: Path, tmp_path: Path) -> None:
    shutil.copy(approach / "inputs" / "mavlink-1.tlog", tmp_path / "more.tlog")
    ended = talkdown("replay", approach, tmp_path / "more.tlog", "--viewer", "none")
    assert ended.code == 2
    assert "A session is replayed alone" in ended.sentence
