"""The sessions of a folder, each completed where it was killed."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from pathlib import Path

from gateway.runtime.archived import read_table
from gateway.runtime.folder import SESSION_FILE, FolderError, Record, read_record, write_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.outputs import RRD_FILE
from gateway.sinks.hold import is_held
from gateway.sinks.parquet import finish, unfinished

_DRAWN_WITHIN_S = 10.0  # of the kill: what was handed over to the process that draws is less than a second
_UNTOLD_NS = 2_000_000_000  # rows are not further ahead of session.json; a stream at another speed has another clock


def is_session(folder: Path) -> bool:
    """Whether a path is a session's folder, or one that may not be looked into: it is not passed over in silence."""
    try:
        return (folder / SESSION_FILE).is_file()
    except PermissionError:
        return True


def session_folders(parent: Path) -> list[Path]:
    """The sessions in a folder (or the folder itself, if it is one), oldest first by name.

    Raises FolderError when there is no such folder.
    """
    if is_session(parent):
        return [parent]
    if not parent.is_dir():
        raise FolderError(f"There is no folder {parent}.")
    return sorted(path for path in parent.iterdir() if is_session(path))


def mend(folder: Path) -> str:
    """Complete a session that did not end by itself: Parquet of its streams, its .rrd's footer, session.json.

    Does nothing to one that is complete, or that another process is still writing. Says what was done, "" for nothing.
    Raises FolderError when it is no session, OSError when the disk refuses.
    """
    record = read_record(folder)
    if record.ended is not None and not unfinished(folder):
        return ""
    if is_held(folder, folder / SESSION_FILE) or not _is_drawn(folder / RRD_FILE):
        return ""
    made = finish(folder)
    _repair_rrd(folder / RRD_FILE)
    if record.ended is None:
        write_record(folder, replace(record, ended="killed", watermark=_watermark(folder, record)))
    tables = ", ".join(path.name for path in made) or "no tables"
    return f"was not ended properly; completed ({tables})"


def _is_drawn(path: Path) -> bool:
    """Whether nobody writes the recording: after a kill the process that draws is waited for, which soon ends by itself."""
    patience = time.monotonic() + _DRAWN_WITHIN_S
    while path.exists() and is_held(path, path):
        if time.monotonic() > patience:
            return False
        time.sleep(0.05)
    return True


def _watermark(folder: Path, record: Record) -> int:
    """How far a killed session goes, by the receiver's clock: what it said last, its last arrival, its last rows.

    Rows without an observation (predictions, coasting) tell that the watermark had come to their instant.
    """
    import pyarrow.compute as pc  # 0.1 s that every start would wait for, and only what was killed needs

    until = record.watermark if record.watermark is not None else record.started_at
    for source in record.sources:
        for arrival in SessionInput(folder / source.file, source.source).arrivals():
            until = max(until, arrival.received_at)
    offset_ns = (record.epoch_offset_s or 0) * 1_000_000_000
    if not (folder / "tracks.parquet").exists():
        return until  # it was killed before its place was known
    made = read_table(folder, "predictions", ["made"])["made"]
    tracks = read_table(folder, "tracks", ["time", "received"])
    coasted = tracks.filter(pc.is_null(tracks["received"]))["time"]
    for times in (made, coasted):
        if len(times):
            last = int(pc.max(times).value) - offset_ns
            until = last if until < last < until + _UNTOLD_NS else until
    return until


def _repair_rrd(path: Path) -> None:
    """Give a recording that was cut its index; without it the file still opens, so failing here is no failure."""
    from gateway.sinks.recording import optimise  # knows the viewer, which listing does not need

    if path.exists():
        with contextlib.suppress(OSError):
            optimise(path)
