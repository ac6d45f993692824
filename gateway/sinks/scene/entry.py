"""What is sent to a recording: rows of one entity, or what is the same at all times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Index:
    """A column of times as Rerun takes it. Made once for all recordings, and without Rerun's own detours: a tenth of drawing."""

    name: str
    array: pa.Array

    def timeline_name(self) -> str:
        """What Rerun asks for."""
        return self.name

    def as_arrow_array(self) -> pa.Array:
        """What Rerun asks for."""
        return self.array


@dataclass(frozen=True, slots=True)
class _Column:
    """Likewise a component's column."""

    descriptor: Any
    array: pa.Array

    def component_descriptor(self) -> Any:
        """What Rerun asks for."""
        return self.descriptor

    def as_arrow_array(self) -> pa.Array:
        """What Rerun asks for."""
        return self.array


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of one entity: time (n,) ns, step (n,), and component columns of n rows each."""

    path: str
    time: Ints
    step: Ints
    indexes: tuple[_Index, _Index]
    columns: tuple[Any, ...]  # of _Column: Rerun takes what answers like its own


@dataclass(frozen=True, slots=True)
class Always:
    """Archetypes of one entity that hold at all times."""

    path: str
    archetypes: tuple[rr.AsComponents, ...]


Entry = Rows | Always


def entity(*parts: str | int) -> str:
    """The path of an entity; parts are escaped, because identities hold colons and slashes."""
    return str(rr.new_entity_path([str(part) for part in parts]))


def rows(path: str, time: ArrayLike, step: ArrayLike, *columns: Iterable[Any]) -> Rows:
    """Rows of one entity in the order of time; what `Archetype.columns` gives goes into `columns`.

    The rows must come in the order of time already: see `in_order`.
    """
    flat = tuple(_Column(one.component_descriptor(), one.as_arrow_array()) for part in columns for one in part)
    at, number = np.asarray(time, dtype=np.int64), np.asarray(step, dtype=np.int64)
    utc, count = pa.array(at.view("datetime64[ns]"), pa.timestamp("ns")), pa.array(number, pa.int64())
    return Rows(path, at, number, (_Index("utc", utc), _Index("step", count)), flat)


def once(path: str, time: int, step: int, *columns: Iterable[Any]) -> Rows:
    """One row of one entity."""
    return rows(path, [time], [step], *columns)


def strips_3d(strips: Sequence[Floats]) -> Any:
    """Lines (k, 3) in metres as component columns, one strip a row until they are partitioned otherwise."""
    return rr.LineStrips3D.columns(strips=_lists(strips, 3, np.float32, rr.components.LineStrip3DBatch))


def strips_on_map(strips: Sequence[Floats]) -> Any:
    """Lines (k, 2) in degrees of latitude and longitude, likewise."""
    return rr.GeoLineStrings.columns(line_strings=_lists(strips, 2, np.float64, rr.components.GeoLineStringBatch))


def _lists(strips: Sequence[Floats], width: int, kind: Any, batch: Any) -> Any:
    """Lines as one Arrow array: Rerun's own conversion takes 30 us a line, this one 1."""
    offsets = np.concatenate([[0], np.cumsum([len(strip) for strip in strips])]).astype(np.int32)
    numbers = pa.array(np.concatenate(strips).astype(kind).reshape(-1))
    wanted = batch._ARROW_DATATYPE
    points = pa.FixedSizeListArray.from_arrays(numbers, type=wanted.value_type)
    return pa.ListArray.from_arrays(pa.array(offsets), points, type=wanted)


def in_order(time: Ints) -> NDArray[np.intp]:
    """The order that sorts times; equal times keep their order."""
    return np.argsort(time, kind="stable")


def send(recording: rr.RecordingStream, entries: Sequence[Entry]) -> None:
    """Hand entries to a recording stream, in their order."""
    for entry in entries:
        if isinstance(entry, Always):
            recording.log(entry.path, *entry.archetypes, static=True)
        else:
            recording.send_columns(entry.path, entry.indexes, entry.columns)
