"""The archive's tables while a session runs: tracks, predictions, conflicts and truth as Arrow IPC streams.

A Parquet file that was never closed cannot be read, an Arrow stream can be, up to its last whole batch. So
rows go to NAME.arrows at least once a second, and `gateway.sinks.parquet.finish` makes NAME.parquet of it: at
a clean end, or when the next command finds the streams of a session that died.

    with ArrowSink(folder) as sink: ... sink.write(picture) ...
    finish(folder)

A write that fails (disk full) raises OSError, and the stream is cut back to its last whole batch.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, TypeVar

import pyarrow as pa

from adapters.reasons import reason_of
from gateway.frames import DeckPose
from gateway.fuse import Fused
from gateway.observation import Truth
from gateway.picture import Picture
from gateway.predict import Conflicts, Predicted
from gateway.sinks.batches import SCHEMAS, conflicts_batch, deck_batch, predictions_batch, tracks_batch, truth_batch

_END_OF_STREAM = b"\xff\xff\xff\xff\x00\x00\x00\x00"


class _Stream:
    """One Arrow IPC stream on disk, whole after every append."""

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        self.path = path
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115  (lives as long as the session)
        self._length = 0
        self._failed = False
        self._append(schema.serialize())

    def append(self, batch: pa.RecordBatch) -> None:
        self._append(batch.serialize())

    def _append(self, message: pa.Buffer | bytes) -> None:
        left = memoryview(message)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._failed = True
            self._file.truncate(self._length)  # half a batch helps nobody
            reason = f"the archive could not be written: {reason_of(error)}"
            raise OSError(error.errno, reason, str(self.path)) from error
        self._length += len(memoryview(message))

    def close(self) -> None:
        try:
            if not (self._file.closed or self._failed):  # what failed once was said once
                self._append(_END_OF_STREAM)
        finally:
            self._file.close()


Part = TypeVar("Part")


class _Table(Generic[Part]):
    """The parts that wait, and the stream that they go to as one batch."""

    def __init__(self, folder: Path, name: str, batch: Callable[[Sequence[Part]], pa.RecordBatch]) -> None:
        self._stream = _Stream(folder / f"{name}.arrows", SCHEMAS[name])
        self._batch = batch
        self._waiting: list[Part] = []

    def add(self, *parts: Part) -> None:
        self._waiting.extend(parts)

    def flush(self) -> None:
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._stream.append(self._batch(waiting))

    def close(self) -> None:
        try:
            self.flush()
        finally:
            self._stream.close()


class ArrowSink:
    """Writes tracks.arrows, predictions.arrows, conflicts.arrows and truth.arrows into a folder that exists.

    And deck.arrows, once a runway moves. Rows wait at most `period_s` of session time or until `rows_limit` of them
    wait. `geoid_separation_m` lifts a truth that is only known above mean sea level. Every method raises OSError when the
    disk does not take the rows.
    """

    def __init__(
        self, folder: Path, *, geoid_separation_m: float = 0.0, period_s: float = 1.0, rows_limit: int = 4096
    ) -> None:
        self._period_ns = round(period_s * 1e9)
        self._rows_limit = rows_limit
        self._rows = 0
        self._flushed_at: int | None = None
        self._refused = False  # the disk did not take something, which was told
        self._tracks: _Table[Fused] = _Table(folder, "tracks", tracks_batch)
        self._predictions: _Table[Predicted] = _Table(folder, "predictions", predictions_batch)
        self._conflicts: _Table[Conflicts] = _Table(folder, "conflicts", conflicts_batch)
        self._truth: _Table[Truth] = _Table(folder, "truth", lambda rows: truth_batch(rows, geoid_separation_m))
        self._deck: _Table[DeckPose] | None = None
        self._folder = folder

    def write(self, picture: Picture) -> None:
        """Take the rows of one step; raises OSError when a full disk refuses them."""
        if len(picture.fuse.time):
            self._tracks.add(picture.fuse)
        if len(picture.predict.made):
            self._predictions.add(picture.predict)
        if len(picture.predict.conflicts.time):
            self._conflicts.add(picture.predict.conflicts)
        self._truth.add(*picture.truth)
        if picture.deck:
            self._deck = self._deck or _Table(self._folder, "deck", deck_batch)
            self._deck.add(*picture.deck)
        self._rows += len(picture.fuse.time) + len(picture.predict.made) + len(picture.truth)
        self.flush(picture.now)

    def flush(self, now: int) -> None:
        """Write out what waits if a period has passed until `now` (session time, ns) or many rows wait."""
        if self._flushed_at is None:
            self._flushed_at = now
        if self._rows >= self._rows_limit or now - self._flushed_at >= self._period_ns:
            self._flushed_at = now
            self._rows = 0
            try:
                for table in self._tables:
                    table.flush()
            except OSError:
                self._refused = True
                raise

    @property
    def _tables(self) -> list[_Table[Any]]:
        tables: list[_Table[Any]] = [self._tracks, self._predictions, self._conflicts, self._truth]
        return tables if self._deck is None else [*tables, self._deck]

    def close(self) -> None:
        """Write out everything and end the streams; calling it again does nothing. A full disk is told once."""
        try:
            with contextlib.ExitStack() as closing:  # each, whatever another one says
                for table in reversed(self._tables):
                    closing.callback(table.close)
        except OSError:
            if not self._refused:
                raise

    def __enter__(self) -> ArrowSink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
