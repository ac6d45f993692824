"""What is muted scores what went on without it."""

from __future__ import annotations

import math

import pytest

from gateway.observation import GpsReport, Heard
from gateway.picture import MutedError, Picture
from gateway.pipeline import initial, step
from gateway.runtime.muted import Muted, MutedScore
from gateway.runtime.mutes import Muting
from gateway.settings import Mute, Options, Runway, Site

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
SITE = Site("here", Runway(math.radians(47.0), math.radians(8.0), 0.0, 0.0, geoid_separation_m=0.0))
NORTH_MPS, TURNS_AT_S, METRES = 50.0, 30, 6.3674e6  # of a radian to the north, there


def report(second: int) -> GpsReport:
    """North at 50 m/s; from the thirtieth second on it stands still."""
    north = NORTH_MPS * min(second, TURNS_AT_S)
    at = START + second * SECOND
    return GpsReport(
        "mavlink:1",
        at,
        at,
        math.radians(47.0) + north / METRES,
        math.radians(8.0),
        height_m=300.0,
        velocity_north_mps=NORTH_MPS if second < TURNS_AT_S else 0.0,
        velocity_east_mps=0.0,
        velocity_up_mps=0.0,
        horizontal_sigma_m=1.0,
    )


def scored(since_s: int, until_s: int) -> tuple[tuple[MutedScore, ...], list[MutedError], list[Picture]]:
    muting = Muting((Mute("gps", None, START + since_s * SECOND, START + until_s * SECOND),))
    state, pictures = initial(SITE, Options(horizons_s=(10.0,))), []
    for second in range(60):
        at = START + second * SECOND
        heard = muting.without_muted(Heard(at, (report(second),)), at)
        state, picture = step(state, [*([heard] if heard else []), Heard(at + SECOND // 2)])
        pictures.append(muting.muted.add(picture))
    return muting.muted.scores(), [error for one in pictures for error in one.muted], pictures


def test_what_stops_while_nobody_hears_it_is_overshot_by_its_speed() -> None:
    (track, constant), errors, _ = scored(20, 45)
    assert (track.what, constant.what) == ("track", "constant velocity")
    assert track.lasts_s == 24.0
    assert constant.by_mark_m[10] == pytest.approx(0.0, abs=0.5)
    assert constant.by_mark_m[20] == pytest.approx(500.0, abs=1.0)
    assert track.by_mark_m[20] == pytest.approx(500.0, abs=15.0)
    assert track.largest_m == max(error.error_m for error in errors if error.what == "track")
    assert track.inside is not None
    assert constant.inside is None


def test_every_error_is_in_the_picture_in_which_it_became_known() -> None:
    _, errors, pictures = scored(20, 45)
    assert len({(error.what, error.at) for error in errors}) == len(errors)
    assert all(error.at <= picture.now for picture in pictures for error in picture.muted)
    assert all(error.since_s == (error.at - START) / SECOND - 20.0 for error in errors)


def test_two_times_without_positions_are_two_scores() -> None:
    muted = Muted()
    for second in (10, 11, 12, 40, 41):
        muted.hear(report(second))
    state = initial(SITE)
    _, picture = step(state, [Heard(START + 60 * SECOND, (report(5),)), Heard(START + 61 * SECOND)])
    assert muted.add(picture).muted == ()
    assert muted.scores() == ()


def test_nothing_is_muted_nothing_is_scored() -> None:
    assert scored(70, 80)[0] == ()
