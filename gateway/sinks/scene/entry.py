"""What is sent to a recording: rows of one entity, or what is the same at all times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import ArrayLike, NDArray
from rerun.chunk import Chunk

from gateway.sinks.scene.columns import Column

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Index:
    """A column of times as Rerun takes it. Made once for all recordings, and without Rerun's own detours."""

    name: str
    array: pa.Array

    def cut(self, start: int, count: int) -> Index:
        """Some of the rows; nothing is copied."""
        return Index(self.name, self.array.slice(start, count))

    def timeline_name(self) -> str:
        """What Rerun asks for."""
        return self.name

    def as_arrow_array(self) -> pa.Array:
        """What Rerun asks for."""
        return self.array


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of one entity: time (n,) ns, step (n,), and component columns of n rows each."""

    path: str
    time: Ints
    step: Ints
    indexes: tuple[Index, Index]
    columns: tuple[Any, ...]  # of Column: Rerun takes what answers like its own


@dataclass(frozen=True, slots=True)
class Always:
    """Archetypes of one entity that hold at all times."""

    path: str
    archetypes: tuple[rr.AsComponents, ...]


Entry = Rows | Always


@dataclass(frozen=True, slots=True)
class Piece:
    """Rows as Rerun keeps them, and how many they are."""

    chunk: Chunk
    count: int

    @staticmethod
    def of(rows: Rows) -> Piece:
        """The same rows."""
        return Piece(Chunk.from_columns(rows.path, rows.indexes, rows.columns), len(rows.time))


Made = Piece | Always


def entity(*parts: str | int) -> str:
    """The path of an entity; parts are escaped, because identities hold colons and slashes."""
    return str(rr.new_entity_path([str(part) for part in parts]))


def rows(path: str, time: ArrayLike, step: ArrayLike, *columns: Iterable[Any]) -> Rows:
    """Rows of one entity in the order of time; what `Archetype.columns` gives goes into `columns`.

    The rows must come in the order of time already: see `in_order`.
    """
    flat = tuple(Column(one.component_descriptor(), one.as_arrow_array()) for part in columns for one in part)
    at, number = np.asarray(time, dtype=np.int64), np.asarray(step, dtype=np.int64)
    return Rows(path, at, number, indexes(at, number), flat)


def indexes(time: Ints, step: Ints) -> tuple[Index, Index]:
    """The columns of the two timelines."""
    utc, count = pa.array(time.view("datetime64[ns]"), pa.timestamp("ns")), pa.array(step, pa.int64())
    return Index("utc", utc), Index("step", count)


def once(path: str, time: int, step: int, *columns: Iterable[Any]) -> Rows:
    """One row of one entity."""
    return rows(path, [time], [step], *columns)


def in_order(time: Ints) -> NDArray[np.intp]:
    """The order that sorts times; equal times keep their order."""
    return np.argsort(time, kind="stable")


def made(entries: Sequence[Entry]) -> list[Made]:
    """Entries as recording streams take them; made once for the file and the viewers."""
    return [entry if isinstance(entry, Always) else Piece.of(entry) for entry in entries]


def send(recording: rr.RecordingStream, entries: Sequence[Made]) -> None:
    """Hand entries to a recording stream: what holds at all times first."""
    for entry in entries:
        if isinstance(entry, Always):
            recording.log(entry.path, *entry.archetypes, static=True)
    recording.send_chunks(entry.chunk for entry in entries if isinstance(entry, Piece))
