"""Approach reports: who lands as it should, who does not, touchdown, limits, the command and its page."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.app import run
from gateway.offline.precision import azimuth_limit, elevation_limit
from gateway.offline.report import SECOND, Approach, Heard, approaches
from gateway.offline.touchdown import touchdown
from gateway.offline.way import Flown, resampled
from gateway.settings import DEMO_SITE

EXCERPT = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"
RUNWAY = DEMO_SITE.runway
SPEED, STEP_S = 70.0, 0.25


def _landing(above_m: float = 0.0, until_m: float = 0.0, level_m: float = 0.0, climbs: bool = False) -> Flown:
    """From 7 km down the glide path, `above_m` too high until `until_m` before the aiming point, then rolling for 40 s.

    `level_m` lifts the whole way, as a wrong geoid separation does; who `climbs` goes around at 30 m.
    """
    slope = math.tan(RUNWAY.glide_path_rad)
    x = np.arange(-7_000.0, 2_800.0, SPEED * STEP_S) + RUNWAY.aiming_point_x_m
    before = RUNWAY.aiming_point_x_m - x
    height = np.maximum(before, 0.0) * slope + above_m * (before > until_m)
    if climbs:
        height = np.where(before * slope > 30.0, height, 30.0 + 0.1 * (x - x[before * slope > 30.0][-1]))
    place = np.stack([x, 0.0 * x, height + level_m], axis=-1)
    time = (np.arange(len(x)) * STEP_S * SECOND).astype(np.int64)
    return Flown(time, place, np.gradient(place, STEP_S, axis=0))


def _judged(flown: Flown, true: Flown | None = None, silent: slice | None = None, instead: str = "coast") -> Approach:
    words = np.full(len(flown.time), "gps", dtype="U14")
    if silent is not None:
        words[silent] = instead
    heard = Heard(words, np.full(len(words), "fused"), np.full(len(words), 0.1), np.full(len(words), "1/2"))
    (found,) = approaches(DEMO_SITE, "mavlink:1", flown, heard, true)
    return found


def test_who_flies_down_the_glide_path_and_lands_is_an_a() -> None:
    """Both gates stabilised at 1000 and 500 ft; what the sources were is told."""
    found = _judged(_landing())
    assert found.grade == "A"
    assert [gate.which for gate in found.gates] == ["upper", "lower"]
    assert [gate.wrong for gate in found.gates] == [(), ()]
    np.testing.assert_allclose([gate.height_m for gate in found.gates], [304.5, 152.2], atol=1.0)
    assert found.touchdown is not None
    assert found.accuracy is None
    assert (found.sources[0].source, found.radar_tracks) == ("gps", ("1/2",))
    assert found.sources[0].latency_median_s == pytest.approx(0.1)
    assert found.sources[0].rate_hz == pytest.approx(1.0 / STEP_S, rel=0.05)


def test_who_is_too_high_until_the_lower_gate_is_a_b_and_below_it_a_c() -> None:
    """50 m above the glide path, until 200 m and until 60 m of height."""
    slope = math.tan(RUNWAY.glide_path_rad)
    assert _judged(_landing(50.0, until_m=200.0 / slope)).grade == "B"
    found = _judged(_landing(50.0, until_m=60.0 / slope))
    assert found.grade == "C"
    assert "too high" in found.gates[-1].wrong
    assert any(reason.startswith("too high for ") for reason in found.reasons)


@pytest.mark.parametrize("level_m", [0.0, -3.0, 4.0])
def test_touchdown_is_found_whatever_height_the_runway_is_said_to_have(level_m: float) -> None:
    """Where the glide path meets the runway, within 0.3 s and the sink rate within a tenth."""
    way = _landing(level_m=level_m)
    found = touchdown(RUNWAY, way, 0, int(way.time[-1]))
    assert found is not None
    assert abs(found.along_m - RUNWAY.aiming_point_x_m) < 0.3 * SPEED
    assert found.sink_mps == pytest.approx(SPEED * math.tan(RUNWAY.glide_path_rad), rel=0.1)


def test_who_goes_around_does_not_touch_down() -> None:
    """No touchdown, and the report says that none was seen."""
    found = _judged(_landing(climbs=True))
    assert found.touchdown is None
    assert "no touchdown was seen" in found.reasons


def test_a_track_beside_the_truth_is_told_so() -> None:
    """12 m too high is more than a precision radar may be off within 3 km of it, and less than it may be further out."""
    found = _judged(_landing(level_m=12.0), _landing())
    assert found.accuracy is not None
    assert found.accuracy.vertical_rmse_m == pytest.approx(12.0, abs=0.1)
    assert found.accuracy.lateral_rmse_m == pytest.approx(0.0, abs=1e-6)
    assert 0.8 < found.accuracy.elevation_within < 0.85
    assert found.accuracy.azimuth_within == 1.0
    assert "the track was off the truth by more than Annex 10 allows a precision radar" in found.reasons


def test_dead_reckoning_that_was_needed_for_a_while_is_no_silent_source() -> None:
    found = _judged(_landing(), silent=slice(120, 180), instead="dead-reckoning")
    assert [one.source for one in found.sources] == ["dead-reckoning", "gps"]
    assert not any("dead-reckoning" in reason for reason in found.reasons)


def test_a_source_that_is_silent_is_named() -> None:
    """Fifteen seconds of coasting."""
    found = _judged(_landing(), silent=slice(120, 180))
    assert found.sources[0].longest_gap_s == pytest.approx(15.25)
    assert "gps gave the track nothing for 15 s" in found.reasons


def test_the_limits_are_those_of_annex_10() -> None:
    """0.6 % and 0.4 % of the range with a tenth of the deviation, at least 9 and 6 m."""
    np.testing.assert_allclose(azimuth_limit([10_000.0, 10_000.0, 500.0], [0.0, -100.0, 0.0]), [60.0, 70.0, 9.0])
    np.testing.assert_allclose(elevation_limit([10_000.0, 10_000.0, 500.0], [0.0, -100.0, 0.0]), [40.0, 50.0, 6.0])


def test_between_rows_far_apart_nothing_is_known() -> None:
    """A gap of ten seconds is NaN, not a straight line."""
    way = _landing()
    kept = (way.time < 20 * SECOND) | (way.time > 30 * SECOND)
    found = resampled(Flown(way.time[kept], way.place_m[kept], way.velocity_mps[kept]))
    assert np.isnan(found.place_m[21:30]).all()
    assert np.isfinite(found.place_m[:20]).all()


def test_the_landing_of_sitl_is_reported_as_its_truth_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Touchdown within a second and ten metres of the truth's; the page needs nothing from elsewhere."""
    assert run(["replay", str(EXCERPT), "--viewer", "none", "--archive", str(tmp_path / "kept"), "--quiet"]) == 0
    (session,) = (tmp_path / "kept").iterdir()
    capsys.readouterr()
    assert run(["report", str(session), "--html", str(tmp_path / "report.html"), "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["approaches"]
    seen, true = one["touchdown"], one["true_touchdown"]
    assert abs(seen["time"] - true["time"]) < SECOND
    assert math.hypot(seen["along_m"] - true["along_m"], seen["left_m"] - true["left_m"]) < 10.0
    assert one["accuracy"]["vertical_rmse_m"] < 1.0
    text = (tmp_path / "report.html").read_text()
    assert text.count("<svg") == text.count("</svg>") == 5
    assert not re.search(r"<script|https?://|nan", text)


def test_what_is_no_session_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence, exit code 2."""
    assert run(["report", str(tmp_path)]) == 2
    assert "is no session" in capsys.readouterr().err
