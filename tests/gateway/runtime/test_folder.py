"""Session folders and session.json."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.runtime import sessions
from gateway.runtime.folder import (
    FolderError,
    InputFile,
    Record,
    make_folder,
    read_record,
    session_name,
    write_record,
)
from gateway.settings import Options
from gateway.sinks.hold import Hold, is_held

RECORD = Record(
    version="0.1.0",
    command=("live", "--mavlink", "udpin:0.0.0.0:14550"),
    options=Options(weighting="literal", horizons_s=(5.0,)),
    started_at=1_767_225_600_000_004_000,
    site="[runway]\n",
    sources=(InputFile(0, "mavlink", "mavlink-1", "udpin from 1.2.3.4:5", "inputs/mavlink-1.tlog", 17, 0),),
    counters={"mavlink-1 frames": 17},
    watermark=1_767_225_601_000_000_000,
    ended="done",
)


def test_what_session_json_says_is_read_back_equal(tmp_path: Path) -> None:
    write_record(tmp_path, RECORD)
    assert read_record(tmp_path) == RECORD


def test_session_json_is_replaced_whole(tmp_path: Path) -> None:
    write_record(tmp_path, replace(RECORD, ended=None))
    write_record(tmp_path, RECORD)
    assert [path.name for path in tmp_path.iterdir()] == ["session.json"]


def test_each_session_has_a_folder_of_its_own_even_within_one_second(tmp_path: Path) -> None:
    name = session_name(RECORD.started_at, "Demo field / north")
    assert name == "20260101T000000Z-demo-field-north"
    assert make_folder(tmp_path / "new" / "deep", name) != make_folder(tmp_path / "new" / "deep", name)


def test_a_session_is_never_archived_into_another_session(tmp_path: Path) -> None:
    write_record(tmp_path, RECORD)
    with pytest.raises(FolderError, match="is a session already"):
        make_folder(tmp_path, "x")


def test_an_archive_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FolderError, match="is a file"):
        make_folder(tmp_path / "file", "x")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, "is no session"),
        ("{", "cannot be read"),
        ("[]", "not of a format"),
        ('{"format": 99}', "not of a format"),
        ('{"format": 1}', "lacks or spoils"),
        (json.dumps({"format": 1, "command": [], "options": {"unheard_of": 1}, "sources": []}), "lacks or spoils"),
    ],
)
def test_a_folder_that_is_no_session_of_ours_is_refused_in_one_sentence(
    tmp_path: Path, text: str | None, complaint: str
) -> None:
    if text is not None:
        (tmp_path / "session.json").write_text(text)
    with pytest.raises(FolderError, match=complaint) as refused:
        read_record(tmp_path)
    assert "\n" not in str(refused.value)


def test_a_folder_that_does_not_exist_is_said_to_be_none(tmp_path: Path) -> None:
    with pytest.raises(FolderError, match=r"^There is no folder .*nodir"):
        read_record(tmp_path / "nodir")


def test_a_folder_is_held_until_it_is_let_go(tmp_path: Path) -> None:
    write_record(tmp_path, RECORD)
    hold = Hold(tmp_path)
    assert is_held(tmp_path, tmp_path / "session.json")
    hold.release()
    assert not is_held(tmp_path, tmp_path / "session.json")


@pytest.mark.parametrize("ends", [True, False])
def test_a_killed_session_is_mended_when_the_process_that_draws_has_let_go_of_the_recording(
    tmp_path: Path, ends: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is waited for; where it goes on and on, the session is one that is still written."""
    record = replace(RECORD, ended=None, sources=())
    write_record(tmp_path, record)
    (tmp_path / "session.rrd").write_bytes(b"")
    hold, waited = Hold(tmp_path / "session.rrd"), list[float]()

    def wait(length_s: float) -> None:
        waited.append(length_s)
        if ends:
            hold.release()

    monkeypatch.setattr(sessions.time, "sleep", wait)
    monkeypatch.setattr(sessions.time, "monotonic", lambda: sum(waited))
    assert bool(sessions.mend(tmp_path)) == ends
    assert read_record(tmp_path).ended == ("killed" if ends else None)
    assert len(waited) == 1 or sum(waited) > 9.0
    hold.release()
