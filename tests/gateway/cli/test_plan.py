"""`talkdown plan` as users run it."""

import json
from pathlib import Path

import pytest

from adapters.mission_files import read_mission
from gateway.cli.app import run
from gateway.settings import DEMO_SITE, format_site

CASE = """
[route]
start_km = [0.0, 0.0]
goal_km = [9.0, 0.0]
[[threat]]
east_km = 4.5
north_km = 0.3
[[area]]
name = "pond"
east_km = 6.5
north_km = -1.5
radius_m = 700.0
"""


def test_a_file_becomes_two_mission_files_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "case.toml"
    case.write_text(CASE)
    assert run(["plan", str(case), "--out", str(tmp_path / "route"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["clearance_m"] > 1000.0
    assert summary["least_turn_radius_m"] >= summary["asked_turn_radius_m"]
    plan, waypoints = (read_mission(tmp_path / f"route.{ending}") for ending in ("plan", "waypoints"))
    assert [one.kind for one in plan] == [one.kind for one in waypoints]
    assert len(plan) == summary["waypoints"] + 1  # home
    assert len(json.loads((tmp_path / "route.plan").read_text())["geoFence"]["circles"]) == 1
    assert (tmp_path / "route.rrd").stat().st_size > 10_000


def test_with_a_site_the_route_ends_with_the_landing_there(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "field.toml").write_text(format_site(DEMO_SITE))
    arguments = ["plan", str(tmp_path / "case.toml"), "--site", str(tmp_path / "field.toml")]
    assert run([*arguments, "--out", str(tmp_path / "home"), "--quiet"]) == 0
    *_, last = read_mission(tmp_path / "home.plan")
    assert last.kind == "landing"
    assert abs(last.longitude_rad - DEMO_SITE.runway.longitude_rad) < 1e-3


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ([], 2, "Say what to plan"),
        (["--seed", "1", "--method", "best"], 2, "--method 'best' is none of modern, seed, literal."),
        (["--seed", "1", "--objective", "clearance"], 2, "is for --method seed"),
        (["--seed", "1", "--upload", "udp:1"], 2, "is not a link"),
        (["--seed", "1", "--vehicle", "3"], 2, "add --upload URL"),
        (["--seed", "1", "--height", "600:200"], 2, "--height '600:200' is not understood"),
        (["--seed", "1", "--goal", "runway"], 1, "needs the site file"),
        (["none.toml"], 2, "none.toml cannot be read"),
    ],
)
def test_what_is_wrong_is_one_sentence_and_an_exit_code(
    arguments: list[str], code: int, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["plan", *arguments]) == code
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
