"""Scene files with faults, simulated and replayed: what the gateway makes of them, and what people are told of scenes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

FAULTS = """
[scene]
description = "Everything at once."
start = "2026-03-01T12:00:00Z"
duration_s = 42.0
[gps]
period_s = 0.5
sigma_m = 1.5
error_east_m = 0.0
error_north_m = 0.0
error_up_m = 0.0
latency_low_s = 0.05
latency_high_s = 0.2
[imu]
rate_hz = 10.0
[[vehicle]]
route = "approach"
[[vehicle]]
route = "approach"
begin_s = -30.0
[[fault]]
kind = "gps spoofed"
vehicle = 1
step_m = 500.0
at_s = 32.0
[[fault]]
kind = "gps lost"
vehicle = 2
at_s = 20.0
until_s = 26.0
[[fault]]
kind = "clock jump"
vehicle = 2
by_s = 7200.0
at_s = 34.0
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the scene file."""
    folder = tmp_path_factory.mktemp("scenes")
    (folder / "faults.toml").write_text(FAULTS)
    (folder / "broken.toml").write_text('[scene]\ndescription = "Broken."\n[[vehicle]]\nroute = "approch"\n')
    return folder


def test_faults_are_seen_for_what_they_are(world: Path, tmp_path: Path, talkdown: Callable[..., Any]) -> None:
    """A jump that inertial data deny, a fix that is lost, a clock two hours off: each is said once, and the tracks stay
    with the aircraft, whose false positions are 500 m away."""
    assert talkdown("simulate", world / "faults.toml", "--archive", tmp_path, "--quiet").code == 0
    (session,) = tmp_path.iterdir()
    ran = talkdown("replay", session, "--viewer", "none", "--json")
    assert ran.code == 0
    for said in (
        "mavlink:1: what it says of its position jumped, which inertial data deny",
        "mavlink:2 has lost its GPS fix",
        "The clock of mavlink:2 is 7200 s ahead",
    ):
        assert ran.err.count(said) == 1, said
    accuracy = ran.summary["accuracy"]
    assert accuracy["gps"]["p95_m"] > 490.0
    assert accuracy["fused"]["p95_m"] < 150.0  # at 45 km the radar's angles alone are worth 60 m each


def test_scenes_of_a_folder_are_listed_with_what_is_wrong(world: Path, talkdown: Callable[..., Any]) -> None:
    """A good one with its numbers, a broken one with its sentence; what --show prints is the file."""
    listed = " ".join(talkdown("simulate", "--list", world).out.split())
    assert "faults.toml 2 1 0:42 3 Everything at once." in listed
    assert "perhaps approach is meant" in listed
    assert talkdown("simulate", world / "faults.toml", "--show").out == FAULTS


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("simulate",), "Which scene?"),
        (("simulate", "aproach"), "perhaps approach is meant"),
        (("simulate", "none.toml"), "none.toml cannot be read (no such file or directory)."),
        (("simulate", "--list", "nowhere"), "--list takes a folder"),
    ],
)
def test_what_is_no_scene_is_said(arguments: tuple[str, ...], said: str, talkdown: Callable[..., Any]) -> None:
    """One sentence, exit code 2."""
    outcome = talkdown(*arguments)
    assert outcome.code == 2
    assert said in outcome.sentence
