"""What became of earlier predictions: sigmas that were too small grow, such that were too large shrink, and no more than that."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gateway.predict.hindsight import LEAST, MOST, USUAL, kept, learnt, scaled
from gateway.predict.minds import LEARNT, Minds
from gateway.predict.spread import Spread
from gateway.predict.states import State

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
HORIZONS = (10.0, 30.0)
NORTH = 0.5 * math.pi


def state(north_m: float, since_s: float = 0.0) -> State:
    """One track that flies northward at 50 m/s, so far north."""
    one, nothing = np.ones(1), np.zeros((1, 3))
    place, velocity = np.array([[0.0, north_m]]), np.array([[0.0, 50.0]])
    columns = (
        np.array([since_s]),
        place,
        place,
        velocity,
        50.0 * one,
        one,
        one,
        one,
        one,
        one,
        one,
        nothing,
        one > 0.0,
    )
    return State(*columns)


def flown(seconds: int, sigma_m: float, off_m: float, since_s: float = 0.0, turns: bool = False) -> Spread:
    """Sigmas of 1 m, as scaled after so many seconds of predictions that were off by draws of `off_m` and said `sigma_m`."""
    draws, minds = np.random.default_rng(3), Minds.empty(1)
    flags, course = np.full((1, 2), turns), np.full((1, 2), NORTH)
    said = Spread(np.full((1, 2), sigma_m), np.full((1, 2), sigma_m))
    for second in range(seconds):
        at, north = T0 + second * SECOND, 50.0 * second
        minds = learnt(minds, at, state(north, since_s), HORIZONS)
        ahead = np.array([[[0.0, north + 50.0 * horizon] for horizon in HORIZONS]]) + draws.normal(
            0.0, off_m, (1, 2, 2)
        )
        minds = kept(minds, at, HORIZONS, ahead, course, said, flags, np.array([True]))
    return scaled(minds, Spread(np.ones((1, 2)), np.ones((1, 2))), flags)


def test_sigmas_that_fit_stay() -> None:
    """Off by what is said: after ten minutes the scale is 1 within 15 %."""
    found = flown(600, 20.0, 20.0)
    assert found.along[0] == pytest.approx([1.0, 1.0], abs=0.15)
    assert found.across[0] == pytest.approx([1.0, 1.0], abs=0.15)


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_what_is_said_too_small_or_large_is_learnt(times: float) -> None:
    """Off by half or twice of what is said: the scale has gone most of the way."""
    found = flown(900, 20.0, 20.0 * times)
    assert found.along[0] == pytest.approx([times, times], rel=0.25)


def test_the_scale_is_bounded() -> None:
    """Whatever comes, sigmas are neither more than ten times nor less than a third of what is derived."""
    assert (flown(900, 1.0, 1000.0).along <= MOST).all()
    assert (flown(900, 1000.0, 0.0).along >= LEAST).all()


def test_a_track_that_coasts_learns_nothing() -> None:
    """Where nothing was measured for five seconds, nobody knows how far off the prediction was."""
    assert flown(300, 1.0, 100.0, since_s=5.0).along[0].tolist() == [1.0, 1.0]


def test_ways_with_and_without_a_turn_learn_apart() -> None:
    """What was learnt on straights does not change what is said of turns."""
    minds = replace(Minds.empty(1), sigmas=np.zeros((1, 2, LEARNT, 2)), counted=np.zeros((1, 2, LEARNT)))
    minds.sigmas[:, 0], minds.counted[:, 0] = 20.0, 10.0
    some = Spread(np.ones((1, 2)), np.ones((1, 2)))
    assert (scaled(minds, some, np.zeros((1, 2), dtype=np.bool_)).along > 1.5).all()
    assert scaled(minds, some, np.ones((1, 2), dtype=np.bool_)).along[0].tolist() == [1.0, 1.0]


def test_a_long_horizon_begins_with_half_of_what_a_short_one_has_learnt() -> None:
    """Four times too far off in ten seconds: sigmas for thirty, of which nothing has come due, are doubled."""
    minds = replace(Minds.empty(1), sigmas=np.zeros((1, 2, LEARNT, 2)), counted=np.zeros((1, 2, LEARNT)))
    minds.counted[:, 0, 0] = 1e6
    minds.sigmas[:, 0, 0] = 4.0 * USUAL * 1e6
    found = scaled(minds, Spread(np.ones((1, 2)), np.ones((1, 2))), np.zeros((1, 2), dtype=np.bool_))
    assert found.along[0] == pytest.approx([4.0, 2.0], rel=1e-3)
    assert found.across[0] == pytest.approx([4.0, 2.0], rel=1e-3)
