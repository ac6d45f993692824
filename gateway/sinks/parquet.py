"""The end of an archive: NAME.arrows becomes NAME.parquet, also when a session was killed in mid-batch."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from gateway.fuse import Fused
from gateway.sinks.batches import SCHEMAS, TRACKS, tracks_batch

SMOOTHED_PART = "smoothed.parquet.part"  # while it is written, at the end of a session
ROW_GROUP = 16384  # rows gathered before Parquet is handed a row group: bounds memory, keeps compression good


def finish(folder: Path) -> tuple[Path, ...]:
    """Make the .parquet of every .arrows stream in a session's folder; returns the files made.

    Keeps every whole batch of a stream that was cut. The .arrows is removed only when its .parquet is
    complete on disk, so a death in here loses nothing and the next call starts over. What is left of smoothed tracks that
    were never completed goes. Raises OSError when the
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
    (folder / SMOOTHED_PART).unlink(missing_ok=True)
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


class SmoothedTable:
    """smoothed.parquet, with the columns of tracks.parquet, written when a session is over. Raises OSError on a full disk.

    It stands beside itself (`.part`) until it is complete.
    """

    def __init__(self, folder: Path) -> None:
        self._target = folder / "smoothed.parquet"
        self._part = folder / SMOOTHED_PART
        self._writer = pq.ParquetWriter(self._part, TRACKS, compression="zstd", use_dictionary=_texts(TRACKS))
        self._waiting: list[Fused] = []

    def write(self, fused: Fused) -> None:
        """Take some rows."""
        self._waiting.append(fused)
        if sum(len(part.time) for part in self._waiting) >= ROW_GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._writer.write_batch(tracks_batch(waiting))

    def finish(self) -> None:
        """The file in its place, whole."""
        self._flush()
        self._writer.close()
        _place(self._part, self._target)

    def abandon(self) -> None:
        """Leave nothing behind."""
        with contextlib.suppress(OSError):  # what brought us here is what is told
            self._writer.close()
        self._part.unlink(missing_ok=True)


def _texts(schema: pa.Schema) -> list[str]:
    """Numbers hardly repeat: a dictionary of them takes most of the time and of the memory, and makes the file larger."""
    return [field.name for field in schema if pa.types.is_string(field.type)]


def _place(part: Path, target: Path) -> None:
    """A file that is complete, to its name."""
    with open(part, "rb") as written:
        os.fsync(written.fileno())
    os.replace(part, target)


def _completed(batch: pa.RecordBatch, schema: pa.Schema) -> pa.RecordBatch:
    """A batch with null in the columns that the release which wrote it did not have yet."""
    if batch.schema.equals(schema):
        return batch
    known = set(batch.schema.names)
    columns = [batch.column(f.name) if f.name in known else pa.nulls(len(batch), f.type) for f in schema]
    return pa.RecordBatch.from_arrays(columns, schema=schema)


def _convert(stream: Path, target: Path, schema: pa.Schema) -> None:
    part = target.with_name(target.name + ".part")
    with pq.ParquetWriter(part, schema, compression="zstd", use_dictionary=_texts(schema)) as writer:
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
    _place(part, target)
