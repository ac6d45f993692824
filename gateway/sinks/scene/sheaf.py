"""Rows of many entities of one kind, behind one another: their columns are made for all of them at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.sinks.scene.columns import Column
from gateway.sinks.scene.entry import Rows, indexes

Ints = NDArray[np.int64]
Key = TypeVar("Key")


@dataclass(frozen=True, slots=True)
class Sheaf(Generic[Key]):
    """Of k entities n rows in all; those of one entity stand together, in the order of time."""

    keys: Sequence[Key]  # (k,) what each entity is called
    ends: Ints  # (k + 1,) where its rows begin and end
    time: Ints  # (n,) ns
    step: Ints  # (n,)

    @staticmethod
    def of(keys: Sequence[Key], counts: ArrayLike, time: ArrayLike, step: ArrayLike) -> Sheaf[Key]:
        """So many rows of each entity."""
        ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        return Sheaf(keys, ends, np.asarray(time, dtype=np.int64), np.asarray(step, dtype=np.int64))

    def where(self, wanted: NDArray[np.bool_]) -> Sheaf[Key]:
        """Only the wanted rows (n,), and the entities that have some."""
        counts = np.diff(np.concatenate([[0], np.cumsum(wanted)])[self.ends])
        keys = [key for key, count in zip(self.keys, counts.tolist(), strict=True) if count]
        return Sheaf.of(keys, counts[counts > 0], self.time[wanted], self.step[wanted])

    def cuts(self) -> Iterable[tuple[Key, int, int]]:
        """Each entity, and where its rows begin and end."""
        return ((key, *cut) for key, cut in zip(self.keys, pairwise(self.ends.tolist()), strict=True))

    def rows(self, path: Callable[[Key], str], *parts: Iterable[Column]) -> list[Rows]:
        """The rows of each entity, with the columns (n rows each) of all of them cut up."""
        whole = [column for part in parts for column in part]
        utc, count = indexes(self.time, self.step)
        found = []
        for key, start, end in self.cuts():
            size = end - start
            cut = tuple(column.cut(start, size) for column in whole)
            at = (utc.cut(start, size), count.cut(start, size))
            found.append(Rows(path(key), self.time[start:end], self.step[start:end], at, cut))
        return found
