"""The end of an archive: NAME.arrows becomes NAME.parquet, also when a session was killed in mid-batch."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from gateway.sinks.arrow import SCHEMAS

ROW_GROUP = 16384  # rows gathered before Parquet is handed a row group: bounds memory, keeps compression good


def finish(folder: Path) -> tuple[Path, ...]:
    """Make the .parquet of every .arrows stream in a session's folder; returns the files made.

    Keeps every whole batch of a stream that was cut. The .arrows is removed only when its .parquet is
    complete on disk, so a death in here loses nothing and the next call starts over. Raises OSError when the
    disk is full.
    """
    made = []
    for name, schema in SCHEMAS.items():
        stream = folder / f"{name}.arrows"
        if stream.exists():
            target = folder / f"{name}.parquet"
            _convert(stream, target, schema)
            stream.unlink()
            made.append(target)
    return tuple(made)


def unfinished(folder: Path) -> bool:
    """Whether a session's folder still holds streams that `finish` should make Parquet of."""
    return any((folder / f"{name}.arrows").exists() for name in SCHEMAS)


def whole_batches(stream: Path) -> Iterator[pa.RecordBatch]:
    """The batches of an Arrow IPC stream up to its end, or up to where it was cut.

    A stream that was cut inside its schema, or is empty, has none. Raises OSError when it cannot be opened.
    """
    with pa.OSFile(str(stream)) as source:  # not a memory map: its pages would count as ours until the end
        try:
            reader = pa.ipc.open_stream(source)
        except (pa.ArrowInvalid, OSError):  # nothing whole was written yet
            return
        while True:
            try:
                batch = reader.read_next_batch()
            except (StopIteration, pa.ArrowInvalid, OSError):  # the end, or a batch that was cut
                return
            yield batch


def _completed(batch: pa.RecordBatch, schema: pa.Schema) -> pa.RecordBatch:
    """A batch with null in the columns that the release which wrote it did not have yet."""
    if batch.schema.equals(schema):
        return batch
    known = set(batch.schema.names)
    columns = [batch.column(f.name) if f.name in known else pa.nulls(len(batch), f.type) for f in schema]
    return pa.RecordBatch.from_arrays(columns, schema=schema)


def _convert(stream: Path, target: Path, schema: pa.Schema) -> None:
    part = target.with_name(target.name + ".part")
    # numbers hardly repeat: a dictionary of them takes most of the time and of the memory, and makes the file larger
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    with pq.ParquetWriter(part, schema, compression="zstd", use_dictionary=texts) as writer:
        waiting: list[pa.RecordBatch] = []
        rows = 0
        for batch in whole_batches(stream):
            waiting.append(_completed(batch, schema))
            rows += len(batch)
            if rows >= ROW_GROUP:
                writer.write_table(pa.Table.from_batches(waiting, schema))
                waiting, rows = [], 0
        if waiting:
            writer.write_table(pa.Table.from_batches(waiting, schema))
    with open(part, "rb") as written:
        os.fsync(written.fileno())
    os.replace(part, target)
