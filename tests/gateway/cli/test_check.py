"""`talkdown check` and `talkdown columns` as a user runs them."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from adapters.columns import read_columns
from gateway.cli.app import run

EXCERPT = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"


def test_check_tells_people_who_speaks_and_what_it_means(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(EXCERPT)]) == 0
    told = capsys.readouterr().out
    for said in ("who speaks", "GLOBAL_POSITION_INT", "mavlink:1", "what Talkdown can make of it", "No landing radar"):
        assert said in told


def test_check_tells_programs_the_same_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", str(EXCERPT), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (component,) = told["components"]
    frames = read_columns(EXCERPT, []).frames
    assert component["frames"] == len(frames) == sum(one["number"] for one in component["messages"].values())
    assert component["messages"]["GLOBAL_POSITION_INT"]["used"]
    assert told["aircraft"][0]["name"] == "mavlink:1"
    assert {finding["kind"] for finding in told["findings"]} <= {"good", "missing", "wrong"}


def test_columns_writes_a_table_a_message_with_its_own_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "tables"
    assert run(["columns", str(EXCERPT), "--out", str(out), "--message", "SIM_STATE", "--message", "GPS_RAW_INT"]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["GPS_RAW_INT.parquet", "SIM_STATE.parquet"]
    table = pq.read_table(out / "GPS_RAW_INT.parquet")
    expected = read_columns(EXCERPT, ["GPS_RAW_INT"]).messages["GPS_RAW_INT"]
    assert table["lat"].to_pylist() == expected["lat"].tolist()
    assert table["received_at"].cast("int64").to_pylist() == expected["received_at"].tolist()
    assert "2 tables in" in capsys.readouterr().out


def test_columns_names_a_message_that_there_is_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["columns", str(EXCERPT), "--out", str(tmp_path / "x"), "--message", "GPS_ROW"]) == 2
    assert "'GPS_ROW'" in capsys.readouterr().err
