"""`talkdown reconstruct` on a recording of a landing."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from gateway.cli.app import run

LOG = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.BIN"
TLOG = LOG.with_suffix(".tlog")


def test_a_flight_log_becomes_a_table_a_drawing_and_a_summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The excerpt begins in the air, so the path is open; tied to half of its positions it is metres off the rest."""
    assert (
        run(["reconstruct", str(LOG), "--with-gps", "--mute", "gps:20:50", "--archive", str(tmp_path), "--json"]) == 0
    )
    (sortie,) = json.loads(capsys.readouterr().out)["mavlink:1"]
    folder = tmp_path / "sitl-landing-excerpt-flights"
    table = pq.read_table(folder / "flights.parquet")
    assert {path.name for path in folder.iterdir()} == {"flights.parquet", "flights.rrd", "sorties.json"}
    assert not sortie["took_off"]
    assert sortie["landed"]
    assert sortie["end_error_m"] is None
    assert sortie["beside_positions"]["rmse_m"] < 10.0 < sortie["beside_positions"]["open_rmse_m"]
    assert len(table) > 100
    assert table["sortie"].unique().to_pylist() == [1]
    assert table["latitude_deg"].null_count == 0


def test_a_recording_without_airspeed_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence, exit code 1."""
    assert run(["reconstruct", str(TLOG)]) == 1
    assert "mavlink:1 tells no airspeed" in capsys.readouterr().err
