"""Recordings whose positions are good: dead reckoning denies none of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from adapters.mavlink_frames import parse
from adapters.motion import HIGHRES_IMU, RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3
from adapters.tlog import TlogWriter
from gateway.cli.app import run
from gateway.runtime.playback import open_playback

DATA = Path(__file__).parents[3] / "shared" / "data"
UNITS = {HIGHRES_IMU, RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3}


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
    assert refusals(recorded(name), begin, tmp_path) == []


@pytest.mark.study
@pytest.mark.parametrize("name", ["sitl-plane-landing", "sitl-plane-gps-loss", "sitl-three-planes"])
def test_none_is_denied_by_attitude_and_airspeed(name: str, tmp_path: Path) -> None:
    """Of aeroplanes without their inertial units, from before take-off to standing still."""
    copy = tmp_path / f"{name}.tlog"
    with copy.open("wb") as file:
        writer = TlogWriter(file)
        for one in open_playback([recorded(name)]).arrivals():
            frame = parse(one.data)
            if frame is not None and frame.message not in UNITS:
                writer.write(one.received_at, one.data)
    assert refusals(copy, "0:00", tmp_path / "sessions") == []


def recorded(name: str) -> Path:
    """One of the recordings."""
    recording = DATA / f"{name}.tlog"
    if not recording.exists():
        pytest.skip("the recordings do not lie beside the project")
    return recording


def refusals(recording: Path, begin: str, archive: Path) -> list[str]:
    """Why positions were refused, in a replay from an instant on."""
    assert (
        run(["replay", str(recording), "--from", begin, "--viewer", "none", "--quiet", "--archive", str(archive)]) == 0
    )
    session = json.loads(next(archive.glob("*/session.json")).read_text())
    return [reason for reason in session["counters"] if any(word in reason for word in ("deny", "denied", "frozen"))]
