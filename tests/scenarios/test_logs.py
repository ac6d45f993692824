"""A vehicle's own log beside, and instead of, its telemetry."""

import contextlib
import io
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from gateway.cli.app import run
from gateway.geodesy import geodetic_to_ecef

Talkdown = Callable[..., Any]
DATA = Path(__file__).parents[1] / "data"
LOG, TELEMETRY = DATA / "sitl-landing-excerpt.BIN", DATA / "sitl-landing-excerpt.tlog"


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The summary of a replay of the log, which was archived."""
    folder = str(tmp_path_factory.mktemp("alone"))
    with contextlib.redirect_stdout(io.StringIO()) as told:
        assert run(["replay", str(LOG), "--viewer", "none", "--archive", folder, "--json"]) == 0
    return json.loads(told.getvalue())


def archived(talkdown: Talkdown, folder: Path, *files: Path) -> Any:
    """The summary of a replay that was archived."""
    ended = talkdown("replay", *files, "--viewer", "none", "--archive", folder, "--json")
    assert ended.code == 0, ended.err
    return ended.summary


def landing(summary: Any) -> tuple[int, Any]:
    """When the last row holds (ns), and where that is (ECEF, m)."""
    rows = pq.read_table(Path(summary["archive"]) / "tracks.parquet")
    last = rows.slice(rows.num_rows - 1).to_pylist()[0]
    at = rows["time"].cast("int64").to_pylist()[-1]
    return at, geodetic_to_ecef(np.radians(last["latitude_deg"]), np.radians(last["longitude_deg"]), last["height_m"])


def test_log_and_telemetry_of_one_flight_land_at_the_same_place_and_together_are_one_aircraft(
    talkdown: Talkdown, alone: Any, tmp_path: Path
) -> None:
    """The vehicle stands at the end: there the two differ by the centimetre in which they are told."""
    heard = archived(talkdown, tmp_path, TELEMETRY)
    both = archived(talkdown, tmp_path, TELEMETRY, LOG)
    assert alone["site"] == heard["site"] == both["site"]
    assert alone["aircraft"] == heard["aircraft"] == both["aircraft"] == ["mavlink:1"]
    places = [landing(one) for one in (alone, heard, both)]
    for at, place in places[1:]:
        assert abs(at - places[0][0]) < 300_000_000
        assert np.linalg.norm(place - places[0][1]) < 0.5
    assert both["observations"]["GPS reports"] > heard["observations"]["GPS reports"]


def test_a_log_that_was_archived_gives_the_same_again(talkdown: Talkdown, alone: Any, tmp_path: Path) -> None:
    """inputs/ holds the frames that the log was told as; they are replayed without the log."""
    again = archived(talkdown, tmp_path, Path(alone["archive"]))
    for name in ("tracks.parquet", "predictions.parquet", "truth.parquet", "inputs/sitl-landing-excerpt.tlog"):
        assert (Path(alone["archive"]) / name).read_bytes() == (Path(again["archive"]) / name).read_bytes()


def test_a_site_is_proposed_from_a_log(talkdown: Talkdown) -> None:
    """The landing item of its mission."""
    ended = talkdown("site", LOG)
    assert ended.code == 0
    assert "landing item of the mission of mavlink:1" in ended.out


def test_a_log_without_the_program_that_reads_it_is_refused_in_one_sentence(
    talkdown: Talkdown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyulog", None)
    (tmp_path / "flight.ulg").write_bytes(b"ULog\x01\x12\x35\x01" + bytes(64))
    ended = talkdown("replay", tmp_path / "flight.ulg", "--viewer", "none")
    assert ended.code == 2
    assert "pip install talkdown[ulog]" in ended.sentence
