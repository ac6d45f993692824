"""Files that end with a whole record whatever happens."""

import os
from pathlib import Path

import pytest

from gateway.runtime.wholefile import WholeFile


def test_records_are_in_the_file_after_a_flush_and_not_before(tmp_path: Path) -> None:
    file = WholeFile(tmp_path / "a")
    file.write(b"one")
    assert (tmp_path / "a").read_bytes() == b""
    file.flush()
    file.write(b"two")
    file.close()
    assert (tmp_path / "a").read_bytes() == b"onetwo"


def test_a_full_disk_leaves_only_whole_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = WholeFile(tmp_path / "a")
    file.write(b"0123456789")
    file.flush()
    real, room = os.write, [25]

    def write_until_full(descriptor: int, data: bytes) -> int:
        if not room[0]:
            raise OSError(28, "No space left on device")
        taken = real(descriptor, bytes(data)[: room[0]])
        room[0] -= taken
        return taken

    monkeypatch.setattr(os, "write", write_until_full)
    for record in (b"a" * 10, b"b" * 10, b"c" * 10):
        file.write(record)
    with pytest.raises(OSError, match="No space"):
        file.flush()
    file.close()
    assert (tmp_path / "a").read_bytes() == b"0123456789" + b"a" * 10 + b"b" * 10


def test_a_file_that_exists_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"kept")
    with pytest.raises(FileExistsError):
        WholeFile(tmp_path / "a")
    assert (tmp_path / "a").read_bytes() == b"kept"
