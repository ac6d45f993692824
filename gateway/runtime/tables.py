"""The messages of a .tlog as Parquet files, one a kind of message: for pandas, Polars, DuckDB and the like."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from adapters.columns import iter_columns

_TIME = pa.timestamp("ns", tz="UTC")


def write_tables(
    path: Path,
    folder: Path,
    wanted: Collection[str] | None = None,
    *,
    counters: Counter[str] | None = None,
    tell: Callable[[float], None] = lambda fraction: None,
) -> dict[str, int]:
    """Write NAME.parquet for every kind of message in a .tlog into an existing folder; rows by name.

    Columns are the message's fields in the wire's units, and before them when and from whom it was heard. Memory: one block
    of the file. Raises OSError, and KeyError for a wanted name that no message has.
    """
    rows: Counter[str] = Counter()
    writers: dict[str, pq.ParquetWriter] = {}
    size = max(path.stat().st_size, 1)
    with ExitStack() as opened:
        for columns in iter_columns(path, wanted, counters):
            for name, messages in columns.messages.items():
                table = _table(messages)
                if name not in writers:
                    writers[name] = opened.enter_context(pq.ParquetWriter(folder / f"{name}.parquet", table.schema))
                writers[name].write_table(table)
                rows[name] += len(messages)
            if len(columns.frames):
                tell(int(columns.frames["offset"][-1]) / size)
    return dict(sorted(rows.items()))


def _table(messages: NDArray[Any]) -> pa.Table:
    names = messages.dtype.names or ()
    return pa.table({name: _column(name, messages[name]) for name in names})


def _column(name: str, values: NDArray[Any]) -> pa.Array:
    """A field as Arrow has it: arrays as lists of fixed size, texts up to their NUL."""
    if name == "received_at":
        return pa.array(values, pa.int64()).cast(_TIME)
    if values.dtype.kind == "S":
        return pa.array([text.decode("utf-8", "replace") for text in values.tolist()], pa.string())
    if values.ndim > 1:
        flat = pa.array(np.ascontiguousarray(values).reshape(-1))
        return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    return pa.array(np.ascontiguousarray(values))
