"""Recordings whose positions are good: dead reckoning denies none of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gateway.cli.app import run

DATA = Path(__file__).parents[3] / "shared" / "data"


@pytest.mark.parametrize(
    ("name", "begin"),
    [
        ("sitl-plane-landing", "12:20"),  # from before touchdown to standing still
        pytest.param("sitl-plane-landing", "0:00", marks=pytest.mark.study),
        pytest.param("sitl-plane-gps-loss", "0:00", marks=pytest.mark.study),
        pytest.param("sitl-three-planes", "0:00", marks=pytest.mark.study),
        pytest.param("sitl-boat", "0:00", marks=pytest.mark.study),
        pytest.param("copter-lossy-radio", "0:00", marks=pytest.mark.study),
        pytest.param("sub-five-components", "0:00", marks=pytest.mark.study),
    ],
)
def test_none_is_denied(name: str, begin: str, tmp_path: Path) -> None:
    """Inertial samples came, and no position was refused."""
    recording = DATA / f"{name}.tlog"
    if not recording.exists():
        pytest.skip("the recordings do not lie beside the project")
    assert (
        run(["replay", str(recording), "--from", begin, "--viewer", "none", "--quiet", "--archive", str(tmp_path)]) == 0
    )
    session = json.loads(next(tmp_path.glob("*/session.json")).read_text())
    assert [reason for reason in session["counters"] if "deny" in reason or "denied" in reason] == []
