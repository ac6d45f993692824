"""Smoothed tracks in the recording: beside the filter's, at their own times, gone when the track is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.offline.pieces import chosen, joined
from gateway.settings import DEMO_SITE
from gateway.sinks.parquet import finish
from gateway.sinks.rerun import RerunSink


@pytest.fixture(scope="module")
def drawn(
    tmp_path_factory: pytest.TempPathFactory, pictures: Any, read: Any
) -> tuple[Any, dict[str, list[dict[str, Any]]]]:
    """A session of 100 s whose rows are drawn as smoothed ones as well, in two pieces; and what is in its file."""
    made = pictures(100.0)
    path = tmp_path_factory.mktemp("drawn") / "a.rrd"
    sink = RerunSink(DEMO_SITE, path=path, period_s=30.0, rows_limit=4096)
    for picture in made:
        sink.write(picture)
    every = joined([picture.fuse for picture in made])
    order = np.flatnonzero(every.time >= np.maximum.accumulate(every.time))
    track = chosen(every, order[every.track[order] == 1])
    half = len(track.time) // 2
    for places in (np.arange(half), np.arange(half, len(track.time))):
        sink.write_smoothed(chosen(track, places), places)
    sink.end_smoothed(1, int(track.time[-1]) + 10**9, len(made))
    sink.close()
    return track, read(path)


def test_each_row_stands_at_its_time_in_the_scene_and_on_the_map(drawn: Any) -> None:
    """Its place, and its sigma among the sigmas; beside the filter's own rows, which stay."""
    track, found = drawn
    placed = [row for row in found["/fuse/smoothed/1"] if row.get("Points3D:positions")]
    assert [row["utc"] for row in placed if "utc" in row] == track.time.tolist()
    assert placed[-1]["Points3D:positions"][0] == pytest.approx(track.runway_m[-1].tolist(), rel=1e-6)
    assert placed[-1]["GeoPoints:positions"][0] == pytest.approx(
        [np.degrees(track.latitude_rad[-1]), np.degrees(track.longitude_rad[-1])], abs=1e-12
    )
    sigma = [row for row in found["/fuse/sigma/smoothed/1"] if "utc" in row][-1]["Scalars:scalars"]
    variance = track.covariance[-1].reshape(6, 6).diagonal()
    assert sigma == pytest.approx([np.sqrt(0.5 * (variance[0] + variance[1])), np.sqrt(variance[2])])
    assert len(found["/fuse/1"]) > 100


def test_its_line_is_of_its_own_colour_and_goes_on_over_the_pieces(drawn: Any) -> None:
    """Segments of a minute that join, in a colour that no other track has."""
    _, found = drawn
    lines = {path: found[path] for path in found if path.startswith("/fuse/smoothed/1/trail/")}
    assert len(lines) == 2
    colours = {row["LineStrips3D:colors"][0] for line in lines.values() for row in line if "LineStrips3D:colors" in row}
    others = {row["LineStrips3D:colors"][0] for row in found["/fuse/1/trail/0"] if "LineStrips3D:colors" in row}
    assert len(colours) == 1
    assert colours.isdisjoint(others)


def test_it_is_on_the_controllers_screen(drawn: Any) -> None:
    """Where the filter's dots are, one for each row that is on the screen."""
    track, found = drawn
    dots = [row["utc"] for row in found["/approach/scope/smoothed/1"] if "utc" in row]
    assert dots == [row["utc"] for row in found["/approach/scope/1"] if "utc" in row]
    assert 0 < len(dots) <= len(track.time)


def test_a_track_that_ended_takes_its_smoothed_one_along(drawn: Any) -> None:
    """The last thing that is told of it is that it is gone, with all that is below it."""
    track, found = drawn
    last = found["/fuse/smoothed/1"][-1]
    assert last["utc"] > track.time[-1]
    assert last["Clear:is_recursive"] == [True]


def test_what_a_killed_smoothing_left_goes_with_the_next_command(tmp_path: Path) -> None:
    """Half a table is no table."""
    (tmp_path / "smoothed.parquet.part").write_bytes(b"PAR1")
    finish(tmp_path)
    assert list(tmp_path.iterdir()) == []
