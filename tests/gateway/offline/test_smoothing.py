"""Whole tracks out of pictures, and smoothed: every row once, whatever came late, joined, was lost, or began anew."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.fuse import remaining
from gateway.fuse.weighting import Model
from gateway.observation import GpsReport
from gateway.offline.pieces import Piece, Pieces, chosen, joined
from gateway.offline.smoothing import Smoothed, smoothed
from gateway.settings import EstimatorName, Options

Floats = NDArray[np.float64]
ONE = "mavlink:1"
KEPT = ("received", "aircraft", "radar_track", "updated_by", "state", "callsign", "life")  # as the filter had them


def gathered(world: Any, ran: Any, estimator: EstimatorName = "kalman", every: int = 10**9) -> list[list[Piece]]:
    """Every track's pieces, taken after so many pictures; what the lanes still hold goes into the last ones."""
    pieces = Pieces(model(world, estimator))
    taken: dict[int, list[Piece]] = {}
    for number, picture in enumerate(ran.pictures):
        pieces.add(picture.fuse, picture.step, picture.now)
        if number % every == every - 1:
            for piece in pieces.take():
                taken.setdefault(piece.track, []).append(piece)
    pieces.settle(remaining(ran.state.lanes))
    for piece in pieces.take(all_of_it=True):
        taken.setdefault(piece.track, []).append(piece)
    return [taken[track] for track in sorted(taken)]


def model(world: Any, estimator: EstimatorName = "kalman") -> Model:
    return Model.of(Options(estimator=estimator), world.site.position, world.radars)


def smoothed_track(world: Any, pieces: list[Piece], estimator: EstimatorName = "kalman") -> list[Smoothed]:
    """A track's pieces smoothed, in the order of time."""
    return list(smoothed(reversed(pieces), model(world, estimator), world.frame))[::-1]


def rows_of(pieces: list[Piece]) -> dict[tuple[int, int], dict[str, Any]]:
    rows = joined([piece.rows for piece in pieces])
    names = (*KEPT, "runway_m")
    return {
        (int(rows.track[i]), int(rows.time[i])): {name: getattr(rows, name)[i] for name in names}
        for i in range(len(rows.time))
    }


def last_rows(ran: Any) -> dict[tuple[int, int], dict[str, Any]]:
    """The last row that was written for each track and time."""
    columns = {name: ran.column(name) for name in ("track", "time", *KEPT, "runway_m")}
    return {
        (int(track), int(time)): {name: columns[name][i] for name in (*KEPT, "runway_m")}
        for i, (track, time) in enumerate(zip(columns["track"], columns["time"], strict=True))
    }


def same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return all(one[name] == other[name] for name in KEPT) and np.array_equal(one["runway_m"], other["runway_m"])


@pytest.mark.parametrize("every", [1, 7, 10**9])
def test_every_last_row_is_in_a_piece_once(world: Any, every: int) -> None:
    """Also those that late reports rewrote and those that coasted, to the end of the track's silence."""
    ran = world.run(world.flight(seconds=40.0, gps_period_s=3.0), ticks="20 ms", until_s=90.0)
    (pieces,) = [track for track in gathered(world, ran, every=every) if track[0].rows.aircraft[0] == ONE]
    found, wanted = rows_of(pieces), {k: v for k, v in last_rows(ran).items() if v["aircraft"] == ONE}
    assert sum(len(piece.rows.time) for piece in pieces) == len(found)
    assert {row["updated_by"] for row in found.values()} == {"gps", "radar", "coast"}
    assert found.keys() == wanted.keys()
    assert all(same(found[key], wanted[key]) for key in wanted)


def test_pieces_do_not_depend_on_when_they_are_taken(world: Any) -> None:
    """Their rows, states and beginnings are the same to the bit, put together."""
    ran = world.run(world.flight(seconds=40.0), ticks="20 ms", until_s=60.0)
    for one, other in zip(gathered(world, ran, every=3), gathered(world, ran), strict=True):
        for name in ("mean", "covariance", "weight", "begins"):
            parts = np.concatenate([getattr(piece, name) for piece in one])
            assert np.array_equal(parts, np.concatenate([getattr(piece, name) for piece in other]))
        assert rows_of(one).keys() == rows_of(other).keys()


def test_every_state_settles_once(world: Any) -> None:
    """However the session is cut into steps: each measurement of each track in its order, late ones in their places."""
    flight = world.flight(seconds=40.0, gps_period_s=3.0)
    for ticks in ("one", "20 ms", "all"):
        ran = world.run(flight, ticks=ticks, until_s=100.0)
        left = [one for picture in ran.pictures for one in picture.fuse.settled]
        assert remaining(ran.state.lanes) == []
        told = [(one.track, event.measure.serial) for one in left for event in one.events]
        assert len(set(told)) == len(told)
        for track in {one.track for one in left}:
            at = [event.at for one in left if one.track == track for event in one.events]
            assert at == sorted(at)
        assert {serial for _, serial in told} >= set(range(6, len(flight) + 1))  # the first plots only begin a track


def test_a_plot_that_became_another_tracks_is_not_in_two(world: Any) -> None:
    """A radar track becomes an aircraft's in hindsight: its number has the one's states before and the other's after."""
    flight = [
        one for one in world.flight(seconds=45.0) if not isinstance(one, GpsReport) or one.valid_at > world.at(20.0)
    ]
    ran = world.run(flight, ticks="20 ms")
    (both, reports) = gathered(world, ran)
    since = ran.ended[0].at
    assert max(int(time) for _, time in rows_of(reports)) < since
    known = [
        (int(time), name, bool(begins))
        for piece in both
        for time, name, begins in zip(piece.rows.time, piece.rows.aircraft, piece.begins, strict=True)
    ]
    assert all((name is None) == (time < since) for time, name, _ in known)
    assert [time for time, _, begins in known if begins] == [known[0][0], since]
    assert any(row["time"] >= since for row in ran.rows(track=1, aircraft=None))  # rows that there were


def test_tracks_that_ended_are_forgotten(world: Any) -> None:
    """Of a track that ended nothing waits two minutes later, and its tail is in a piece."""
    ran = world.run(world.flight(seconds=20.0, radars=()), ticks="20 ms", until_s=300.0)
    pieces = Pieces(model(world))
    taken = []
    for picture in ran.pictures:
        pieces.add(picture.fuse, picture.step, picture.now)
        if pieces.due:
            taken += pieces.take()
    pieces.add(chosen(ran.pictures[0].fuse, np.zeros(0, dtype=np.int64)), 0, world.at(420.0))
    taken += pieces.take()
    assert pieces.take(all_of_it=True) == []
    assert rows_of(taken).keys() == last_rows(ran).keys()


def test_a_session_whose_time_goes_back_is_two_flights(world: Any) -> None:
    """The same track twice, an hour apart: each part is smoothed alone, in the order that it was flown."""
    first = world.flight(seconds=25.0, gps_period_s=2.0, radars=())
    back = 3600 * world.SECOND
    again = [replace(one, valid_at=one.valid_at - back, received_at=one.received_at - back) for one in first]
    ran = world.run([*world.heard(first), *world.heard(again)], ticks="20 ms")
    ((pieces),) = gathered(world, ran)
    time, begins = (
        np.concatenate(list(column)) for column in zip(*((p.rows.time, p.begins) for p in pieces), strict=True)
    )
    (jump,) = np.flatnonzero(np.diff(time) < 0)
    assert begins[0]
    assert begins[jump + 1]
    assert begins.sum() == 2
    found = smoothed_track(world, pieces)
    assert np.isfinite(np.concatenate([one.smoothed_m for one in found])).all()


def test_nothing_is_told_across_a_filter_that_began_anew(world: Any) -> None:
    """A source jumps by 5 km and stays: before the jump the track is smoothed as if nothing had come after it."""
    random = np.random.default_rng(4)
    jump_m = np.array([0.0, 5000.0, 0.0])
    times = np.arange(0.0, 60.0, 1.0).tolist()
    reports = [
        world.report(world.Course(), t, late_s=0.1, off_m=random.normal(0.0, 15.0, 3) + jump_m * (t > 30.0))
        for t in times
    ]
    (pieces,) = gathered(world, world.run(reports))
    (piece,) = pieces
    began = np.flatnonzero(piece.begins)
    assert len(began) == 2
    early = replace(
        piece,
        rows=chosen(piece.rows, np.arange(began[1])),
        step=piece.step[: began[1]],
        **{name: getattr(piece, name)[: began[1]] for name in ("begins", "mean", "covariance", "weight")},
    )
    (whole,), (alone,) = smoothed_track(world, [piece]), smoothed_track(world, [early])
    assert np.array_equal(whole.smoothed_m[: began[1]], alone.smoothed_m)
    assert not np.array_equal(whole.smoothed_m[began[1] :], whole.filtered_m[began[1] :])


@pytest.mark.parametrize("estimator", ["kalman", "rmimm"])
def test_the_cut_into_pieces_changes_no_bit(world: Any, estimator: EstimatorName) -> None:
    """Smoothed rows are the same, to the bit, from one piece and from many."""
    ran = world.run(world.flight(seconds=40.0), ticks="20 ms", options=Options(estimator=estimator))
    many, whole = (gathered(world, ran, estimator, every)[-1] for every in (25, 10**9))
    assert len(many) > 5
    assert len(whole) == 1
    one, other = (joined([part.rows for part in smoothed_track(world, pieces, estimator)]) for pieces in (many, whole))
    for name in ("time", "latitude_rad", "longitude_rad", "height_m", "velocity_mps", "covariance", "modes", "bias_m"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True), name


@pytest.mark.parametrize("estimator", ["kalman", "imm", "rmimm"])
def test_smoothing_brings_a_track_nearer_to_the_truth(world: Any, estimator: EstimatorName) -> None:
    """On one noisy flight with a biased source: at most 0.75 of the filter's error, and what it told else is kept."""
    ran = world.run(world.flight(seconds=60.0), options=Options(estimator=estimator))
    pieces = gathered(world, ran, estimator)[-1]
    found = smoothed_track(world, pieces, estimator)
    rows = joined([one.rows for one in found])
    seconds = (rows.time - world.START) / world.SECOND
    true_m = np.array([world.Course().at(float(t)) for t in seconds])
    settled = seconds > 20.0
    before, after = (
        np.linalg.norm((np.concatenate([getattr(one, name) for one in found]) - true_m)[settled])
        for name in ("filtered_m", "smoothed_m")
    )
    assert after <= 0.75 * before
    original = joined([piece.rows for piece in pieces])
    assert all(getattr(rows, name) == getattr(original, name) for name in KEPT[1:])
    separation_m = [one.height_m - one.altitude_msl_m for one in (rows, original)]
    np.testing.assert_allclose(*separation_m, atol=1e-9)


def test_smoothed_coordinates_are_one_place(world: Any) -> None:
    """Latitude, longitude and height of a smoothed row are its place in the runway frame, to a millimetre."""
    pieces = gathered(world, world.run(world.flight(seconds=30.0)))[-1]
    for one in smoothed_track(world, pieces):
        place = world.frame.runway_from_geodetic(one.rows.latitude_rad, one.rows.longitude_rad, one.rows.height_m)
        assert np.abs(place - one.smoothed_m).max() < 1e-3
        assert np.array_equal(one.smoothed_m, one.rows.runway_m)


def test_what_the_filter_did_not_know_stays_unknown(world: Any) -> None:
    """Without any height in the reports, smoothed rows have none either."""
    reports = [
        replace(world.report(world.Course(), float(t), late_s=0.1), altitude_msl_m=None, height_m=None)
        for t in range(20)
    ]
    (pieces,) = gathered(world, world.run(reports))
    (one,) = smoothed_track(world, pieces)
    assert all(map(math.isnan, one.rows.height_m.tolist()))
    assert all(map(math.isnan, one.rows.altitude_msl_m.tolist()))
    assert np.isfinite(one.rows.latitude_rad).all()
