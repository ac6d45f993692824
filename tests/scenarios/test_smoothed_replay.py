"""talkdown replay --smooth: a table beside the tracks, the same each time, drawn and scored; and what it cannot do."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Setup

Talkdown = Callable[..., Any]
KEPT = ("received", "aircraft", "radar_track", "updated_by", "state", "callsign", "life")


def smoothed(source: Path, archive: Path, step_ns: int | None = None) -> tuple[Path, Any]:
    """The folder of a replay that was smoothed, and its summary."""
    playback = open_playback([source])
    setup = Setup(playback.place, playback.options, archive, is_watched=False, smooth=True)
    summary = run_replay(playback, setup, step_ns=step_ns)
    assert summary.archive is not None
    return summary.archive, summary


@pytest.fixture(scope="module")
def once(approach: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The approach smoothed once."""
    return smoothed(approach, tmp_path_factory.mktemp("smoothed"))


def test_each_final_row_has_a_smoothed_one(once: tuple[Path, Any]) -> None:
    """The same columns; for a track and time the words of the last row, and no row of a time that the tracks do not have."""
    folder, summary = once
    tracks, found = (pq.read_table(folder / name) for name in ("tracks.parquet", "smoothed.parquet"))
    assert found.schema.equals(tracks.schema)
    assert found.num_rows == summary.smoothed.rows
    last = {(row["track"], row["time"]): row for row in tracks.to_pylist()}
    rows = {(row["track"], row["time"]): row for row in found.to_pylist()}
    assert len(rows) == found.num_rows
    assert rows.keys() <= last.keys()
    assert all(row[name] == last[key][name] for key, row in rows.items() for name in KEPT)
    without = [key for key in last if key not in rows]  # plots that became the aircraft's in hindsight
    assert {last[key]["aircraft"] for key in without} <= {None}
    assert len(without) < 0.05 * len(last)


def test_the_tracks_are_those_of_a_replay_without(once: tuple[Path, Any], approach: Path, tmp_path: Path) -> None:
    """Smoothing changes no row of tracks.parquet."""
    playback = open_playback([approach])
    plain = run_replay(playback, Setup(playback.place, playback.options, tmp_path, is_watched=False)).archive
    assert plain is not None
    assert pq.read_table(plain / "tracks.parquet").equals(pq.read_table(once[0] / "tracks.parquet"))
    assert not (plain / "smoothed.parquet").exists()


@pytest.mark.parametrize("step_ns", [None, 20_000_000])
def test_smoothed_twice_is_the_same_to_the_bit(
    once: tuple[Path, Any], approach: Path, tmp_path: Path, step_ns: int | None
) -> None:
    """However the arrivals fall into steps."""
    again, _ = smoothed(approach, tmp_path, step_ns)
    one, other = (pq.read_table(folder / "smoothed.parquet") for folder in (once[0], again))
    assert one.equals(other)
    assert one["covariance"].combine_chunks().flatten().equals(other["covariance"].combine_chunks().flatten())


def test_the_summary_compares_them(once: tuple[Path, Any]) -> None:
    """Before and after, in the summary and in session.json; smoothed is nearer to the truth by a quarter at least."""
    score = once[1].smoothed.accuracy["fused"]
    assert score.smoothed.rmse_m <= 0.75 * score.filtered.rmse_m
    assert once[1].document()["smoothed"]["accuracy"]["fused"]["smoothed"]["rmse_m"] == score.smoothed.rmse_m


def test_without_an_archive_it_is_scored_and_says_how_to_keep_it(talkdown: Talkdown, approach: Path) -> None:
    """One sentence, and the scores."""
    ended = talkdown("replay", approach, "--viewer", "none", "--smooth", "--estimator", "rmimm", "--to", "40", "--json")
    assert ended.code == 0
    assert "--archive" in ended.err
    assert ended.summary["smoothed"]["accuracy"]["fused"]["filtered"]["count"] > 20


def test_an_estimator_without_covariances_is_refused(talkdown: Talkdown, approach: Path) -> None:
    """The light filter's states cannot be gone back over: said with what to choose, before anything is done."""
    ended = talkdown("replay", approach, "--viewer", "none", "--smooth", "--estimator", "alpha-beta-gamma")
    assert ended.code == 2
    assert "--estimator kalman, imm or rmimm" in ended.sentence
