"""Score: what is known to be wrong by so much is told to be, along, across and in sigmas."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest

from gateway.offline.pooled import pooled
from gateway.offline.score import Errors, Foretold, Way, errors, joined, scores, standard_error

SECOND = 1_000_000_000
LATITUDE, LONGITUDE, RADIUS_M = 0.541, 1.815, 6_370_000.0
SPEED = 50.0


def way(seconds: int, gap: range = range(0)) -> Way:
    """Northward at 50 m/s, a place each second."""
    at = np.array([second for second in range(seconds) if second not in gap], dtype=np.int64)
    return Way(at * SECOND, LATITUDE + SPEED * at / RADIUS_M, np.full(len(at), LONGITUDE), np.full(len(at), 100.0))


def foretold(made: list[int], horizon: float, north_m: float, east_m: float, sigma: float = 10.0) -> Foretold:
    """Predictions of the way that are wrong by so much."""
    at = np.array(made, dtype=np.int64) * SECOND
    n = len(at)
    there = LATITUDE + (SPEED * (np.array(made) + horizon) + north_m) / RADIUS_M
    return Foretold(
        at,
        at + int(horizon * SECOND),
        np.full(n, horizon),
        there,
        np.full(n, LONGITUDE + east_m / RADIUS_M / math.cos(LATITUDE)),
        np.full(n, 130.0),
        np.full(n, sigma),
        np.full(n, 2.0 * sigma),
        np.zeros(n),
        np.full(n, "model"),
        np.full(n, ""),
    )


def test_errors_are_along_and_across_the_foretold_course() -> None:
    """12 m too far north and 30 m too far east of a way northward: 12 along, 30 to the right, 30 too high."""
    found = errors(foretold([5, 6], 10.0, 12.0, 30.0), way(60), way(60))
    assert found.along_m == pytest.approx([12.0, 12.0], rel=0.02)
    assert found.across_m == pytest.approx([-30.0, -30.0], rel=0.02)
    assert found.along_sigmas == pytest.approx([1.2, 1.2], rel=0.02)
    assert found.across_sigmas == pytest.approx([1.5, 1.5], rel=0.02)
    assert found.height_m == pytest.approx([30.0, 30.0])
    assert not found.turned.any()
    assert (found.straight_on_m < 0.5).all()


def test_what_did_not_come_is_not_scored() -> None:
    """Of four predictions one leads into a gap of more than five seconds and one beyond the end: two are left."""
    found = errors(foretold([5, 20, 30, 55], 10.0, 0.0, 0.0), way(60, range(28, 36)), way(60))
    assert len(found.along_m) == 2


def test_a_turn_in_the_meantime_is_known_and_constant_velocity_pays_for_it() -> None:
    """North, then east after 20 s: what was foretold at 10 s for 40 s has turned, and straight on is off by the corner."""
    at = np.arange(60)
    north, east = SPEED * np.minimum(at, 20), SPEED * np.maximum(at - 20, 0)
    corner = Way(
        at.astype(np.int64) * SECOND,
        LATITUDE + north / RADIUS_M,
        LONGITUDE + east / RADIUS_M / math.cos(LATITUDE),
        np.zeros(60),
    )
    found = errors(foretold([10], 30.0, 0.0, 0.0), corner, corner)
    assert found.turned.all()
    assert found.straight_on_m[0] == pytest.approx(math.hypot(20 * SPEED, 20 * SPEED), rel=0.02)


def test_rows_count_what_lies_within_one_and_two_sigmas() -> None:
    """Of errors at half, one and a half and three sigmas a third is within one, two thirds within two."""
    parts = [errors(foretold([5], 10.0, off, 0.0), way(60), way(60)) for off in (5.0, 15.0, 30.0)]
    rows = scores(joined(parts))
    assert {row.group for row in rows} == {"all", "straight", "model"}
    assert rows[0].count == 3
    assert rows[0].along_within == pytest.approx((1 / 3, 2 / 3))
    assert rows[0].across_within == (1.0, 1.0)
    assert rows[0].rms_m == pytest.approx(math.sqrt((25 + 225 + 900) / 3), rel=0.02)


def test_predictions_that_are_alike_tell_once() -> None:
    """Eight runs of ten that are all within or all without tell about as much as eight; a track that is always within, once."""
    made = list(range(80))
    alike, alone = foretold(made, 10.0, 0.0, 0.0), foretold(made, 10.0, 0.0, 0.0)
    draws = np.random.default_rng(1).random(80) < 0.5
    off_m = np.where(np.repeat([0, 1, 0, 0, 1, 1, 0, 1], 10), 15.0, 1.0), np.where(draws, 15.0, 1.0)
    parts = [
        errors(replace(told, latitude=told.latitude + off / RADIUS_M), way(120), way(120))
        for told, off in zip((alike, alone), off_m, strict=True)
    ]
    runs, each = (scores(joined([part]))[0] for part in parts)
    assert 3.0 < runs.along_independent < 16.0
    assert 40.0 < each.along_independent <= 80.0
    assert runs.across_independent == 1.0
    assert scores(joined(parts))[0].across_independent == 2.0
    assert standard_error(0.68, 100.0) == pytest.approx(0.0466, abs=1e-3)


def test_nothing_foretold_has_no_rows() -> None:
    """An empty session has an empty table."""
    nothing: Errors = joined([])
    assert scores(nothing) == []


def test_pooled_scores_are_those_of_all_predictions_together() -> None:
    """Of sessions with unlike numbers of predictions, some without a height; groups that one of them lacks."""
    low, high = foretold([5, 9, 14], 10.0, 5.0, 2.0), foretold([6], 20.0, 31.0, -8.0, sigma=4.0)
    unknown = replace(foretold([3, 7], 10.0, 15.0, 1.0), height=np.full(2, np.nan), method=np.full(2, "two segments"))
    parts = [[errors(told, way(60), way(60)) for told in some] for some in ((low, high), (unknown,), ())]
    together = pooled(scores(joined(some)) for some in parts)
    expected = scores(joined([one for some in parts for one in some]))
    by_row = {(row.group, row.horizon_s): row for row in together}
    assert len(by_row) == len(expected)
    for row in expected:
        found, wanted = asdict(by_row[row.group, row.horizon_s]), asdict(row)
        assert all(found[name] == pytest.approx(wanted[name], nan_ok=True) for name in wanted if name != "group")
