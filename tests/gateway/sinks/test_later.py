"""Of a crowd, curves and trails are drawn in larger batches than what moves; nothing of them is lost."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr

from gateway.settings import DEMO_SITE
from gateway.sinks import rerun
from gateway.sinks.rerun import RerunSink
from gateway.sinks.scene.entry import Always, rows
from gateway.sinks.scene.later import Later


def test_what_moves_is_not_kept_back():
    """Points go at once, and what holds at all times; curves and trails wait."""
    place = rr.Points3D.columns(positions=np.zeros((1, 3)))
    point, trail = rows("/fuse/1", [0], [0], place), rows("/fuse/1/trail/0", [0], [0], place)
    curve = rows("/fuse/sigma/1", [0], [0], rr.Scalars.columns(scalars=[1.0]))
    look = Always("/fuse/sigma/1", (rr.SeriesLines(names="sigma"),))
    later = Later()
    assert later.without([point, trail, curve, look]) == [point, look]
    assert later.take() == [trail, curve]
    assert later.take() == []


def test_rows_of_one_entity_are_put_together_as_they_came():
    parts = [rows("/fuse/sigma/1", [at], [at], rr.Scalars.columns(scalars=[[float(at), 0.5]])) for at in range(3)]
    later = Later()
    for part in parts:
        later.without([part])
    (whole,) = later.take()
    assert whole.time.tolist() == whole.step.tolist() == [0, 1, 2]
    assert [index.as_arrow_array().cast("int64").to_pylist() for index in whole.indexes] == [[0, 1, 2], [0, 1, 2]]
    assert whole.columns[0].as_arrow_array().to_pylist() == [[0.0, 0.5], [1.0, 0.5], [2.0, 0.5]]


@pytest.mark.parametrize("seconds", [7.0, 20.0])
def test_a_recording_of_a_crowd_has_the_same_rows(tmp_path, pictures, read, monkeypatch, seconds):
    """Wherever its end falls between two batches of curves."""
    found = []
    for name, entity_ns in (("few", 0), ("crowd", 30_000_000)):
        monkeypatch.setattr(rerun, "_ENTITY_NS", entity_ns)
        sink = RerunSink(DEMO_SITE, path=tmp_path / f"{name}.rrd", modes=True)
        sink.write_all(pictures(seconds))
        sink.close()
        entities = read(tmp_path / f"{name}.rrd")
        found.append(
            {path: [(row.get("utc"), row.get("Scalars:scalars")) for row in rows] for path, rows in entities.items()}
        )
    few, crowd = found
    assert few.keys() == crowd.keys()
    for path in ("/fuse/1", "/fuse/sigma/1", "/fuse/modes/1", "/fuse/1/trail/0", "/approach/1"):
        assert few[path] == crowd[path]
