"""The sessions of a folder as a list shows them: when, where, who, how long, how large, how they ended, and what is wrong.

Of each session session.json is read, and the ends of its tables and of its recording: enough to see that one was cut.
"""

from __future__ import annotations

import contextlib
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from adapters.files import FileError
from adapters.reasons import reason_of
from gateway.runtime.archived import read_table
from gateway.runtime.folder import INPUTS, SESSION_FILE, FolderError, Record, read_record
from gateway.runtime.outputs import RRD_FILE
from gateway.runtime.sessions import mend, session_folders

TABLES = ("tracks", "predictions", "conflicts", "truth", "deck")
_PARQUET_ENDS, _RRD_BEGINS = b"PAR1", b"RRF2"


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that is wrong with a session: what, and which of its files that concerns ("" for none)."""

    what: str
    file: str = ""


@dataclass(frozen=True, slots=True)
class Listed:
    """One session as a list shows it. `record` is None where session.json cannot be read; `written_at`: ns since 1970 UTC.

    `mended` says what was done to it just now, "" for nothing; `tracked` who has a track in the tables of one that was never
    summed up.
    """

    folder: Path
    record: Record | None
    written_at: int
    size_bytes: int
    faults: tuple[Fault, ...] = ()
    mended: str = ""
    tracked: tuple[str, ...] = ()

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return self.record is not None and self.record.ended is None

    @property
    def ended(self) -> str:
        """How it ended: "done", "stopped by Ctrl-C", "failed: …", "killed"; "running"; "unreadable"."""
        return "unreadable" if self.record is None else self.record.ended or "running"

    @property
    def started_at(self) -> int:
        """When it began; of one that cannot be read when it was written last."""
        return self.written_at if self.record is None else self.record.started_at

    @property
    def length_s(self) -> float | None:
        """How long it lasted; None: not known."""
        if self.record is None or self.record.watermark is None:
            return None
        return (self.record.watermark - self.record.started_at) / 1e9

    @property
    def site(self) -> str:
        """The site's name, "" where it is not known."""
        if self.record is None:
            return ""
        told = self.record.summary.get("site")
        return told if isinstance(told, str) and told else _site_name(self.record.site or "")

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Who had a track; where nothing tells (it runs, or was killed before its place was known), which peers sent MAVLink."""
        if self.record is None:
            return ()
        told = self.record.summary.get("aircraft")
        if isinstance(told, list) and all(isinstance(one, str) for one in told):
            return tuple(told)
        return self.tracked or tuple(source.name for source in self.record.sources if source.kind == "mavlink")


def _site_name(text: str) -> str:
    try:
        return str(tomllib.loads(text).get("name", ""))
    except tomllib.TOMLDecodeError:
        return ""


def listed(parent: Path, tell: Callable[[float], None] = lambda share: None) -> Iterator[Listed]:
    """Every session of a folder, those that were killed completed first; folders that are none are passed over.

    `tell` hears how far it is, from 0 to 1. Raises FolderError when there is no such folder.
    """
    folders = session_folders(parent)
    for place, folder in enumerate(folders):
        with contextlib.suppress(FileNotFoundError):  # somebody removed it just now
            yield look(folder)
        tell((place + 1) / len(folders))


def look(folder: Path) -> Listed:
    """One session, completed first where it was killed, with what is wrong with it. Raises FileNotFoundError."""
    mended, faults = "", []
    try:
        mended = mend(folder)
    except (FolderError, FileError) as error:
        faults.append(Fault(f"it could not be completed: {error}"))
    except OSError as error:
        faults.append(Fault(f"it could not be completed: {reason_of(error)}"))
    sizes = _sizes(folder)
    try:
        written_at = (folder / SESSION_FILE).stat().st_mtime_ns
    except PermissionError:
        written_at = folder.stat().st_mtime_ns
    try:
        record = read_record(folder)
    except FolderError as error:
        return Listed(folder, None, written_at, sum(sizes.values()), (Fault(str(error), SESSION_FILE),))
    tracked: tuple[str, ...] = ()
    if record.ended is not None:
        faults += _faults(folder, record, sizes)
        if "aircraft" not in record.summary:
            tracked = _tracked(folder)
    return Listed(folder, record, written_at, sum(sizes.values()), tuple(faults), mended, tracked)


def _tracked(folder: Path) -> tuple[str, ...]:
    """Who has a track in a session's table; nobody where there is none, or it is spoiled: that is a fault already."""
    try:
        names = read_table(folder, "tracks", ["aircraft"])["aircraft"].unique().to_pylist()
    except FolderError:
        return ()
    return tuple(sorted(name for name in names if name is not None))


def _sizes(folder: Path) -> dict[str, int]:
    """Bytes of each file of a session, by its path inside."""
    sizes: dict[str, int] = {}
    for inside in ("", f"{INPUTS}/"):
        try:
            with os.scandir(folder / inside) as entries:
                sizes |= {inside + one.name: one.stat().st_size for one in entries if one.is_file()}
        except (FileNotFoundError, PermissionError):
            continue
    return sizes


def _faults(folder: Path, record: Record, sizes: Mapping[str, int]) -> Iterator[Fault]:
    """What is wrong with a session that has ended."""
    for source in record.sources:
        if source.file not in sizes:
            yield Fault(f"{source.file} is missing", source.file)
    for name in sizes:
        if name.endswith(".part"):
            yield Fault(f"{name} was left by a program that died", name)
    made = bool(record.summary.get("track_rows"))  # a simulated world has no tracks, nor has who never knew its place
    for table in TABLES:
        name = f"{table}.parquet"
        if name not in sizes:
            if made and table == "tracks":
                yield Fault(f"{name} is missing", name)
        elif not _ends(folder / name, sizes[name], _PARQUET_ENDS):
            yield Fault(f"{name} is cut", name)
    if RRD_FILE not in sizes:
        if made:
            yield Fault(f"{RRD_FILE} is missing", RRD_FILE)
    elif not _begins(folder / RRD_FILE, _RRD_BEGINS):
        yield Fault(f"{RRD_FILE} is spoiled", RRD_FILE)


def _begins(path: Path, mark: bytes) -> bool:
    with open(path, "rb", buffering=0) as file:
        return file.read(len(mark)) == mark


def _ends(path: Path, size: int, mark: bytes) -> bool:
    if size < len(mark):
        return False
    with open(path, "rb", buffering=0) as file:
        file.seek(-len(mark), os.SEEK_END)
        return file.read(len(mark)) == mark
