"""A radar that is off, found out from a recording by what aircraft say of themselves: the whole way, as a user goes it."""

from __future__ import annotations

import contextlib
import io
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.app import run
from gateway.settings import parse_site

WRONG = ("range_error_m=150", "azimuth_error_deg=0.5", "elevation_error_deg=0.2")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four minutes of ten aircraft and a radar that measures wrong."""
    folder = tmp_path_factory.mktemp("sessions")
    changes = [f"radar.{change}" for change in WRONG] + ["aircraft=10", "duration_s=240", "gps.error_sigma_m=10"]
    settings = [word for change in changes for word in ("--set", change)]
    assert run(["simulate", "traffic", *settings, "--seed", "3", "--archive", str(folder), "--quiet"]) == 0
    (made,) = folder.iterdir()
    return made


@dataclass(frozen=True, slots=True)
class Registered:
    """What `register` left of the session: its words, what the session keeps, and the site file that was written."""

    told: str
    kept: dict[str, Any]
    site_file: Path


@pytest.fixture(scope="module")
def registered(session: Path, tmp_path_factory: pytest.TempPathFactory) -> Registered:
    written = tmp_path_factory.mktemp("site") / "registered.toml"
    with contextlib.redirect_stdout(io.StringIO()) as told:
        assert run(["register", str(session), "--write-site", str(written)]) == 0
    return Registered(told.getvalue(), json.loads((session / "registration.json").read_text()), written)


def test_what_a_radar_measures_too_much_is_found_and_kept(registered: Registered) -> None:
    radar = registered.kept["radars"]["1"]
    for name, true, close in (("range", 150.0, 15.0), ("azimuth", 0.5, 0.03), ("elevation", 0.2, 0.03)):
        value, sigma = radar[name]["measures_too_much"], radar[name]["sigma"]
        per = 1.0 if name == "range" else math.degrees(1.0)
        assert per * value == pytest.approx(true, abs=close)
        assert abs(per * value - true) < 3.0 * per * sigma
        assert radar[name]["to_be_applied"]
    assert not radar["time"]["to_be_applied"]
    assert registered.kept["prior_chi_square"] < 16.3


def test_it_is_said_in_words(registered: Registered) -> None:
    assert "range: measures 1" in registered.told
    assert "m too far" in registered.told
    assert "to be applied" in registered.told
    assert "pairs of" in registered.told


def test_what_was_found_goes_into_the_site_file_and_is_taken_off_from_then_on(
    session: Path, registered: Registered, capsys: pytest.CaptureFixture[str]
) -> None:
    (radar,) = parse_site(registered.site_file.read_text()).radars
    assert radar.range_error_m == pytest.approx(150.0, abs=15.0)
    assert math.degrees(radar.azimuth_error_rad) == pytest.approx(0.5, abs=0.03)
    assert radar.time_error_s == 0.0
    off = {}
    part = ["--to", "80", "--registration", "off", "--viewer", "none", "--json"]  # a third of it tells them apart
    for name, words in (("before", []), ("after", ["--site", str(registered.site_file)])):
        assert run(["replay", str(session), *words, *part]) == 0
        off[name] = json.loads(capsys.readouterr().out)["accuracy"]["radar"]["rmse_m"]
    assert off["after"] < 0.35 * off["before"]


def test_as_printed_the_mixed_systems_fail_and_the_residuals_show_it(
    session: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["register", str(session), "--literal", "--frame", "geodetic", "--json", "--quiet"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert json.loads((session / "registration.json").read_text()) == found
    assert "time" not in found["radars"]["1"]
    assert found["method"]["weighting"] == "none"
    assert found["chi_square_per_freedom"] > 10.0


def test_of_a_straight_in_approach_alone_range_is_not_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = [word for change in ("duration_s=200", "radar.range_error_m=20") for word in ("--set", change)]
    assert run(["simulate", "approach", *settings, "--archive", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    assert run(["register", str(next(tmp_path.iterdir())), "--json", "--quiet"]) == 0
    radar = json.loads(capsys.readouterr().out)["radars"]["1"]
    assert not radar["range"]["to_be_applied"]
    assert "not observable from this geometry" in radar["range"]["verdict"]


def test_a_wrong_frame_and_a_recording_without_pairs_are_told_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["--set", "radars=0", "--set", "duration_s=20"]
    assert run(["simulate", "approach", *settings, "--archive", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    session = str(next(tmp_path.iterdir()))
    assert run(["register", session, "--frame", "enu"]) == 2
    assert "'enu' is none of ecef, geodetic, polar" in capsys.readouterr().err
    assert run(["register", session, "--quiet"]) == 1
    assert "at least" in capsys.readouterr().err
