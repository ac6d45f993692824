"""What a recording tells of flights beside their parameters: which radar track a session took for which aircraft."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from gateway.runtime.flights import radar_tracks


def test_a_radar_track_is_the_aircraft_s_that_it_was_taken_for_most(tmp_path: Path) -> None:
    """A moment's mistake at a crossing does not count; rows without an aircraft, or without a radar, say nothing."""
    aircraft = ["mavlink:1"] * 5 + ["mavlink:2"] + [None, "mavlink:2"]
    names = ["1/3"] * 3 + ["1/3 2/7"] * 2 + ["1/3", "1/9", None]
    pq.write_table(pa.table({"aircraft": aircraft, "radar_track": names}), tmp_path / "tracks.parquet")
    assert radar_tracks(tmp_path) == {"mavlink:1": {"1/3", "2/7"}}


def test_a_session_without_tracks_names_none(tmp_path: Path) -> None:
    """A simulated session that was not replayed yet."""
    assert radar_tracks(tmp_path) == {}
