"""A SITL flight that lands, with a simulated radar beside it: the three tracks of figure 6, joined, down to the runway.

The project holds the last minute of the flight; the whole of it is used where it lies beside the project.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from gateway.geodesy import geodetic_to_ecef

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
WHOLE = Path(__file__).parents[3] / "shared" / "data" / "sitl-plane-landing.tlog"
BOOT_NS = 1_767_225_599_970_000_000  # of the recording, in its simulated UTC
TOUCHDOWN_NS = BOOT_NS + 767_700_000_000

RADAR_SITE = """
[[radar]]
number = 4
along_m = 80.0
left_m = 60.0
antenna_height_m = 3.0
"""


@dataclass(frozen=True)
class Table:
    """The last row of each time of the aircraft's track, and where the truth was then."""

    at: Any  # (n,) ns
    state: list[str]
    radar_track: list[str | None]
    error_m: Any  # (n,) distance to the truth


def read(folder: Path) -> Table:
    """The tracks of an archived session beside its truth."""
    rows = {row["time"]: row for row in flat(folder / "tracks.parquet") if row["aircraft"] == "mavlink:1"}
    truth = flat(folder / "truth.parquet")
    truth_at = np.array([row["time"] for row in truth])
    at = np.array(sorted(rows))
    there = np.array([ecef(rows[time]) for time in at.tolist()])
    true = np.array([ecef(row) for row in truth])
    on_way = np.stack([np.interp(at, truth_at, true[:, axis]) for axis in range(3)], axis=1)
    chosen = [rows[time] for time in at.tolist()]
    error_m = np.linalg.norm(there - on_way, axis=1)
    return Table(at, [row["state"] for row in chosen], [row["radar_track"] for row in chosen], error_m)


def flat(path: Path) -> list[dict[str, Any]]:
    """A table's rows, times as ns."""
    table = pq.read_table(path)
    times = table["time"].cast("int64").to_pylist()
    wanted = ("aircraft", "state", "radar_track", "latitude_deg", "longitude_deg", "height_m")
    columns = table.select([name for name in wanted if name in table.column_names]).to_pylist()
    return [{**row, "time": time} for row, time in zip(columns, times, strict=True)]


def ecef(row: dict[str, Any]) -> Any:
    """Where a row is, (3,) m; the recording gives no geoid, so heights are those above mean sea level on both sides."""
    return geodetic_to_ecef(np.radians(row["latitude_deg"]), np.radians(row["longitude_deg"]), row["height_m"])


Talkdown = Callable[..., Any]


def fused_with_radar(recording: Path, talkdown: Talkdown, folder: Path, site: Path | None) -> Table:
    """The recording watched by a simulated radar, and both replayed."""
    place = ["--site", site] if site else []
    watched = talkdown("simulate", "radar", "--watch", recording, *place, "--archive", folder / "radar")
    assert watched.code == 0, watched.err
    (capture,) = (folder / "radar").glob("*.pcap")
    outcome = talkdown("replay", recording, capture, *place, "--viewer", "none", "--archive", folder, "--json")
    assert outcome.code == 0, outcome.err
    return read(Path(outcome.summary["archive"]))


def assert_it_lands(table: Table, radar_track: str) -> None:
    """Joined with the radar, fused down to the runway, near the truth all the way."""
    fused = np.array([state == "fused" for state in table.state])
    assert fused.any()
    assert {name for name, joined in zip(table.radar_track, fused, strict=True) if joined} >= {radar_track}
    before = np.flatnonzero(fused & (table.at <= TOUCHDOWN_NS))
    last = before[-1]
    # Fused rows come at 10 Hz and more: the last one before the touchdown is not older than a second.
    assert TOUCHDOWN_NS - table.at[last] < 1_000_000_000
    assert table.error_m[last] <= 10.0
    # The radar has 15 m and 1 mrad, the autopilot 0.6 m; fused the track stays within a few metres.
    assert np.median(table.error_m[fused]) < 5.0


def test_the_last_minute_of_a_sitl_flight_is_fused_down_to_the_runway(talkdown: Talkdown, tmp_path: Path) -> None:
    """Without a site file: the place comes from the recording, the radar's from its own status."""
    assert_it_lands(fused_with_radar(EXCERPT, talkdown, tmp_path, None), "1/1")


def test_with_a_site_file_the_radar_stands_where_the_file_says(talkdown: Talkdown, tmp_path: Path) -> None:
    """The proposed site with a radar added by hand is used as it is written."""
    site = tmp_path / "field.toml"
    site.write_text(talkdown("site", EXCERPT).out + RADAR_SITE)
    assert_it_lands(fused_with_radar(EXCERPT, talkdown, tmp_path, site), "4/1")


def test_alone_the_recording_gives_the_autopilots_track(talkdown: Talkdown, tmp_path: Path) -> None:
    """Without a radar the track is the position source's, and at the touchdown as near the truth as that is."""
    outcome = talkdown("replay", EXCERPT, "--viewer", "none", "--archive", tmp_path, "--json")
    assert outcome.code == 0, outcome.err
    table = read(Path(outcome.summary["archive"]))
    assert set(table.state) <= {"gps only", "coasting"}
    last = np.flatnonzero(table.at <= TOUCHDOWN_NS)[-1]
    assert table.error_m[last] <= 10.0


@pytest.mark.study
@pytest.mark.skipif(not WHOLE.exists(), reason="the whole SITL recording does not lie beside the project")
def test_the_whole_sitl_flight_is_fused_down_to_the_runway(talkdown: Talkdown, tmp_path: Path) -> None:
    """Thirteen minutes with take-off, circuits and landing, joined once and never lost."""
    table = fused_with_radar(WHOLE, talkdown, tmp_path, None)
    assert_it_lands(table, "1/1")
    assert table.state.count("fused") > 0.9 * len(table.state)
