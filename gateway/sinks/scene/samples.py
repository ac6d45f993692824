"""Rows of plots, gathered one by one and sent an entity at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr

from gateway.sinks.scene.entry import Always, Entry, rows
from gateway.sinks.scene.lately import Lately


class Sample(NamedTuple):
    """One row of a plot: a value for each series, NaN where it has none now. Series that come later stand behind."""

    path: str
    time: int
    step: int
    values: tuple[float, ...]
    names: tuple[str, ...]


def plotted(samples: Sequence[Sample], named: Lately[str]) -> list[Entry]:
    """Samples as rows, an entity at a time; `named` are the entities whose series have their names already."""
    found: dict[str, list[Sample]] = {}
    for sample in samples:
        found.setdefault(sample.path, []).append(sample)
    entries: list[Entry] = []
    for path, mine in found.items():
        mine.sort(key=lambda sample: sample.time)
        names = max((sample.names for sample in mine), key=len)
        if named.is_new(path, mine[-1].time):
            entries.append(Always(path, (rr.SeriesLines(names=names),)))
        table = np.full((len(mine), len(names)), np.nan)
        for row, sample in zip(table, mine, strict=True):
            row[: len(sample.values)] = sample.values
        values = rr.Scalars.columns(scalars=table)
        time, step = [sample.time for sample in mine], [sample.step for sample in mine]
        entries.append(rows(path, time, step, values))
    return entries
