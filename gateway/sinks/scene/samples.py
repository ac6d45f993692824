"""Rows of plots, gathered one by one and sent an entity at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr

from gateway.sinks.scene import columns
from gateway.sinks.scene.entry import Always, Entry
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.sheaf import Sheaf


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
    ordered: list[Sample] = []
    widths: list[int] = []
    for path, mine in found.items():
        mine.sort(key=lambda sample: sample.time)
        names = max((sample.names for sample in mine), key=len)
        if named.is_new(path, mine[-1].time):
            entries.append(Always(path, (rr.SeriesLines(names=names),)))
        ordered += mine
        widths += [len(names)] * len(mine)
    if not ordered:
        return entries
    values = [
        value
        for sample, width in zip(ordered, widths, strict=True)
        for value in (*sample.values, *(math.nan,) * (width - len(sample.values)))
    ]
    time, step = [sample.time for sample in ordered], [sample.step for sample in ordered]
    sheaf = Sheaf.of(list(found), [len(mine) for mine in found.values()], time, step)
    return [*entries, *sheaf.rows(str, columns.scalars_of(np.array(values), widths))]
