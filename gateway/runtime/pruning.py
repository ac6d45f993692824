"""Old sessions removed: never one that still runs, never half of one."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from gateway.runtime.folder import SESSION_FILE, FolderError
from gateway.runtime.listing import Listed
from gateway.sinks.hold import Hold, is_held

_GOING = ".removed"


def is_older(session: Listed, than: int) -> bool:
    """Whether a session both ended and was written last before an instant, ns since 1970 UTC.

    Both: a recording of years ago that was replayed yesterday is not old. One that runs, or whose session.json cannot be
    read, is not old.
    """
    if session.record is None or session.record.ended is None:
        return False
    return max(session.record.watermark or session.started_at, session.written_at) < than


def remove(folder: Path) -> None:
    """Remove a session's folder. Raises FolderError when another process works on it, or it is only a link; OSError.

    It is renamed first, so that what a death in here leaves is no session any more; the next call removes that too.
    """
    if folder.is_symlink():
        raise FolderError(f"{folder} is a link to a session elsewhere; it is left.")
    try:
        if is_held(folder, folder / SESSION_FILE):
            raise BlockingIOError
        hold = Hold(folder)
    except BlockingIOError as error:
        raise FolderError(f"{folder} is still being written; it is left.") from error
    try:
        if not (folder / SESSION_FILE).exists():
            raise FolderError(f"{folder} is no session any more; it is left.")
        going = folder.with_name(f".{folder.name}{_GOING}")
        shutil.rmtree(going, ignore_errors=True)
        os.rename(folder, going)
        shutil.rmtree(going)
    finally:
        hold.release()
