"""Deviations from glide path and centreline."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gateway.predict.approach import deviations
from gateway.settings import DEMO_SITE

RUNWAY = DEMO_SITE.runway


def on_glide_path(distance_m: float) -> list[float]:
    x = RUNWAY.threshold_x_m - distance_m
    return [x, 0.0, (RUNWAY.aiming_point_x_m - x) * math.tan(RUNWAY.glide_path_rad)]


def test_who_is_on_the_glide_path_and_the_centreline_deviates_by_nothing():
    off = deviations(RUNWAY, [on_glide_path(d) for d in (1.0, 1500.0, 20_000.0)], np.full(3, 70.0))
    for column in (off.lateral_m, off.lateral_rad, off.vertical_m, off.vertical_rad):
        assert column == pytest.approx(np.zeros(3), abs=1e-9)
    assert off.distance_m == pytest.approx([1.0, 1500.0, 20_000.0])


def test_the_glide_path_crosses_the_threshold_at_the_crossing_height():
    above = [RUNWAY.threshold_x_m - 1e-6, 0.0, RUNWAY.threshold_crossing_height_m]
    assert deviations(RUNWAY, above, 70.0).vertical_m == pytest.approx(0.0, abs=1e-6)


def test_left_and_above_are_positive_and_angles_are_seen_from_the_aiming_point():
    x, y, z = on_glide_path(10_000.0)
    away = RUNWAY.aiming_point_x_m - x
    off = deviations(RUNWAY, [x, y + away * math.tan(0.01), away * math.tan(RUNWAY.glide_path_rad + 0.02)], 70.0)
    assert off.lateral_rad == pytest.approx(0.01)
    assert off.vertical_rad == pytest.approx(0.02)
    assert off.lateral_m > 0.0
    assert off.vertical_m > 0.0
    assert z > 0.0


@pytest.mark.parametrize(
    ("place", "along_mps"),
    [
        ([RUNWAY.threshold_x_m + 1.0, 0.0, 10.0], 70.0),  # over the runway
        ([-10_000.0, 8_000.0, 500.0], 70.0),  # abeam
        ([-10_000.0, 0.0, 500.0], -70.0),  # flying away
    ],
)
def test_who_is_not_on_the_approach_has_no_deviation(place, along_mps):
    off = deviations(RUNWAY, place, along_mps)
    assert np.isnan([off.distance_m, off.lateral_m, off.lateral_rad, off.vertical_m, off.vertical_rad]).all()


def test_a_batch_gives_what_its_rows_give():
    places = np.random.default_rng(1).normal([-20_000.0, 0.0, 800.0], [8_000.0, 3_000.0, 300.0], (50, 3))
    along = np.linspace(-50.0, 100.0, 50)
    whole = deviations(RUNWAY, places, along).vertical_m
    alone = [float(deviations(RUNWAY, place, speed).vertical_m) for place, speed in zip(places, along, strict=True)]
    assert whole.tobytes() == np.array(alone).tobytes()
