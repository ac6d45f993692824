"""`--estimator` as a user gives it."""

import json
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from gateway.cli.app import run

EXCERPT = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"


def _replayed(source: Path, archive: Path, *more: str) -> Path:
    line = ["replay", str(source), "--viewer", "none", "--archive", str(archive), "--quiet", *more]
    assert run(line) == 0
    (session,) = archive.iterdir()
    return session


@pytest.mark.parametrize("command", ["live", "replay", "demo"])
def test_the_help_names_every_estimator(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "--help"]) == 0
    told = capsys.readouterr().out
    assert all(name in told for name in ("--estimator", "kalman", "rmimm", "alpha-beta-gamma"))


def test_a_replay_with_the_light_filter_is_archived_with_its_choice(tmp_path: Path) -> None:
    """Tracks differ from the Kalman filter's by metres, hold no modes, and the session gives the same bits again."""
    light = _replayed(EXCERPT, tmp_path / "light", "--to", "40", "--estimator", "alpha-beta-gamma")
    assert json.loads((light / "session.json").read_text())["options"]["estimator"] == "alpha-beta-gamma"
    tracks, usual = (
        pq.read_table(session / "tracks.parquet")
        for session in (light, _replayed(EXCERPT, tmp_path / "usual", "--to", "40"))
    )
    assert tracks.num_rows == usual.num_rows > 50
    assert tracks["straight"].null_count == tracks.num_rows
    for name, bound in (("latitude_deg", 1e-4), ("height_m", 10.0), ("velocity_east_mps", 10.0)):
        off = pc.max(pc.abs(pc.subtract(tracks[name], usual[name]))).as_py()
        assert 0.0 < off < bound
    again = _replayed(light, tmp_path / "again")
    for table in ("tracks.parquet", "predictions.parquet"):
        assert pq.read_table(again / table).equals(pq.read_table(light / table))
