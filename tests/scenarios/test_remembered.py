"""What a live session learnt of its radars is kept with it, and taken up by the next one of the same site."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.align import SECOND
from gateway.cli.app import run
from gateway.register import Remembered, RememberedRadar
from gateway.runtime.folder import Record, read_record, remembered_for, write_record
from gateway.runtime.setup import Setup
from gateway.settings import DEMO_SITE, Options

START = 1_790_000_000 * SECOND


def known(azimuth_rad: float, at: int = START) -> Remembered:
    """What a session may have learnt of the demo's radar."""
    radar, runway = DEMO_SITE.radars[0], DEMO_SITE.runway
    error, sigma = (None, azimuth_rad, None, None), (None, 1e-4, None, None)
    place = radar.along_m, radar.left_m, radar.antenna_height_m, radar.compass_boresight_rad
    where = runway.latitude_rad, runway.longitude_rad, runway.landing_compass_rad
    return Remembered(at, *where, (RememberedRadar(1, *place, error, sigma),))


def kept(archive: Path, name: str, registered: Remembered | None, command: str = "live") -> None:
    """A session's folder with what it has learnt."""
    folder = archive / name
    folder.mkdir(parents=True)
    write_record(folder, Record("0", (command,), Options(), START, registered=registered))


def test_the_next_live_session_takes_up_what_the_last_one_of_its_site_has_learnt(tmp_path: Path) -> None:
    kept(tmp_path, "20260101T000000Z-demo-field", known(0.001))
    kept(tmp_path, "20260102T000000Z-demo-field", known(0.002))
    kept(tmp_path, "20260103T000000Z-elsewhere", replace(known(0.003), latitude_rad=0.1))
    kept(tmp_path, "20260104T000000Z-demo-field", None)
    kept(tmp_path, "20260105T000000Z-demo-field", known(0.004), command="replay")
    (tmp_path / "20260106T000000Z-no-session").mkdir()
    assert remembered_for(Setup(archive=tmp_path, takes_up=True), DEMO_SITE) == known(0.002)
    assert remembered_for(Setup(archive=tmp_path), DEMO_SITE) is None
    assert remembered_for(Setup(archive=tmp_path / "none", takes_up=True), DEMO_SITE) is None


def test_a_spoiled_memory_is_refused_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept(tmp_path, "one", known(0.002))
    document = json.loads((tmp_path / "one" / "session.json").read_text())
    document["registered"]["radars"][0]["sigma"] = [1.0, -1.0, None, None]
    (tmp_path / "one" / "session.json").write_text(json.dumps(document))
    assert run(["replay", str(tmp_path / "one"), "--viewer", "none"]) != 0
    assert "lacks or spoils what a session needs" in capsys.readouterr().err


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short session that began with something remembered of its radar."""
    archive = tmp_path_factory.mktemp("sessions")
    words = ["--set", "duration_s=25", "--seed", "2", "--archive", str(archive), "--quiet"]
    assert run(["simulate", "approach", *words]) == 0
    (folder,) = archive.iterdir()
    record = read_record(folder)
    write_record(folder, replace(record, registration=known(0.01, record.started_at - 2 * 3600 * SECOND)))
    return folder


def test_a_replay_begins_with_what_its_session_began_with(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun = read_record(session).registration
    tables = []
    for name in ("one", "two"):
        words = ["--viewer", "none", "--archive", str(tmp_path / name), "--quiet"]
        assert run(["replay", str(session), *words]) == 0
        (folder,) = (tmp_path / name).iterdir()
        record = read_record(folder)
        assert record.registration == begun
        assert record.registered is not None
        assert record.registered.radars[0].error[1] == pytest.approx(0.01, abs=1e-3)
        tables.append((folder / "tracks.parquet").read_bytes())
    assert tables[0] == tables[1]
    capsys.readouterr()
    assert run(["replay", str(session), "--viewer", "none"]) == 0
    told = capsys.readouterr()
    assert "as registered 2 hours ago: azimuth: +0.573 degrees to the left" in told.out + told.err
    assert math.degrees(0.01) == pytest.approx(0.573, abs=1e-3)
