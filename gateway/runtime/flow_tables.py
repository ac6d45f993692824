"""Arrival flows as Parquet, who belongs to which and the mean track of each, and as the few points that predictions want."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from gateway.offline.flows import Flow, Flows, Track
from gateway.predict import ArrivalFlow
from gateway.runtime.arrivals import onto_level

Floats = NDArray[np.float64]

OFF_M = 500.0  # the points that are kept lead so near to the mean track, in three dimensions


def write_flows(tracks: Sequence[Track], flows: Flows, folder: Path) -> tuple[Path, Path]:
    """memberships.parquet, a row a flight, and flows.parquet, a row a point of a mean track. Raises OSError."""
    members, means = folder / "memberships.parquet", folder / "flows.parquet"
    numbers = [None if label < 0 else label + 1 for label in flows.labels.tolist()]
    pq.write_table(
        pa.table(
            {
                "flight": [track.name for track in tracks],
                "flow": pa.array(numbers, pa.int64()),
                "membership": pa.array(flows.membership),
                "aside_m": pa.array(flows.aside_m, from_pandas=True),
                "duration_s": pa.array([float(track.time_s[-1] - track.time_s[0]) for track in tracks]),
            }
        ),
        members,
    )
    points = [(number, flow) for number, flow in enumerate(flows.flows, 1)]
    columns = {
        "flow": np.concatenate(
            [np.full(len(flow.mean_m), number) for number, flow in points] or [np.zeros(0, np.int64)]
        ),
        **{
            name: np.concatenate([values[:, axis] for values in of] or [np.zeros(0)])
            for of, names in (
                ([flow.mean_m for _, flow in points], ("east_m", "north_m", "height_m")),
                ([flow.spread_m for _, flow in points], ("lateral_spread_m", "vertical_spread_m")),
            )
            for axis, name in enumerate(names)
        },
    }
    pq.write_table(pa.table({name: pa.array(column) for name, column in columns.items()}), means)
    return members, means


def ways_of(flows: Sequence[Flow], airport_deg: tuple[float, float]) -> tuple[ArrivalFlow, ...]:
    """Each flow's mean track as few points."""
    onto, made = onto_level(airport_deg), []
    for number, flow in enumerate(flows, 1):
        points = flow.mean_m[corners(flow.mean_m, OFF_M)]
        longitude, latitude = onto(points[:, 0], points[:, 1], inverse=True)
        places = np.stack([np.radians(latitude), np.radians(longitude), points[:, 2]], axis=-1)
        spread_m = float(np.median(flow.spread_m[:, 0]))
        made.append(ArrivalFlow(number, len(flow.flights), spread_m, tuple(tuple(row) for row in places.tolist())))
    return tuple(made)


def corners(line: Floats, off_m: float) -> list[int]:
    """Which points of a line (n, d) are enough for no other to be further than `off_m` from it. Douglas and Peucker's method."""
    kept, spans = {0, len(line) - 1}, [(0, len(line) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        begin, step = line[first], line[last] - line[first]
        to = line[first + 1 : last] - begin
        share = np.clip(to @ step / max(float(step @ step), 1e-9), 0.0, 1.0)
        off = np.linalg.norm(to - share[:, None] * step, axis=1)
        furthest = int(off.argmax())
        if off[furthest] > off_m:
            middle = first + 1 + furthest
            kept.add(middle)
            spans += [(first, middle), (middle, last)]
    return sorted(kept)
