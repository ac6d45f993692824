"""Scores against the truth."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gateway.frames import RunwayFrame
from gateway.observation import Truth
from gateway.runtime import accuracy
from gateway.runtime.accuracy import Accuracy
from gateway.settings import DEMO_SITE

RUNWAY = DEMO_SITE.runway
SECOND = 1_000_000_000
START = 1_767_225_600 * SECOND


def path_m(time: int) -> np.ndarray[Any, Any]:
    """A straight approach at 70 m/s, 3 degrees."""
    x = -20_000.0 + 70.0 * (time - START) / SECOND
    return np.array([x, 5.0, -x * math.tan(math.radians(3.0))])


def truth(time: int, *, msl: bool) -> Truth:
    latitude, longitude, height = RunwayFrame(RUNWAY).geodetic_from_runway(path_m(time))
    assert RUNWAY.geoid_separation_m is not None
    said = float(height) - (RUNWAY.geoid_separation_m if msl else 0.0)
    place = {"altitude_msl_m": said} if msl else {"height_m": said}
    return Truth("mavlink:1", time, time, float(latitude), float(longitude), **place)


def picture(now: int, truths: list[Truth], reports: list[tuple[int, Any]], plots: list[tuple[int, Any]] = []) -> Any:  # noqa: B006
    empty = np.zeros(0, dtype=np.int64)

    def rows(given: list[tuple[int, Any]]) -> tuple[Any, Any]:
        times = np.array([time for time, _ in given], dtype=np.int64)
        return times, np.array([position for _, position in given], dtype=float).reshape(-1, 3)

    report_time, report_m = rows(reports)
    plot_time, plot_m = rows(plots)
    return SimpleNamespace(
        now=now,
        truth=tuple(truths),
        align=SimpleNamespace(
            report_aircraft=("mavlink:1",) * len(reports),
            report_time=report_time,
            report_runway_m=report_m,
            report_has_height=np.isfinite(report_m[:, 2]),
            plot_radar_track=("1/3",) * len(plots),
            plot_time=plot_time,
            plot_runway_m=plot_m,
        ),
        associate=SimpleNamespace(pairs=(("mavlink:1", "1/3"),)),
        fuse=SimpleNamespace(
            state=(), aircraft=(), time=empty, runway_m=np.zeros((0, 3)), height_m=empty, altitude_msl_m=empty
        ),
    )


@pytest.mark.parametrize("msl", [True, False])
def test_a_constant_error_is_scored_as_itself_between_truths_of_another_rhythm(msl: bool) -> None:
    accuracy = Accuracy(RUNWAY)
    offset = np.array([3.0, -4.0, 12.0])
    for step in range(40):
        now = START + step * SECOND
        time = now - SECOND // 3
        accuracy.add(picture(now, [truth(now, msl=msl)], [(time, path_m(time) + offset)]))
    score = accuracy.scores()["gps"]
    assert score.count >= 30
    assert score.rmse_m == pytest.approx(13.0, abs=0.01)
    assert score.median_m == pytest.approx(13.0, abs=0.01)
    assert score.p95_m == pytest.approx(13.0, abs=0.01)


def test_a_plot_without_a_component_and_a_gap_in_the_truth_are_not_scored() -> None:
    accuracy = Accuracy(RUNWAY)
    accuracy.add(picture(START, [truth(START, msl=False), truth(START + SECOND, msl=False)], []))
    late = START + 20 * SECOND
    plots = [(START + SECOND // 2, [math.nan, 0.0, 0.0]), (START + SECOND // 2, path_m(START + SECOND // 2))]
    in_the_gap = START + 10 * SECOND
    accuracy.add(picture(START + 2 * SECOND, [truth(late, msl=False)], [(in_the_gap, path_m(in_the_gap))], plots))
    scores = accuracy.scores()
    assert scores["radar"].count == 1
    assert scores["radar"].rmse_m == pytest.approx(0.0, abs=0.01)
    assert "gps" not in scores


def test_memory_does_not_grow_with_a_truth_that_nobody_reports_on() -> None:
    accuracy = Accuracy(RUNWAY)
    for step in range(300):
        accuracy.add(picture(START + step * SECOND, [truth(START + step * SECOND, msl=False)], []))
    assert len(accuracy._truths["mavlink:1"].time) < 30


def test_without_truth_there_are_no_scores() -> None:
    accuracy = Accuracy(RUNWAY)
    accuracy.add(picture(START, [], [(START, path_m(START))]))
    assert accuracy.scores() == {}


def test_a_long_session_keeps_some_errors_of_all_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 2000 errors of 1 to 2000 m a hundred at most are kept: count and root mean square are exact, quantiles near."""
    scores = []
    for most in (100_000, 100):
        monkeypatch.setattr(accuracy, "_KEPT_AT_MOST", most)
        told = Accuracy(RUNWAY)
        for second in range(2000):
            at = START + second * SECOND
            off = np.array([0.0, second + 1.0, 0.0])
            told.add(picture(at, [truth(at, msl=False)], [(at, path_m(at) + off)]))
        (score,) = told.scores().values()
        scores.append(score)
    exact, thinned = scores
    assert len(told._errors["gps"].kept) <= 100
    assert exact.count == thinned.count == 2000
    assert thinned.rmse_m == pytest.approx(exact.rmse_m, rel=1e-6)
    # every 32nd of 2000 is kept: a quantile is known to that many metres
    assert thinned.median_m == pytest.approx(exact.median_m, abs=32.0)
    assert thinned.p95_m == pytest.approx(exact.p95_m, abs=32.0)


def test_the_truth_of_those_who_are_gone_is_forgotten() -> None:
    told = Accuracy(RUNWAY)
    for second in range(100):
        at = START + second * SECOND
        said = replace(truth(at, msl=False), aircraft=f"mavlink:{second}")
        told.add(picture(at, [said], []))
    assert len(told._truths) < 70
