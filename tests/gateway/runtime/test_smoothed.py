"""Smoothing after a session: what waits on the disk, scores, and tables that are whole or not there."""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from gateway.observation import Truth
from gateway.runtime.smoothed import Smoothing
from gateway.runtime.spool import Spool
from gateway.settings import Options
from gateway.sinks.batches import TRACKS
from gateway.sinks.parquet import SmoothedTable


def truths(world: Any, seconds: float) -> list[Truth]:
    said = []
    for t in np.arange(0.0, seconds, 0.5).tolist():
        latitude, longitude, height = world.frame.geodetic_from_runway(world.Course().at(t))
        at = world.at(t)
        said.append(Truth("mavlink:1", at, at + 10_000_000, float(latitude), float(longitude), height_m=float(height)))
    return said


def test_what_is_kept_is_read_again_and_forgotten() -> None:
    """Values of any size in any order; the file is used again from its beginning."""
    spool = Spool(None)
    first, second = spool.keep({"a": np.arange(5)}), spool.keep("b" * 10_000)
    assert spool.read(second) == "b" * 10_000
    assert spool.read(first)["a"].tolist() == [0, 1, 2, 3, 4]
    spool.forget()
    again = spool.keep("c")
    assert again[0] == 0
    assert spool.read(again) == "c"
    spool.close()
    spool.close()


def test_nothing_of_the_spool_stays_in_the_folder(tmp_path: Path) -> None:
    """It has no name, so that a program that is killed leaves nothing behind."""
    spool = Spool(tmp_path)
    spool.keep(np.zeros(1000))
    left = list(tmp_path.iterdir())
    spool.close()
    assert [*left, *tmp_path.iterdir()] == []


def smoothed(world: Any, options: Options, told: list[float]) -> tuple[Smoothing, list[Any]]:
    """A noisy flight with its truth, smoothed: and the rows that were given."""
    ran = world.run([*world.flight(seconds=50.0), *truths(world, 55.0)], ticks="20 ms", options=options)
    smoothing = Smoothing(world.site, options, None)
    for picture in ran.pictures:
        smoothing.add(picture)
    given: list[Any] = []
    smoothing.finish(ran.state.lanes, lambda rows, step: given.append((rows, step)), told.append)
    smoothing.close()
    return smoothing, given


def test_scores_are_of_the_same_rows_before_and_after(world: Any) -> None:
    """Filtered and smoothed are counted alike, each state by itself and all together; the progress ends at 1."""
    told: list[float] = []
    smoothing, given = smoothed(world, Options(), told)
    scores = smoothing.scores()
    assert set(scores) == {"fused", "gps only", "coasting", "all"}
    assert all(score.filtered.count == score.smoothed.count for score in scores.values())
    assert scores["all"].smoothed.count == sum(score.smoothed.count for kind, score in scores.items() if kind != "all")
    assert scores["fused"].smoothed.rmse_m < 0.75 * scores["fused"].filtered.rmse_m
    assert smoothing.rows == sum(len(rows.time) for rows, _ in given) > 100
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_rows_are_given_track_by_track_in_the_order_of_time(world: Any) -> None:
    """Whoever draws or writes them need not sort; each comes with the number of the picture that first had it."""
    _, given = smoothed(world, Options(), [])
    keys = [(int(t), int(at)) for rows, _ in given for t, at in zip(rows.track, rows.time, strict=True)]
    assert keys == sorted(set(keys))
    assert all(len(step) == len(rows.time) for rows, step in given)


def test_without_truth_there_is_no_score(world: Any) -> None:
    """Nothing is compared where nothing is known."""
    ran = world.run(world.flight(seconds=20.0))
    smoothing = Smoothing(world.site, Options(), None)
    smoothing.add(ran.pictures[0])
    smoothing.finish(ran.state.lanes, lambda rows, step: None, lambda share: None)
    smoothing.close()
    assert smoothing.scores() == {}
    assert smoothing.rows > 0


def test_the_table_has_the_tracks_columns_and_is_whole_or_absent(world: Any, tmp_path: Path) -> None:
    """smoothed.parquet appears when it is finished; one that is abandoned leaves nothing."""
    _, given = smoothed(world, Options(), [])
    table = SmoothedTable(tmp_path)
    for rows, _ in given:
        table.write(rows)
    assert not (tmp_path / "smoothed.parquet").exists()
    table.finish()
    written = pq.read_table(tmp_path / "smoothed.parquet")
    assert written.schema.equals(TRACKS)
    assert written.num_rows == sum(len(rows.time) for rows, _ in given)
    other = tmp_path / "other"
    other.mkdir()
    abandoned = SmoothedTable(other)
    abandoned.write(given[0][0])
    abandoned.abandon()
    assert list(other.iterdir()) == []


def test_a_full_disk_is_an_oserror(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """What must wait and cannot is said to who runs the session."""

    def full(self: Spool, value: Any) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    ran = world.run(world.flight(seconds=20.0))
    smoothing = Smoothing(world.site, Options(), None)
    smoothing.add(ran.pictures[0])
    monkeypatch.setattr(Spool, "keep", full)
    with pytest.raises(OSError, match="No space"):
        smoothing.finish(ran.state.lanes, lambda rows, step: None, lambda share: None)
    smoothing.close()
