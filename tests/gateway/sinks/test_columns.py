"""Columns made for many entities at once are what Rerun makes of each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import rerun as rr

from gateway.sinks.scene import columns
from gateway.sinks.scene.entry import Rows, rows
from gateway.sinks.scene.sheaf import Sheaf

RANDOM = np.random.default_rng(5)
PLACE, TURNED, GROUND = RANDOM.normal(size=(6, 3)), RANDOM.normal(size=(6, 4)), RANDOM.normal(size=(6, 2))
COLOURS = [(1, 2, 3, 255), (200, 150, 100, 50)] * 3
PACKED = np.array([columns.packed(colour) for colour in ((1, 2, 3), (200, 150, 100, 50))] * 3, dtype=np.uint32)
STRIPS, FLAT = [PLACE[:2], PLACE[2:]], [GROUND[:5], GROUND[5:]]
COUNTS = [2, 0, 3, 1, 0, 0]

CASES: dict[str, tuple[Any, Any]] = {
    "points": (columns.points_3d(PLACE), rr.Points3D.columns(positions=PLACE)),
    "map": (columns.points_on_map(GROUND), rr.GeoPoints.columns(positions=GROUND)),
    "screen": (columns.points_2d(GROUND, COUNTS), rr.Points2D.columns(positions=GROUND).partition(COUNTS)),
    "labels": (columns.labels(list("abcdef")), rr.Points3D.columns(labels=list("abcdef"))),
    "one series": (columns.scalars(GROUND[:, 0]), rr.Scalars.columns(scalars=GROUND[:, 0])),
    "two series": (columns.scalars(GROUND), rr.Scalars.columns(scalars=GROUND)),
    "colours": (
        columns.point_colours(PACKED),
        [*rr.Points3D.columns(colors=COLOURS), *rr.GeoPoints.columns(colors=COLOURS)],
    ),
    "body": (columns.mesh_colours(PACKED), rr.Mesh3D.columns(albedo_factor=COLOURS)),
    "poses": (
        columns.poses(PLACE, TURNED, PLACE[:, 0]),
        rr.Transform3D.columns(translation=PLACE, quaternion=TURNED, scale=np.repeat(PLACE[:, :1], 3, axis=1)),
    ),
    "ellipsoids": (
        columns.ellipsoids(PLACE, PLACE, TURNED, PACKED),
        rr.Ellipsoids3D.columns(half_sizes=PLACE, centers=PLACE, quaternions=TURNED, colors=COLOURS),
    ),
    "lines": (columns.strips_3d(STRIPS, [2]), rr.LineStrips3D.columns(strips=STRIPS).partition([2])),
    "lines on the map": (
        columns.strips_on_map(FLAT, [1, 1]),
        rr.GeoLineStrings.columns(line_strings=FLAT).partition([1, 1]),
    ),
    "clouds": (columns.clouds_3d(STRIPS), rr.Points3D.columns(positions=PLACE).partition([2, 4])),
    "clouds on the map": (columns.clouds_on_map(FLAT), rr.GeoPoints.columns(positions=GROUND).partition([5, 1])),
}


@pytest.mark.parametrize("case", CASES)
def test_columns_are_those_of_rerun(case):
    """Names, types and values."""
    ours, theirs = ({str(one.component_descriptor()): one.as_arrow_array() for one in side} for side in CASES[case])
    assert ours.keys() == theirs.keys()
    for name, array in ours.items():
        assert array.type == theirs[name].type
        assert array.to_pylist() == theirs[name].to_pylist()


def told(entry: Rows) -> tuple[Any, ...]:
    """What can be compared of rows."""
    arrays = [part.as_arrow_array() for part in (*entry.indexes, *entry.columns)]
    return entry.path, entry.time.tolist(), entry.step.tolist(), [str(array) for array in arrays]


def test_the_rows_of_a_sheaf_are_those_of_its_entities():
    """Some rows of some entities, cut out of columns of all; an entity without rows is not there."""
    sheaf = Sheaf.of(["/a", "/b", "/c"], [2, 3, 1], np.arange(6) * 10, np.arange(6))
    wanted = np.array([False, True, True, True, False, False])
    found = sheaf.where(wanted).rows(str, columns.points_3d(PLACE[wanted]))
    alone = [
        rows("/a", [10], [1], rr.Points3D.columns(positions=PLACE[1:2])),
        rows("/b", [20, 30], [2, 3], rr.Points3D.columns(positions=PLACE[2:4])),
    ]
    assert [told(entry) for entry in found] == [told(entry) for entry in alone]
