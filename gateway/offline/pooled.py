"""The scores of many sessions as one: what `score.scores` would say of all their predictions together, but for rounding."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

from gateway.offline.score import Score


def pooled(sessions: Iterable[Sequence[Score]]) -> list[Score]:
    """Rows by group and horizon, of those of each session; groups in the order in which they are met, horizons ascending."""
    groups: defaultdict[str, defaultdict[float, list[Score]]] = defaultdict(lambda: defaultdict(list))
    for rows in sessions:
        for row in rows:
            groups[row.group][row.horizon_s].append(row)
    return [
        _joined(group, horizon_s, rows)
        for group, horizons in groups.items()
        for horizon_s, rows in sorted(horizons.items())
    ]


def _joined(group: str, horizon_s: float, rows: Sequence[Score]) -> Score:
    counts, heights = [row.count for row in rows], [row.heights for row in rows]

    def rms(value: Callable[[Score], float], weights: Sequence[int]) -> float:
        pairs = [(value(row), weight) for row, weight in zip(rows, weights, strict=True) if weight]
        whole = sum(weights)
        return math.sqrt(math.fsum(weight * one * one for one, weight in pairs) / whole) if whole else math.nan

    def share(value: Callable[[Score], float]) -> float:
        return math.fsum(count * value(row) for row, count in zip(rows, counts, strict=True)) / sum(counts)

    return Score(
        group,
        horizon_s,
        sum(counts),
        rms(lambda row: row.rms_m, counts),
        rms(lambda row: row.straight_on_rms_m, counts),
        rms(lambda row: row.along_rms_m, counts),
        rms(lambda row: row.across_rms_m, counts),
        rms(lambda row: row.height_rms_m, heights),
        sum(heights),
        (share(lambda row: row.along_within[0]), share(lambda row: row.along_within[1])),
        (share(lambda row: row.across_within[0]), share(lambda row: row.across_within[1])),
        math.fsum(row.along_independent for row in rows),
        math.fsum(row.across_independent for row in rows),
    )
