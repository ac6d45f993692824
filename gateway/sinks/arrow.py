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

import numpy as np
import pyarrow as pa

from gateway.fuse import Fused
from gateway.observation import Truth
from gateway.picture import Picture
from gateway.predict import Conflicts, Predicted

_TIME = pa.timestamp("ns", tz="UTC")
_REAL = pa.float64()
_TEXT = pa.string()
_VELOCITY = [(f"velocity_{axis}_mps", _REAL) for axis in ("east", "north", "up")]
_PLACE = [("latitude_deg", _REAL), ("longitude_deg", _REAL), ("height_m", _REAL)]

TRACKS = pa.schema(
    [
        pa.field("time", _TIME, nullable=False),
        ("received", _TIME),
        pa.field("track", pa.int64(), nullable=False),
        ("aircraft", _TEXT),
        ("radar_track", _TEXT),
        ("updated_by", _TEXT),
        ("state", _TEXT),
        *_PLACE,
        ("altitude_msl_m", _REAL),
        *_VELOCITY,
        ("covariance", pa.list_(_REAL, 36)),
        ("straight", _REAL),
        ("left", _REAL),
        ("right", _REAL),
        ("pressure_altitude_m", _REAL),  # never a height: it stands beside one, or where there is none
        ("callsign", _TEXT),
        ("life", _TEXT),
        ("wind_east_mps", _REAL),  # where the air moves to, as dead reckoning has found it
        ("wind_north_mps", _REAL),
    ]
)

PREDICTIONS = pa.schema(
    [
        pa.field("made", _TIME, nullable=False),
        pa.field("track", pa.int64(), nullable=False),
        pa.field("valid", _TIME, nullable=False),
        ("horizon_s", _REAL),
        *_PLACE,
        ("sigma_m", _REAL),
        ("method", _TEXT),
        ("intent", _TEXT),
        ("intent_kind", _TEXT),
        ("confidence", _REAL),
        ("sigma_along_m", _REAL),
        ("sigma_across_m", _REAL),
        ("course_deg", _REAL),
    ]
)

TRUTH = pa.schema([pa.field("time", _TIME, nullable=False), ("aircraft", _TEXT), *_PLACE, *_VELOCITY, ("mode", _TEXT)])

CONFLICTS = pa.schema(
    [
        pa.field("time", _TIME, nullable=False),
        pa.field("track", pa.int64(), nullable=False),
        pa.field("other_track", pa.int64(), nullable=False),
        ("state", _TEXT),  # "found", "goes on", "over": then the rest is as it was told last
        ("loses_separation", _TIME),
        ("closest", _TIME),
        *_PLACE,  # in the middle between both when they are nearest
        ("horizontal_m", _REAL),  # then
        ("vertical_m", _REAL),
        ("probability", _REAL),
    ]
)

SCHEMAS = {"tracks": TRACKS, "predictions": PREDICTIONS, "conflicts": CONFLICTS, "truth": TRUTH}
"""The tables of a session by the stem of their files."""

_TRACK_TEXTS = ("aircraft", "radar_track", "updated_by", "state")
_END_OF_STREAM = b"\xff\xff\xff\xff\x00\x00\x00\x00"


def _real(values: Any) -> pa.Array:
    """NaN is how arrays say "not measured"; a table says it with null."""
    return pa.array(np.ascontiguousarray(values, dtype=np.float64), type=_REAL, from_pandas=True)


def _time(values: Any) -> pa.Array:
    return pa.array(np.ascontiguousarray(values, dtype=np.int64)).cast(_TIME)


def _text(parts: Sequence[Sequence[str | None]]) -> pa.Array:
    return pa.array([text for part in parts for text in part], type=_TEXT)


def tracks_batch(parts: Sequence[Fused]) -> pa.RecordBatch:
    """The rows of many steps as one batch of the TRACKS schema."""
    received = np.concatenate([part.received for part in parts])
    velocity = np.concatenate([part.velocity_mps for part in parts])
    modes = np.concatenate([part.modes for part in parts])
    covariance = np.concatenate([part.covariance for part in parts]).astype(np.float64, copy=False)
    heard = pa.array(received, mask=received < 0).cast(_TIME)
    columns = [
        _time(np.concatenate([part.time for part in parts])),
        heard,
        pa.array(np.concatenate([part.track for part in parts])),
        *(_text([getattr(part, name) for part in parts]) for name in _TRACK_TEXTS),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        _real(np.concatenate([part.height_m for part in parts])),
        _real(np.concatenate([part.altitude_msl_m for part in parts])),
        *(_real(velocity[:, axis]) for axis in range(3)),
        pa.FixedSizeListArray.from_arrays(pa.array(covariance.reshape(-1)), 36),
        *(_real(modes[:, mode]) for mode in range(3)),
        _real(np.concatenate([part.pressure_altitude_m for part in parts])),
        _text([part.callsign for part in parts]),
        _text([part.life for part in parts]),
        *(_real(np.concatenate([part.wind_mps for part in parts])[:, axis]) for axis in range(2)),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=TRACKS)


def predictions_batch(parts: Sequence[Predicted]) -> pa.RecordBatch:
    """The predicted points of many steps as one batch of the PREDICTIONS schema."""
    columns = [
        _time(np.concatenate([part.made for part in parts])),
        pa.array(np.concatenate([part.track for part in parts])),
        _time(np.concatenate([part.valid for part in parts])),
        _real(np.concatenate([part.horizon_s for part in parts])),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        _real(np.concatenate([part.height_m for part in parts])),
        _real(np.concatenate([part.sigma_m for part in parts])),
        *(_text([getattr(part, name) for part in parts]) for name in ("method", "intent", "intent_kind")),
        _real(np.concatenate([part.confidence for part in parts])),
        _real(np.concatenate([part.sigma_along_m for part in parts])),
        _real(np.concatenate([part.sigma_across_m for part in parts])),
        _real(np.degrees(np.concatenate([part.course_rad for part in parts]))),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=PREDICTIONS)


def conflicts_batch(parts: Sequence[Conflicts]) -> pa.RecordBatch:
    """The conflicts of many rounds as one batch of the CONFLICTS schema."""
    pairs = [pair for part in parts for pair in part.pair]
    columns = [
        _time(np.concatenate([part.time for part in parts])),
        *(pa.array([pair[side] for pair in pairs], type=pa.int64()) for side in (0, 1)),
        _text([part.state for part in parts]),
        _time(np.concatenate([part.loses_at for part in parts])),
        _time(np.concatenate([part.closest_at for part in parts])),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        *(
            _real(np.concatenate([getattr(part, name) for part in parts]))
            for name in ("height_m", "horizontal_m", "vertical_m", "probability")
        ),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=CONFLICTS)


def truth_batch(rows: Sequence[Truth], geoid_separation_m: float) -> pa.RecordBatch:
    """True states as one batch of the TRUTH schema; an altitude above mean sea level becomes a height."""

    def height_m(row: Truth) -> float | None:
        if row.height_m is not None or row.altitude_msl_m is None:
            return row.height_m
        return row.altitude_msl_m + geoid_separation_m

    columns = [
        _time([row.valid_at for row in rows]),
        pa.array([row.aircraft for row in rows], type=_TEXT),
        _real(np.degrees([row.latitude_rad for row in rows])),
        _real(np.degrees([row.longitude_rad for row in rows])),
        pa.array([height_m(row) for row in rows], type=_REAL),
        *(pa.array([getattr(row, name) for row in rows], type=_REAL) for name, _ in _VELOCITY),
        pa.array([row.mode for row in rows], type=_TEXT),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=TRUTH)


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
            reason = f"the archive could not be written: {error.strerror}"
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

    Rows wait at most `period_s` of session time or until `rows_limit` of them wait. `geoid_separation_m`
    lifts a truth that is only known above mean sea level. Every method raises OSError when the disk does not
    take the rows.
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

    def write(self, picture: Picture) -> None:
        """Take the rows of one step; raises OSError when a full disk refuses them."""
        if len(picture.fuse.time):
            self._tracks.add(picture.fuse)
        if len(picture.predict.made):
            self._predictions.add(picture.predict)
        if len(picture.predict.conflicts.time):
            self._conflicts.add(picture.predict.conflicts)
        self._truth.add(*picture.truth)
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
                for table in (self._tracks, self._predictions, self._conflicts, self._truth):
                    table.flush()
            except OSError:
                self._refused = True
                raise

    def close(self) -> None:
        """Write out everything and end the streams; calling it again does nothing. A full disk is told once."""
        try:
            with contextlib.ExitStack() as closing:  # each, whatever another one says
                for table in (self._truth, self._conflicts, self._predictions, self._tracks):
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
