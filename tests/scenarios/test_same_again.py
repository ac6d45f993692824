"""A session gives the same numbers again, however its arrivals fall into steps."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Setup

Talkdown = Callable[..., Any]
STEPS_NS = {"one arrival": 0, "20 ms": 20_000_000, "everything": 10**18}


def same(one: Path, other: Path) -> bool:
    """Whether two Parquet files hold the same rows in the same order to the bit (NaN equals NaN, null equals null)."""

    mine, theirs = pq.read_table(one), pq.read_table(other)
    return bool(mine.schema.equals(theirs.schema)) and all(
        _bits(mine[name]) == _bits(theirs[name]) for name in mine.column_names
    )


def _bits(column: pa.ChunkedArray) -> list[bytes | None]:
    whole = pa.concat_arrays(column.chunks)
    return [None if buffer is None else buffer.to_pybytes() for buffer in whole.buffers()]


@pytest.fixture(scope="module")
def replayed(approach: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The approach replayed once and archived; its folder."""
    archive = tmp_path_factory.mktemp("once")
    return _archived(approach, archive)


def _archived(source: Path, archive: Path, step_ns: int | None = None) -> Path:
    playback = open_playback([source])
    setup = Setup(place=playback.place, options=playback.options, archive=archive, is_watched=False)
    summary = run_replay(playback, setup, step_ns=step_ns)
    assert summary.archive is not None
    return summary.archive


@pytest.mark.parametrize("step", STEPS_NS)
def test_how_arrivals_fall_into_steps_changes_no_bit(replayed: Path, approach: Path, tmp_path: Path, step: str) -> None:
    again = _archived(approach, tmp_path, STEPS_NS[step])
    for table in ("tracks.parquet", "predictions.parquet", "truth.parquet"):
        assert same(replayed / table, again / table)


def test_the_archive_of_a_replay_gives_the_same_again(replayed: Path, tmp_path: Path) -> None:
    again = _archived(replayed, tmp_path)
    for table in ("tracks.parquet", "predictions.parquet", "truth.parquet"):
        assert same(replayed / table, again / table)
    for name in ("mavlink-1.tlog", "radar-1.pcap"):
        assert (replayed / "inputs" / name).read_bytes() == (again / "inputs" / name).read_bytes()


def test_the_comparison_sees_a_single_other_number(replayed: Path, tmp_path: Path) -> None:
    shutil.copytree(replayed, tmp_path / "changed")
    table = pq.read_table(replayed / "tracks.parquet")
    heights = table["height_m"].to_pylist()
    heights[len(heights) // 2] += 1e-9
    index = table.schema.get_field_index("height_m")
    pq.write_table(
        table.set_column(index, table.schema.field(index), [heights]), tmp_path / "changed" / "tracks.parquet"
    )
    assert not same(replayed / "tracks.parquet", tmp_path / "changed" / "tracks.parquet")
