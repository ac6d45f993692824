"""Errors that are learnt along the way, faded, and told apart from each aircraft's own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators.registration_evidence import Evidence, Pairs, faded, learnt, remembering, without
from gateway.estimators.registration_solution import Solution, folded, solved
from gateway.frames import polar_from_xyz, polar_jacobian

SECOND = 10**9
ERROR = np.array([150.0, math.radians(0.5), math.radians(0.2)])  # what it measures too much
LATE_S = 0.05
SIGMA = np.array([15.0, 1e-3, 1e-3])
USUAL_M = 35.0  # what own errors are expected to be


class Sky:
    """Aircraft in straight flight about a radar, each with an error of its own beside a common one."""

    def __init__(self, seed: int, own_m: float, common_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self.chance = np.random.default_rng(seed)
        heading = self.chance.uniform(0.0, 2.0 * math.pi, 10)
        self.begin = np.c_[self.chance.uniform(-40e3, 40e3, (10, 2)), self.chance.uniform(500.0, 6000.0, 10)]
        self.speed = np.c_[80.0 * np.cos(heading), 80.0 * np.sin(heading), self.chance.uniform(-3.0, 3.0, 10)]
        self.off = self.chance.standard_normal((10, 3)) * own_m + np.array(common_m)

    def pairs(self, time_s: float, error: NDArray[np.float64] = ERROR, radar: int = 1) -> Pairs:
        true = self.begin + self.speed * time_s
        turning = (polar_jacobian(true) @ self.speed[..., None])[..., 0]
        measured = polar_from_xyz(true) - turning * LATE_S + error + self.chance.standard_normal((10, 3)) * SIGMA
        told = true + self.off + self.chance.standard_normal((10, 3)) * 15.0
        by_enu = polar_jacobian(told)
        off = measured - polar_from_xyz(told)
        off[:, 1] = np.remainder(off[:, 1] + math.pi, 2.0 * math.pi) - math.pi
        sigma = np.sqrt(SIGMA**2 + ((by_enu * 15.0) ** 2).sum(axis=-1))
        names = [f"mavlink:{number}" for number in range(10)]
        return Pairs(names, [radar] * 10, off, sigma, by_enu, (by_enu @ self.speed[..., None])[..., 0])


def watched(sky: Sky, seconds: int, constant_s: float = 300.0, evidence: Evidence = Evidence()) -> Evidence:
    solution: Solution | None = None
    for second in range(seconds):
        evidence = faded(evidence, math.exp(-1.0 / constant_s))
        evidence = learnt(evidence, sky.pairs(float(second)), second * SECOND, solution)
        if second % 10 == 0:
            solution = solved(evidence, USUAL_M)
    return evidence


def last(evidence: Evidence) -> Solution:
    solution = solved(evidence, USUAL_M)
    assert solution is not None
    return solution


@pytest.mark.parametrize(("own_m", "common_m"), [(0.0, (30.0, -20.0, 25.0)), (10.0, (0.0, 0.0, 0.0))])
def test_in_five_minutes_of_ten_aircraft_a_radar_is_known(own_m: float, common_m: tuple[float, float, float]) -> None:
    off = np.array([last(watched(Sky(seed, own_m, common_m), 300)).error[0] - [*ERROR, LATE_S] for seed in range(4)])
    assert np.sqrt((off[:, 0] ** 2).mean()) < 5.0
    assert np.degrees(np.sqrt((off[:, 1:3] ** 2).mean(axis=0))).max() < 0.02


def test_sigmas_are_as_large_as_the_errors_are() -> None:
    for own_m in (0.0, 10.0, 60.0):
        found = [last(watched(Sky(seed, own_m), 120)) for seed in range(6)]
        sigmas = np.array([(one.error[0] - [*ERROR, LATE_S]) / one.sigma[0] for one in found])
        assert np.sqrt((sigmas**2).mean()) < 1.4
        assert np.abs(sigmas).max() < 4.0


def test_how_large_own_errors_are_is_found_from_how_they_differ() -> None:
    small, large = (
        np.mean([last(watched(Sky(seed, own_m), 120)).own_sigma_m for seed in range(5)]) for own_m in (5.0, 60.0)
    )
    assert small < 15.0
    assert 40.0 < large < 80.0


def test_own_errors_of_sixty_metres_are_claimed_no_better_than_they_allow() -> None:
    (few,) = (last(watched(Sky(4, 60.0), 60)),)
    (many,) = (last(watched(Sky(4, 60.0), 300)),)
    assert few.sigma[0, 1] > 0.3 * many.sigma[0, 1]
    assert math.degrees(float(many.sigma[0, 1])) > 0.003


def test_wrong_pairs_pull_little_once_something_is_known() -> None:
    sky = Sky(5, 10.0)
    evidence = watched(sky, 60)
    known = last(evidence)
    strange = sky.pairs(60.0)
    strange.off[0] += [3000.0, 0.2, 0.1]
    moved = last(learnt(evidence, strange, 60 * SECOND, known))
    assert (np.abs(moved.error - known.error)[0, :3] < 1.0 * known.sigma[0, :3]).all()


def test_missing_components_tell_nothing_and_harm_nothing() -> None:
    sky = Sky(6, 10.0)
    pairs = sky.pairs(0.0)
    pairs.off[:, 2] = math.nan
    found = last(learnt(Evidence(), pairs, 0, None))
    assert np.isfinite(found.error).all()
    assert found.sigma[0, 2] > 0.05
    assert found.sigma[0, 1] < 0.05


def test_what_was_long_ago_counts_less() -> None:
    evidence = watched(Sky(7, 10.0), 60)
    before, after = last(evidence), last(faded(evidence, 0.1))
    assert (after.sigma > before.sigma).all()
    assert after.sigma[0, 0] > 1.5 * before.sigma[0, 0]
    assert after.error[0, :3] == pytest.approx(before.error[0, :3], rel=0.1)


def test_aircraft_that_left_are_folded_into_one_sum_that_tells_the_same() -> None:
    evidence = watched(Sky(7, 10.0, (20.0, 0.0, 10.0)), 60)
    known = last(evidence)
    alone = folded(evidence, 60 * SECOND, known.own_sigma_m)
    assert alone.links == ()
    assert folded(evidence, 59 * SECOND, known.own_sigma_m) is evidence
    again = solved(alone, known.own_sigma_m)
    assert again is not None
    assert again.error == pytest.approx(known.error, rel=1e-2)
    assert again.sigma == pytest.approx(known.sigma, rel=1e-2)
    assert again.common_m == pytest.approx(known.common_m, rel=1e-2)


def test_a_radar_that_is_heard_later_gets_errors_of_its_own() -> None:
    sky = Sky(8, 10.0)
    evidence = watched(sky, 60)
    alone = last(evidence)
    for second in range(60, 120):
        evidence = learnt(evidence, sky.pairs(float(second), -ERROR, radar=0), second * SECOND, None)
    both = last(evidence)
    assert both.radars == (0, 1)
    assert both.error[1, :3] == pytest.approx(alone.error[0, :3], abs=3.0 * float(alone.sigma[0, 0]))
    assert float(both.error[0, 0]) == pytest.approx(-150.0, abs=15.0)
    left = last(without(evidence, 0))
    assert left.radars == (1,)
    assert left.error[0] == pytest.approx(alone.error[0], abs=1e-9)
    gone = without(without(evidence, 0), 1)
    assert solved(gone, USUAL_M) is None


def test_what_is_forgotten_of_a_radar_is_forgotten_of_aircraft_that_left_too() -> None:
    sky = Sky(9, 10.0)
    evidence = watched(sky, 60)
    for second in range(60, 120):
        evidence = learnt(evidence, sky.pairs(float(second), -ERROR, radar=2), second * SECOND, None)
    own_m = last(evidence).own_sigma_m
    left = solved(without(folded(evidence, 200 * SECOND, own_m), 1), own_m)
    assert left is not None
    assert (np.abs(left.error[0, :3] + ERROR) < 4.0 * left.sigma[0, :3]).all()
    assert left.sigma[0, 0] < 30.0


def test_what_was_known_before_is_evidence_like_any_other() -> None:
    sigma = np.array([3.0, 2e-4, math.nan, 5e-3])
    known = remembering(Evidence(), 1, np.array([150.0, 0.01, math.nan, 0.05]), sigma)
    first = last(known)
    assert first.error[0] == pytest.approx([150.0, 0.01, 0.0, 0.05], rel=3e-3, abs=1e-9)
    assert first.sigma[0, [0, 1, 3]] == pytest.approx(sigma[[0, 1, 3]], rel=1e-3)
    assert first.sigma[0, 2] == pytest.approx(0.1)
    assert first.observable[0].tolist() == [True, True, False, True]


def test_a_flight_straight_towards_the_radar_does_not_tell_range_and_time() -> None:
    evidence, chance = Evidence(), np.random.default_rng(3)
    for second in range(300):
        true = np.array([[50e3 - 80.0 * second, 300.0, 2500.0 - 4.0 * second]])
        by_enu, off = polar_jacobian(true), chance.standard_normal((1, 3)) * SIGMA
        rates = (by_enu @ np.array([-80.0, 0.0, -4.0])[:, None])[..., 0]
        evidence = learnt(evidence, Pairs(["one"], [1], off, SIGMA[None], by_enu, rates), second * SECOND, None)
    found = last(evidence)
    assert not found.observable[0, [0, 3]].any()
    assert found.sigma[0, 0] > 25.0
    assert found.condition > 30.0


def test_a_common_error_beyond_its_prior_is_said_by_chi_square() -> None:
    quiet, wrong = (last(watched(Sky(5, 5.0, common), 120)) for common in ((20.0, -10.0, 10.0), (150.0, -60.0, 90.0)))
    assert quiet.prior_chi_square < 11.3
    assert wrong.prior_chi_square > 16.3


def test_how_far_pairs_may_be_off_is_known_before_they_come() -> None:
    sky = Sky(6, 10.0)
    solution, off = last(watched(sky, 120)), []
    for second in range(120, 220):
        left, variance = solution.left(sky.pairs(float(second)))
        off.append(left / np.sqrt(variance))
    assert 0.8 < np.sqrt((np.array(off) ** 2).mean()) < 1.2
    left, variance = solution.left(sky.pairs(0.0, radar=3))
    assert np.isinf(variance).all()
