"""The whole circle: a route planned under threat, flown by an autopilot in wind, seen by GPS and radar, fused, reported."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.settings import DEMO_SITE, format_site

CASE = """
[route]
start_km = [-8.0, 1.0]
goal = "runway"
origin_deg = [31.0, 104.0]

[[threat]]
east_km = -6.0
north_km = 0.5
"""
QUICK = ("gps.period_s=1", "radar.period_s=1", "say.truth_period_s=0.5", "say.attitude_period_s=1")


def test_from_a_plan_to_a_report(tmp_path: Path, talkdown: Callable[..., Any]) -> None:
    """Four commands: the mission that is planned is told on the wire, flown to a standstill on the runway, tracked within
    5 m of the truth (RMSE), and reported as an approach whose touchdown by the track is the true one within 50 m."""
    site, case = tmp_path / "field.toml", tmp_path / "threats.toml"
    site.write_text(format_site(DEMO_SITE))
    case.write_text(CASE)
    route = ("--site", site, "--speed", "28", "--height", "60", "--out", tmp_path / "route")
    planned = talkdown("plan", case, *route, "--json")
    assert planned.code == 0, planned.err
    changes = [part for change in QUICK for part in ("--set", change)]
    flown = talkdown("simulate", tmp_path / "route.plan", "--site", site, *changes, "--archive", tmp_path / "sim")
    assert flown.code == 0, flown.err
    (session,) = (tmp_path / "sim").iterdir()
    replay = ("--from", "5:00", "--viewer", "none", "--archive", tmp_path / "out", "--json")
    replayed = talkdown("replay", session, *replay)
    assert replayed.code == 0, replayed.err
    assert replayed.summary["observations"]["flight plans"] >= 1
    assert replayed.summary["accuracy"]["fused"]["rmse_m"] < 5.0
    (archived,) = (tmp_path / "out").iterdir()
    reported = talkdown("report", archived, "--json")
    assert reported.code == 0, reported.err
    landing = reported.summary["approaches"][-1]
    assert landing["aircraft"] == "mavlink:1"
    assert landing["touchdown"]["along_m"] == pytest.approx(landing["true_touchdown"]["along_m"], abs=50.0)
