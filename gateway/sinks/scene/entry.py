"""What is sent to a recording: rows of one entity, or what is the same at all times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Rows:
    """Rows of one entity: time (n,) ns, step (n,), and component columns of n rows each."""

    path: str
    time: Ints
    step: Ints
    columns: tuple[Any, ...]  # rr.ComponentColumn


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
    flat = tuple(column for part in columns for column in part)
    return Rows(path, np.asarray(time, dtype=np.int64), np.asarray(step, dtype=np.int64), flat)


def once(path: str, time: int, step: int, *columns: Iterable[Any]) -> Rows:
    """One row of one entity."""
    return rows(path, [time], [step], *columns)


def in_order(time: Ints) -> NDArray[np.intp]:
    """The order that sorts times; equal times keep their order."""
    return np.argsort(time, kind="stable")


def send(recording: rr.RecordingStream, entries: Sequence[Entry]) -> None:
    """Hand entries to a recording stream, in their order."""
    for entry in entries:
        if isinstance(entry, Always):
            recording.log(entry.path, *entry.archetypes, static=True)
        else:
            indexes = (
                rr.TimeColumn("utc", timestamp=entry.time.astype("datetime64[ns]")),
                rr.TimeColumn("step", sequence=entry.step),
            )
            recording.send_columns(entry.path, indexes, entry.columns)
