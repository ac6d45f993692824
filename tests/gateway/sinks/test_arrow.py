"""The archive's tables: what is written is what was found, and nothing whole is lost."""

from __future__ import annotations

import math
import resource
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from gateway.sinks.arrow import ArrowSink
from gateway.sinks.parquet import finish, unfinished, whole_batches


def write_all(sink: ArrowSink, pictures: list) -> None:
    for picture in pictures:
        sink.write(picture)


def archive(folder: Path, pictures: list, **options: float) -> None:
    with ArrowSink(folder, **options) as sink:
        write_all(sink, pictures)


def test_tables_have_the_columns_that_other_programs_read(tmp_path, pictures):
    archive(tmp_path, pictures(6.0))
    finish(tmp_path)
    time = pa.timestamp("ns", tz="UTC")
    tracks = pq.read_schema(tmp_path / "tracks.parquet")
    assert " ".join(tracks.names) == (
        "time received track aircraft radar_track updated_by state latitude_deg longitude_deg height_m altitude_msl_m "
        "velocity_east_mps velocity_north_mps velocity_up_mps covariance straight left right "
        "pressure_altitude_m callsign life wind_east_mps wind_north_mps"
    )
    assert (tracks.field("time").type, tracks.field("received").type) == (time, time)
    assert tracks.field("track").type == pa.int64()
    assert tracks.field("covariance").type.list_size == 36
    predictions = pq.read_schema(tmp_path / "predictions.parquet")
    assert " ".join(predictions.names) == (
        "made track valid horizon_s latitude_deg longitude_deg height_m sigma_m method intent intent_kind confidence "
        "sigma_along_m sigma_across_m course_deg"
    )
    truth = pq.read_schema(tmp_path / "truth.parquet")
    assert " ".join(truth.names) == (
        "time aircraft latitude_deg longitude_deg height_m velocity_east_mps velocity_north_mps velocity_up_mps mode"
    )


def test_rows_stand_in_the_order_in_which_they_were_written_bit_for_bit(tmp_path, pictures):
    made = pictures(40.0)
    archive(tmp_path, made)
    finish(tmp_path)
    table = pq.read_table(tmp_path / "tracks.parquet")
    time = np.concatenate([one.fuse.time for one in made])
    assert (np.diff(time) < 0).any()  # late corrections are among them
    assert table["time"].cast(pa.int64()).to_numpy().tolist() == time.tolist()
    height = np.concatenate([one.fuse.height_m for one in made])
    assert table["height_m"].to_numpy().tobytes() == height.tobytes()
    latitude = np.degrees(np.concatenate([one.fuse.latitude_rad for one in made]))
    assert table["latitude_deg"].to_numpy().tobytes() == latitude.tobytes()
    covariance = np.concatenate([one.fuse.covariance for one in made])
    stored = table["covariance"].combine_chunks().flatten().to_numpy()
    assert stored.tobytes() == covariance.tobytes()


def test_what_is_not_known_is_null(tmp_path, pictures):
    picture = next(one for one in pictures(6.0, modes=False) if len(one.fuse.time))
    rows = len(picture.fuse.time)
    unknown = replace(
        picture.fuse, received=np.full(rows, -1), height_m=np.full(rows, math.nan), aircraft=(None,) * rows
    )
    archive(tmp_path, [replace(picture, fuse=unknown)])
    finish(tmp_path)
    table = pq.read_table(tmp_path / "tracks.parquet")
    for name in ("received", "height_m", "aircraft", "straight", "left", "right"):
        assert table[name].null_count == rows, name
    assert table["altitude_msl_m"].null_count == 0
    assert pq.read_table(tmp_path / "predictions.parquet")["confidence"].null_count == len(picture.predict.made)


def test_truth_above_mean_sea_level_is_lifted_by_the_geoid(tmp_path, pictures):
    picture = pictures(0.2)[0]
    truth = replace(picture.truth[0], height_m=None, altitude_msl_m=535.0)
    unknown = replace(truth, altitude_msl_m=None)
    archive(tmp_path, [replace(picture, truth=(truth, unknown))], geoid_separation_m=-35.0)
    finish(tmp_path)
    assert pq.read_table(tmp_path / "truth.parquet")["height_m"].to_pylist() == [500.0, None]


def test_rows_older_than_a_second_are_on_disk_while_the_session_runs(tmp_path, pictures):
    made = pictures(10.0)
    sink = ArrowSink(tmp_path)
    for picture in made:
        sink.write(picture)
    on_disk = sum(len(batch) for batch in whole_batches(tmp_path / "truth.arrows"))
    told = [row for picture in made for row in picture.truth]
    last_second = [row for row in told if row.valid_at > made[-1].now - 1_000_000_000]
    assert on_disk >= len(told) - len(last_second)
    sink.close()


def test_a_stream_cut_at_any_byte_keeps_every_whole_batch(tmp_path, pictures):
    archive(tmp_path, pictures(20.0))
    stream = tmp_path / "tracks.arrows"
    data = stream.read_bytes()
    lengths = [len(batch) for batch in whole_batches(stream)]
    assert len(lengths) >= 3
    kept = []
    for cut in range(0, len(data) + 1, 41):
        stream.write_bytes(data[:cut])
        got = [len(batch) for batch in whole_batches(stream)]
        assert got == lengths[: len(got)]
        kept.append(len(got))
    assert kept == sorted(kept)
    assert kept[0] == 0
    assert kept[-1] >= len(lengths) - 1


def test_finish_makes_parquet_of_a_cut_stream_and_takes_the_stream_away(tmp_path, pictures):
    archive(tmp_path, pictures(20.0))
    stream = tmp_path / "tracks.arrows"
    whole = sum(len(batch) for batch in whole_batches(stream))
    stream.write_bytes(stream.read_bytes()[:-100])
    assert unfinished(tmp_path)
    made = [path.name for path in finish(tmp_path)]
    assert made == ["tracks.parquet", "predictions.parquet", "conflicts.parquet", "truth.parquet"]
    assert 0 < pq.read_table(tmp_path / "tracks.parquet").num_rows < whole
    assert not unfinished(tmp_path)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".parquet"] * 4
    assert finish(tmp_path) == ()


def test_a_stream_of_an_earlier_release_gets_null_in_the_columns_that_it_lacks(tmp_path, pictures):
    archive(tmp_path, pictures(6.0))
    stream = tmp_path / "tracks.arrows"
    lacking = pa.Table.from_batches(whole_batches(stream)).drop_columns(["pressure_altitude_m", "callsign"])
    with pa.ipc.new_stream(stream, lacking.schema) as writer:
        writer.write_table(lacking)
    finish(tmp_path)
    table = pq.read_table(tmp_path / "tracks.parquet")
    assert table.num_rows == lacking.num_rows > 0
    assert table["callsign"].null_count == table.num_rows
    assert table["height_m"].equals(lacking["height_m"])


def test_a_stream_without_a_byte_becomes_an_empty_table(tmp_path):
    (tmp_path / "tracks.arrows").touch()
    finish(tmp_path)
    assert pq.read_table(tmp_path / "tracks.parquet").num_rows == 0


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file of this process may grow beyond 24 kB: what a full disk looks like to a writer."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (24_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_raises_and_leaves_whole_batches(tmp_path, pictures, small_disk):
    made = pictures(60.0)
    sink = ArrowSink(tmp_path)
    with pytest.raises(OSError, match=r"could not be written.*\.arrows"):
        write_all(sink, made)
    sink.close()  # it was said: closing is silent
    for stream in tmp_path.glob("*.arrows"):
        assert stream.stat().st_size <= 24_000
        with pa.memory_map(str(stream)) as source:  # no half batch stands at its end
            rows = pa.ipc.open_stream(source).read_all().num_rows
        assert rows > 0 or stream.stem == "conflicts"  # of one aircraft there are none


def test_a_session_that_was_killed_lacks_at_most_the_last_second(tmp_path):
    """kill -9 between two flushes: the tables hold everything up to the last flush."""
    script = (
        "import os, sys, runpy; from pathlib import Path; from gateway.sinks.arrow import ArrowSink\n"
        "make = runpy.run_path(sys.argv[1])['make_pictures']\n"
        "sink = ArrowSink(Path(sys.argv[2]))\n"
        "for picture in make(10.0): sink.write(picture)\n"
        "os.kill(os.getpid(), 9)"
    )
    made = Path(__file__).with_name("conftest.py")
    subprocess.run([sys.executable, "-c", script, str(made), str(tmp_path)], check=False)
    finish(tmp_path)
    seconds = pq.read_table(tmp_path / "truth.parquet")["time"].cast(pa.int64()).to_numpy()
    assert seconds.max() - seconds.min() >= 8_000_000_000
