"""Arrival flows as Parquet: who belongs to which, and the mean track of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from gateway.offline.flows import Flows, Track


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
