"""Fuse: one state for each aircraft from everything that saw it (paper 003, 2.4).

`lanes` keeps each system track's recent past, so that late data go back to their place; `filtering` runs the filter over
many tracks at once; `weighting` holds the four ways to weigh a position source against a radar; `rows` makes the result.
"""

from gateway.fuse.lanes import (
    Ended,
    Lane,
    Lanes,
    Scene,
    contains,
    emptied,
    end_silent,
    joined,
    lane_of,
    reroute,
    take_fix,
    take_plot,
)
from gateway.fuse.rows import Fused, Row, coast, table, work

__all__ = [
    "Ended",
    "Fused",
    "Lane",
    "Lanes",
    "Row",
    "Scene",
    "coast",
    "contains",
    "emptied",
    "end_silent",
    "joined",
    "lane_of",
    "reroute",
    "table",
    "take_fix",
    "take_plot",
    "work",
]
