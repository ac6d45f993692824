"""`talkdown simulate vehicle` as a user runs it."""

from __future__ import annotations

import math
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from adapters.mission_writing import LAND, TAKE_OFF, WAYPOINT, MissionItem, format_plan
from gateway.cli.app import run

HOME = (47.4, 8.5, 452.0)


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    path = tmp_path / "hop.plan"
    items = (
        MissionItem(TAKE_OFF, *HOME[:2], 5.0),
        MissionItem(WAYPOINT, 47.4001, 8.5, 5.0),
        MissionItem(LAND, 47.4001, 8.5),
    )
    path.write_text(format_plan(items, HOME))
    return path


def test_a_mission_is_flown_into_a_session_with_its_truth(
    mission: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two copters side by side, from the mission's own home, until both have landed."""
    line = ["simulate", "vehicle", "--type", "copter", "--count", "2", "--mission", str(mission)]
    assert run([*line, "--wind", "3,90,0.5", "--archive", str(tmp_path / "flights")]) == 0
    told = capsys.readouterr().out.splitlines()
    assert [one.split(" after ")[0] for one in told[:2]] == ["mavlink:1 at rest", "mavlink:2 at rest"]
    assert all("3 of 3 places reached" in one for one in told[:2])
    folder = Path(told[2].removeprefix("archived in "))
    assert sorted(one.name for one in (folder / "inputs").glob("*.tlog")) == ["mavlink-1.tlog", "mavlink-2.tlog"]
    truth = pq.read_table(folder / "truth.parquet").to_pylist()
    first, beside = (next(row for row in truth if row["aircraft"] == f"mavlink:{number}") for number in (1, 2))
    assert first["latitude_deg"] == pytest.approx(HOME[0])
    east_m = (beside["longitude_deg"] - first["longitude_deg"]) * 111_195.0 * math.cos(math.radians(HOME[0]))
    assert east_m == pytest.approx(40.0, abs=0.5)  # to the right of where the mission goes first: north
    assert truth[-1]["latitude_deg"] == pytest.approx(47.4001, abs=2e-5)
    assert truth[-1]["height_m"] == pytest.approx(HOME[2], abs=0.1)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (["approach", "--count", "2"], "belong to the scene vehicle"),
        (["helmsman", "--type", "ship"], "belong to the scene vehicle"),
        (["helmsman", "--archive", "x"], "leave --archive out"),
        (["vehicle", "--show"], "no file to show"),
        (["vehicle", "--watch", "x.tlog"], "--watch belongs to the scene radar"),
        (["vehicle", "--set", "gps.period_s=1"], "--set does not change"),
        (["vehicle"], "--home LAT,LON"),
        (["vehicle", "--home", "47"], "2 to 4 numbers"),
        (["vehicle", "--home", "470,8"], "no place"),
        (["vehicle", "--home", "47,8", "--archive", "x"], "--mission FILE"),
        (["vehicle", "--home", "47,8", "--start"], "there is no mission"),
        (["vehicle", "--home", "47,8", "--speed", "max"], "--speed max"),
        (["vehicle", "--home", "90,0"], "no place"),
        (["vehicle", "--home", "47,8", "--seconds", "-1"], "--seconds -1"),
        (["vehicle", "--home", "47,8", "--count", "0"], "--count 0"),
        (["vehicle", "--home", "47,8", "--type", "ship", "--wind", "5"], "not for ships"),
        (["vehicle", "--home", "47,8", "--wind", "90"], "--wind '90'"),
        (["vehicle", "--home", "47,8", "--mission", "no.plan"], "no.plan cannot be read"),
        (["vehicle", "--home", "47,8", "--mavlink", "udp:1"], "udpin:1"),
    ],
)
def test_what_people_do_wrong_is_answered_with_one_sentence(
    line: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", *line]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert len(said.splitlines()) == 1
