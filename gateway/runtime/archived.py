"""The tables of an archived session."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.runtime.folder import FolderError

if TYPE_CHECKING:
    import pyarrow as pa


def read_table(session: Path, name: str, columns: Sequence[str] | None = None) -> pa.Table:
    """tracks, predictions, truth and the like of a session. Raises FolderError where there is none, or it is spoiled."""
    import pyarrow as pa  # a tenth of a second that every start would wait for
    import pyarrow.parquet as pq

    path = session / f"{name}.parquet"
    try:
        return pq.read_table(path, columns=None if columns is None else list(columns))
    except FileNotFoundError as error:
        raise FolderError(
            f"{session} has no {name}.parquet: it still runs, was not replayed yet, or ended before its place was known."
        ) from error
    except (pa.ArrowException, OSError) as error:
        raise FolderError(f"{path} cannot be read; `talkdown sessions {session} --repair` makes it again.") from error
