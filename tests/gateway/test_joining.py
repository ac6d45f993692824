"""Radar tracks of several radars: tracklets that say how sure they are, pairs that are plain, and counters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from gateway.associate import Together, compared, looked, together
from gateway.associate.pairing import judged
from gateway.associate.tracklets import Tracklets, tracklets
from gateway.track import RadarTracks

ERROR = (150.0, 0.0087, 0.0035)


def seen(
    world: Any, courses: Sequence[Any], *, seed: int = 1, second: Sequence[int] = (), off: Any = 0.0, **plot: Any
) -> Any:
    """Eight seconds of courses 1, 2, ... on radar 1, and of those of `second` on radar 2, which measures `off` too much."""
    random, tracks, serial = np.random.default_rng(seed), RadarTracks(), 0
    for t_s in np.arange(0.0, 8.0, 0.4).tolist():
        for radar, numbers in ((1, range(1, len(courses) + 1)), (2, second)):
            for number in numbers:
                serial += 1
                noise = random.normal(0.0, [15.0, 1e-3, 1e-3]) + (np.asarray(off) if radar == 2 else 0.0)
                made = world.plot(
                    courses[number - 1], t_s + 0.1 * radar, serial=serial, radar=radar, number=number, off=noise, **plot
                )
                tracks, _ = tracks.after(made)
    return tracks


def told(world: Any, tracks: RadarTracks) -> Tracklets:
    return tracklets(tracks, world.at(8.0), world.radars)


def test_a_tracklet_is_as_far_off_as_it_says(world: Any) -> None:
    """Over 60 draws the squared distance of position and velocity from the truth is chi-square's of six degrees."""
    course = world.Course()
    found = [told(world, seen(world, [course], seed=seed)) for seed in range(60)]
    place = world.frame.enu_from_runway @ course.at(5.0)
    speed = world.frame.enu_from_runway @ course.velocity(5.0)
    off = [one.state[0] - np.concatenate([place, speed]) for one in found]
    square = [float(e @ np.linalg.solve(one.covariance[0], e)) for e, one in zip(off, found, strict=True)]
    # 60 draws of chi-square(6): mean 6, its sigma 0.45; the course bends, and the parabola's prior is wide: a little less
    assert 4.0 < float(np.mean(square)) < 7.5


@pytest.mark.parametrize(("missing", "is_told"), [("", True), ("e", True), ("a", False), ("r", False)])
def test_without_elevation_a_tracklet_is_only_less_sure(world: Any, missing: str, is_told: bool) -> None:
    """Without range or azimuth it says nothing; without elevation its height is unsure by hundreds of metres."""
    one = told(world, seen(world, [world.Course()], missing=missing))
    assert len(one.keys) == is_told
    if missing == "e":
        assert np.sqrt(one.covariance[0, 2, 2]) > 500.0


def test_two_plots_and_a_track_that_fell_silent_are_no_tracklets(world: Any) -> None:
    """Too little to fit a parabola, or too old to be compared."""
    tracks = seen(world, [world.Course()])
    assert not tracklets(tracks, world.at(0.6), world.radars).keys
    assert not tracklets(tracks, world.at(11.0), world.radars).keys


def test_in_a_formation_the_errors_in_common_tell_who_is_who(world: Any) -> None:
    """Three 300 m apart and a radar that is off by as much: the assignment that one error explains is plain, the others not."""
    there = world.two_radars
    courses = [world.Course(left_m=left_m) for left_m in (0.0, 300.0, 600.0)]
    verdicts = judged(told(there, seen(there, courses, second=(1, 2, 3), off=ERROR)), frozenset(), {})
    assert {pair for pair, hit in verdicts.items() if hit} == {((1, k, 0), (2, k, 0)) for k in (1, 2, 3)}


def test_who_is_meant_is_not_guessed(world: Any) -> None:
    """Two 150 m apart, of which radar 2 sees one: with errors that large it may be either, and neither is counted."""
    there = world.two_radars
    courses = [world.Course(left_m=left_m) for left_m in (0.0, 150.0)]
    tracks = seen(there, courses, second=(1,))
    assert set(judged(told(there, tracks), frozenset(), {}).values()) == {None}
    known = {1: (5.0, 2e-4, 2e-4), 2: (5.0, 2e-4, 2e-4)}  # as registration knows them
    verdicts = judged(told(there, tracks), frozenset(), known)
    assert verdicts[(1, 1, 0), (2, 1, 0)] is True
    assert verdicts.get(((1, 2, 0), (2, 1, 0))) is not True


def test_five_checks_make_a_pair_and_five_misses_undo_it(world: Any) -> None:
    """Up by one on a hit, one when it is full; and apart only when the counter is empty again."""
    there = world.two_radars
    same, other = (seen(there, [there.Course(), there.Course(left_m=3000.0)], second=(k,)) for k in (1, 2))
    other = RadarTracks({**same.plots, (2, 1, 0): other.plots[2, 2, 0]})  # the number 2/1 is on the other aircraft
    state, made = Together(), []
    for tracks in (*[same] * 6, *[other] * 6):
        state = compared(looked(state, there.at(8.0), tracks, there.radars), tracks, {})
        made.append(((1, 1, 0), (2, 1, 0)) in state.one)
    assert made == [False] * 4 + [True] * 6 + [False] * 2
    assert state.seen is not None
    assert together(state.seen.keys, state.one) == [[(1, 2, 0), (2, 1, 0)]]
