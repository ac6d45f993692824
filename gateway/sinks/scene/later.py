"""Curves and trails of a crowd wait, so that what moves can be drawn often: they are read over minutes, not seconds.

An entity costs the same for one row as for a hundred, and of what is drawn of an aircraft half are curves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa

from gateway.sinks.scene.columns import SCALARS, Column
from gateway.sinks.scene.entry import Always, Entry, Index, Rows

_Likeness = tuple[str, ...]


class Later:
    """Rows that wait, by their entity; those of one entity are put together."""

    def __init__(self) -> None:
        self._waiting: dict[_Likeness, list[Rows]] = {}

    def __len__(self) -> int:
        """Of how many entities rows wait."""
        return len(self._waiting)

    def without(self, entries: Sequence[Entry]) -> list[Entry]:
        """Keep curves and trails back; the others."""
        others: list[Entry] = []
        for entry in entries:
            if isinstance(entry, Always) or not can_wait(entry):
                others.append(entry)
            else:
                self._waiting.setdefault((entry.path, *_names(entry)), []).append(entry)
        return others

    def take(self) -> list[Rows]:
        """All that waits."""
        waiting, self._waiting = self._waiting, {}
        return [_together(rows) if len(rows) > 1 else rows[0] for rows in waiting.values()]


def can_wait(rows: Rows) -> bool:
    """Whether rows are a curve's or a trail's."""
    return _names(rows) == (str(SCALARS),) or "/trail/" in rows.path


def _names(rows: Rows) -> _Likeness:
    return tuple(str(column.component_descriptor()) for column in rows.columns)


def _together(parts: Sequence[Rows]) -> Rows:
    """Rows of one entity with the same components, one part behind the other."""
    first = parts[0]
    indexes = [
        Index(one.name, pa.concat_arrays([part.indexes[place].array for part in parts]))
        for place, one in enumerate(first.indexes)
    ]
    columns = [
        Column(one.component_descriptor(), pa.concat_arrays([part.columns[place].as_arrow_array() for part in parts]))
        for place, one in enumerate(first.columns)
    ]
    time, step = (np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "step"))
    return Rows(first.path, time, step, (indexes[0], indexes[1]), tuple(columns))
